"""Measure, and write the page: ``python -m comparison --help``."""

from __future__ import annotations

import argparse
import dataclasses
import datetime
import json
import os
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[3]


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="comparison", description=__doc__)
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "benchmarks.md")
    parser.add_argument("--raw", type=Path, default=ROOT / "build" / "benchmarks.json")
    parser.add_argument("--case", action="append", help="this case alone; may be repeated")
    parser.add_argument("--program", action="append", help="lagcli and this program alone")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--before", type=Path, help="checkout of an earlier revision, built")
    parser.add_argument(
        "--ported", action="store_true", help="measure the ported models alone, on the same page"
    )
    return parser.parse_args()


def ported_alone(options: argparse.Namespace) -> None:
    """Replace the section of the ported models."""
    from comparison import machine, table
    from comparison.ported import measure_ported

    where = (
        f"Measured {datetime.date.today().isoformat()} on {machine.processor()}, load average"
        f" {machine.load():.1f}."
    )

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    for found in measure_ported(options.before, min(options.rounds, 2), say):
        page = options.output.read_text(encoding="utf-8")
        page = table.with_ported(page, table.ported_section(found, where))
        options.output.write_text(page, encoding="utf-8")


def main() -> None:
    """Measure what the command line asks for."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"  # before NumPy is loaded, here and in all workers
    from comparison import run, table

    options = arguments()
    if options.ported:
        ported_alone(options)
        return
    options.raw.parent.mkdir(parents=True, exist_ok=True)
    for report in run.measure_all(options.case, options.program, options.rounds, options.before):
        # after each case: a run that is broken off keeps what it has
        options.output.write_text(table.render(report), encoding="utf-8")
        raw = json.dumps(dataclasses.asdict(report), indent=1) + "\n"
        options.raw.write_text(raw, encoding="utf-8")
    print(f"written {options.output} and {options.raw}", file=sys.stderr)


if __name__ == "__main__":
    began = time.perf_counter()
    main()
    print(f"{time.perf_counter() - began:.0f} s", file=sys.stderr)
