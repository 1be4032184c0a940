"""Cases and methods → Report: what is measured, in which order."""

from __future__ import annotations

import datetime
import sys
import time
from collections.abc import Iterator, Sequence

from comparison import deriving, machine, process
from comparison.cases import CASES
from comparison.contacts import measure_contacts
from comparison.measure import Effort, measure
from comparison.methods import Method
from comparison.peers import METHODS
from comparison.ported import measure_ported
from comparison.reference import reference
from comparison.table import Report
from comparison.verdicts import OURS


def available(programs: Sequence[str] | None) -> list[Method]:
    """Return the methods requested whose packages are installed, ours among them."""
    return [
        method
        for method in METHODS
        if all(machine.installed(package) for package in method.packages)
        and (programs is None or method.program in (OURS, *programs))
    ]


def measure_all(
    cases: Sequence[str] | None = None,
    programs: Sequence[str] | None = None,
    rounds: int = 5,
) -> Iterator[Report]:
    """Measure cases (all if None) with programs (all if None); yield the report after each case."""
    report = Report(
        datetime.date.today().isoformat(),
        machine.processor(),
        machine.system(),
        machine.versions(),
        machine.load(),
        machine.revision(),
        {name: case.title for name, case in CASES.items()},
        {name: case.t_end for name, case in CASES.items()},
    )
    began = time.perf_counter()

    def say(text: str) -> None:
        print(f"{time.perf_counter() - began:6.1f} s  {text}", file=sys.stderr, flush=True)

    if cases is None:
        say("the whole process")
        report.process = process.whole_process(rounds=2 * rounds)
        for report.ported in measure_ported(rounds, say):
            pass
        report.contacts = list(measure_contacts(rounds, say))
        say("deriving")
        report.derivation = deriving.derivation(timeout=120.0)
        say("growth")
        report.growth = deriving.growth()
    for name in cases or CASES:
        say(f"{name}: reference")
        exact = reference(CASES[name])
        report.references[name] = exact.source
        say(f"{name}: methods")
        report.results[name] = measure(
            CASES[name], available(programs), exact.positions, Effort(rounds=rounds)
        )
        yield report
