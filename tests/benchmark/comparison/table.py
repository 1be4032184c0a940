"""The results → ``docs/benchmarks.md``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from comparison.contacts import Cost
from comparison.deriving import LINKS, Derivation, Growth
from comparison.measure import Result
from comparison.ported import Models, Ported, verdicts
from comparison.process import IMPORTS, WholeProcess
from comparison.verdicts import OURS, Verdict, best, judge

#: Errors at which times are compared.
ERRORS = (1e-6, 1e-9)


@dataclass
class Report:
    """All that was measured."""

    date: str
    processor: str
    system: str
    versions: Mapping[str, str | None]
    load: float = 0.0
    revision: str = ""
    titles: Mapping[str, str] = field(default_factory=dict)
    spans: Mapping[str, float] = field(default_factory=dict)
    references: dict[str, str] = field(default_factory=dict)
    results: dict[str, list[Result]] = field(default_factory=dict)
    derivation: Derivation | None = None
    growth: list[Growth] = field(default_factory=list)
    process: WholeProcess | None = None
    contacts: list[Cost] = field(default_factory=list)
    ported: dict[str, Ported] = field(default_factory=dict)


def seconds(value: float | None) -> str:
    """Return a time as a reader wants it."""
    if value is None or value != value:
        return "–"
    if value < 1e-3:
        return f"{value * 1e6:.3g} µs"
    if value < 1:
        return f"{value * 1e3:.3g} ms"
    return f"{value:.3g} s"


def _times(value: float | None, ours: float | None) -> str:
    return "–" if value is None or not ours else f"{value / ours:.3g}"


def _row(result: Result, ours: Mapping[float, float | None]) -> list[str]:
    at = {error: result.seconds_at(error) for error in ERRORS}
    tightest = min(result.points, key=lambda p: p.error, default=None)
    if tightest is None:
        return [result.title, result.note, *["–"] * (2 * len(ERRORS) + 1), seconds(result.setup)]
    settings = f"{result.unit} {result.points[0].setting:.0e} … {result.points[-1].setting:.0e}"
    return [
        result.title,
        settings + (f"; {result.note}" if result.note else ""),
        *(x for e in ERRORS for x in (seconds(at[e]), _times(at[e], ours[e]))),
        f"{tightest.error:.1e} in {seconds(tightest.least)}",
        seconds(result.setup),
    ]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return [
        f"| {' | '.join(head)} |",
        f"|{'---|' * len(head)}",
        *(f"| {' | '.join(x.replace('|', '/') for x in row)} |" for row in rows),
        "",
    ]


def _case(report: Report, name: str) -> list[str]:
    results = report.results[name]
    ours = {error: best(results, OURS, error) for error in ERRORS}
    measured = [r for r in results if r.points]
    measured.sort(key=lambda r: (r.seconds_at(1e-9) or 1e9, r.seconds_at(1e-6) or 1e9))
    missing = [r for r in results if not r.points]
    head = ["program, method", "settings"]
    for error in ERRORS:
        head += [f"to {error:.0e}", "× ours"]
    head += ["least error", "set-up"]
    lines = [f"### {report.titles[name]}", ""]
    lines += [f"0 to {report.spans[name]:g} s. Reference: {report.references[name]}.", ""]
    lines += _table(head, [_row(r, ours) for r in measured])
    if missing:
        lines += ["Not in this table: " + "; ".join(f"{r.title} ({r.note})" for r in missing), ""]
    return lines


def _verdicts(verdicts: Sequence[Verdict]) -> list[str]:
    words = {True: "met", False: "**not met**", None: "not measured"}
    return _table(
        ["target", "measured", ""], [[v.target, v.measured, words[v.met]] for v in verdicts]
    )


CONTACTS = "## Contact, events and kinks"
PORTED = "## Ported models"


def contacts_section(costs: Sequence[Cost], where: str) -> list[str]:
    """Return the section of contacts, events and kinks."""

    def side(value: float, unit: str) -> str:
        return seconds(value) if unit == "s" else f"{value:.0f} {unit}"

    rows = [
        [
            x.title + (f" ({x.remark})" if x.remark else ""),
            side(x.ours, x.unit),
            x.other or "–",
            side(x.theirs, x.unit) if x.other else "–",
            f"{x.ratio:.3g}" if x.other else "–",
            x.goal,
            "met" if x.met else "**not met**",
        ]
        for x in costs
    ]
    return [
        CONTACTS,
        "",
        "Processor time of the integration alone, with DOP853, samples included; both sides take"
        f" turns in one process. Medians, and the median of the ratios. {where}",
        "",
        *_table(["", "lagcli", "beside", "it takes", "ratio", "goal", ""], rows),
    ]


def ported_section(models: Models, where: str) -> list[str]:
    """Return the section of the ported models."""

    def ratio(value: float | None) -> str:
        return "–" if value is None else f"{value:.2f}"

    def cell(value: float | str) -> str:
        return value if isinstance(value, str) else seconds(value)

    def peers(name: str, model: Ported) -> list[str]:
        titles = ("C", "heyoka", "CVODES Adams", "CVODES BDF")
        found = dict(zip(titles, model.peers[1:], strict=False))
        times = [
            p.note.removeprefix("fails: ") if p.note and not p.points else "not reached"
            for p in found.values()
        ]
        reached = [p.seconds_at(model.error) for p in found.values()]
        times = [
            seconds(x) if x is not None else note for x, note in zip(reached, times, strict=True)
        ]
        best = model.best_peer(total=True)
        return [
            name,
            str(model.unknowns),
            f"{model.error:.1e}",
            f"{model.difference:.0e}" if model.difference == model.difference else "–",
            seconds(model.integration),
            *times,
            *["–"] * (len(titles) - len(times)),
            ratio(model.over_peer()),
            seconds(model.total),
            f"{seconds(best[0])} ({best[1].program})" if best else "–",
            cell(model.process),
        ]

    def methods(name: str, model: Ported) -> list[str]:
        row = [name]
        for longer in model.methods:
            best = model.best_method(longer)
            row += [
                cell(model.methods[longer]["auto"]),
                f"{seconds(best[0])} ({best[1]})" if best else "–",
                ratio(model.over_method(longer)),
            ]
        return row

    words = {True: "met", False: "**not met**"}
    goals = [[goal, text, words[met]] for goal, text, met in verdicts(models)]
    return [
        PORTED,
        "",
        "Models of `tests/found` and `tests/benchmark/cases`, which others published: textbooks,"
        " benchmark collections, other tools. Default options but for 101 samples. Processor time,"
        f" the least of several runs that take turns. {where}",
        "",
        *_table(["goal", "measured", ""], goals),
        "The default run (`auto`) beside programs that are given lagcli's equations with the"
        " elimination written out, values of the parameters folded in, and redundant constraints"
        " left out: `gcc -O3` with DOP853 in C, heyoka, CasADi's CVODES. Times are those of the"
        " integration to the error of the default run (the largest deviation of a coordinate from"
        " a run at 1e-13, in m, rad or what it is measured in; the column beside it has the"
        " deviation of C at 1e-13 from that run). Peers neither project nor compute λ. Total: from"
        " the model, for peers from the equations, to the samples, compilation included, without"
        " imports. Process: `lagcli simulate -o run.h5`.",
        "",
        *_table(
            [
                *("model", "unknowns", "error", "C differs by", "integration", "C", "heyoka"),
                *("CVODES Adams", "CVODES BDF", "over best", "total", "least total of peers"),
                "process",
            ],
            [peers(name, model) for name, model in models.items()],
        ),
        "`auto` beside the methods that can be requested: time from the model to the samples, at"
        " the duration of the model and at ten times it. Where a run does not end, the motion"
        " meets a singular configuration or the time was over.",
        "",
        *_table(
            ["model", "auto", "best method", "ratio", "auto, 10 ×", "best method", "ratio"],
            [methods(name, model) for name, model in models.items()],
        ),
    ]


def with_section(page: str, section: Sequence[str]) -> str:
    """Return a page with a section replaced, or added before the last."""
    begin, found, rest = page.partition(section[0] + "\n")
    if found:
        _, _, rest = rest.partition("\n## ")
    else:
        begin, _, rest = page.partition(_NOTES[0] + "\n")
        rest = _NOTES[0].removeprefix("## ") + "\n" + rest
    return begin + "\n".join(section) + "\n## " + rest


def render(report: Report) -> str:
    """Return the page."""
    there = [f"{name} {v}" for name, v in report.versions.items() if v]
    absent = [name for name, v in report.versions.items() if not v]
    lines = [
        "# Benchmarks",
        "",
        "Written by `make bench`, which measures everything here side by side in one run.",
        "",
        f"Measured {report.date} on {report.processor}; {report.system}.",
        f"lagcli's revision: {report.revision or 'unknown'}."
        f" Load average when it began: {report.load:.1f}.",
        f"Versions: {', '.join(there)}.",
    ]
    if absent:
        lines.append(f"Not available, and therefore not in the tables: {', '.join(absent)}.")
    lines += [
        "",
        "## Targets",
        "",
        "How many times longer the other program takes at an error of 1e-9 on q (1e-6, 1e-4 where"
        " it or lagcli does not reach that), by case.",
        "",
        *_verdicts(judge(report.results, report.derivation, report.growth, report.process)),
        "## Times at equal error",
        "",
        "The error is the largest deviation of any coordinate (m or rad) from the reference at 101"
        " equally spaced times. Each method runs at several tolerances (or step sizes); the time"
        " to an error is interpolated between them in log-log. Times are those of the integration"
        " alone, the least processor time of interleaved runs; set-up (deriving, compiling, a"
        " first run that compiles on demand) stands apart. × ours: relative to lagcli's best"
        " method.",
        "",
    ]
    for name in report.results:
        lines += _case(report, name)
    if report.growth:
        lines += ["## Growth with the number of bodies", ""]
        rows = [
            [str(g.bodies), *map(seconds, (g.load_and_derive, g.compile, g.evaluation))]
            for g in report.growth
        ]
        head = ["bodies", "load and derive", "compile", "per right-hand side"]
        lines += _table(head, rows)
        lines += [
            "lagcli alone; `models/chain.yaml` is read and derived. Per right-hand side: the"
            " integration's time, projection and samples included, divided by its evaluations.",
            "",
        ]
    if report.derivation:
        d = report.derivation
        lines += [
            "## Deriving",
            "",
            f"The pendulum of {LINKS} links in minimal coordinates: lagcli {seconds(d.lagcli)}"
            " (reading the model included), SymPy's `LagrangesMethod.form_lagranges_equations`"
            f" {seconds(d.sympy) if d.sympy else 'no result in time'}.",
            "",
        ]
    if report.process:
        p = report.process
        lines += [
            "## The whole process",
            "",
            f"`lagcli simulate models/slider_crank.yaml -o run.h5` takes {seconds(p.simulate)},"
            f' `python -c "{IMPORTS}"` {seconds(p.imports)}: {p.simulate / p.imports:.3g} times.',
            "",
        ]
    if report.contacts:
        lines += contacts_section(report.contacts, "Measured with the rest.")
    if report.ported:
        lines += ported_section(report.ported, "Measured with the rest.")
    return "\n".join([*lines, *_NOTES])


_NOTES = """\
## How each program is used

All start from the same consistent state and return q at the same times. One core, BLAS with one
thread; every method in a process of its own, with a limit on its time. The code is in
`tests/benchmark/comparison`, one module for each program.

- **lagcli**: model, equations, tapes and start are made once; the integration is timed, which
  also projects every sample and returns a, λ and the work done.
- **lambdify + solve_ivp**: SymPy's `lambdify` with common subexpressions shared and `math` in place
  of NumPy, `numpy.linalg.solve` (SuperLU for the long chains), SciPy's DOP853.
- **SciPy**, stiff cases: right-hand side and Jacobian compiled (C printed by SymPy, Numba).
- **CasADi**: SX. IDAS on the index-1 DAE with a and λ as algebraic variables, left out of the error
  test; CVODES on the ODE with the linear system eliminated symbolically.
- **scikit-sundae**: compiled functions. CVODE on the ODE; IDA on the index-1 DAE with its Jacobian,
  λ left out of the error test. Chains: loops written by hand that use the structure, and SUNDIALS'
  banded solver.
- **heyoka**: Taylor's method on the ODE with the linear system eliminated symbolically, unrolled
  where the equations are short. It does not project; the error given includes its drift. Where
  the reference is heyoka's too, its tightest errors are not independent.
- **Exudyn**: mass points and rigid bodies with joints and distance constraints; generalized-α, and
  the trapezoidal rule with constraints of index 2, at a series of step sizes. Open chains also as
  a kinematic tree in minimal coordinates, with its explicit Runge-Kutta method of order 6(7).
- **PyDy**: `System` of Kane's equations in minimal coordinates or with dependent ones, the Cython
  generator, SciPy's odeint.
""".splitlines()
