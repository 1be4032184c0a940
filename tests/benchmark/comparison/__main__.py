"""Measure, and write the page: ``python -m comparison --help``."""

from __future__ import annotations

import argparse
import dataclasses
import datetime
import json
import os
import sys
import time
from collections.abc import Sequence
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
    for name, what in (("ported", "the ported models"), ("contacts", "contacts and events")):
        parser.add_argument(
            f"--{name}", action="store_true", help=f"measure {what} alone, on the same page"
        )
    return parser.parse_args()


def sections_alone(options: argparse.Namespace) -> None:
    """Replace the sections of the ported models, or of contacts."""
    from comparison import machine, table
    from comparison.contacts import measure_contacts
    from comparison.ported import measure_ported

    where = (
        f"Measured {datetime.date.today().isoformat()} on {machine.processor()}, load average"
        f" {machine.load():.1f}, revision {machine.revision() or 'unknown'}."
    )

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    def write(section: Sequence[str]) -> None:
        page = options.output.read_text(encoding="utf-8")
        options.output.write_text(table.with_section(page, section), encoding="utf-8")

    if options.contacts:
        costs = list(measure_contacts(options.rounds, say))
        write(table.contacts_section(costs, where))
    if options.ported:
        for found in measure_ported(options.rounds, say, options.case):
            write(table.ported_section(found, where))


def main() -> None:
    """Measure what the command line requests."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"  # before NumPy is loaded, here and in all workers
    from comparison import run, table

    options = arguments()
    if options.ported or options.contacts:
        sections_alone(options)
        return
    options.raw.parent.mkdir(parents=True, exist_ok=True)
    for report in run.measure_all(options.case, options.program, options.rounds):
        # after each case: a run that is broken off keeps what it has
        options.output.write_text(table.render(report), encoding="utf-8")
        raw = json.dumps(dataclasses.asdict(report), indent=1) + "\n"
        options.raw.write_text(raw, encoding="utf-8")
    print(f"written {options.output} and {options.raw}", file=sys.stderr)


if __name__ == "__main__":
    began = time.perf_counter()
    main()
    print(f"{time.perf_counter() - began:.0f} s", file=sys.stderr)
