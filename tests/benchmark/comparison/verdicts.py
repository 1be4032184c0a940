"""What lagcli is meant to reach, and whether it does: every target with its measured figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from comparison.deriving import Derivation, Growth
from comparison.measure import Result
from comparison.process import WholeProcess

Results = Mapping[str, Sequence[Result]]
OURS = "lagcli"
SMALL = ("pendulum", "slider_crank", "andrews", "chain_5", "chain_20")
STIFF = ("stiff_chain_1e6", "stiff_chain_1e8")
NOT_STIFF = (*SMALL, "chain_100", "chain_500")


@dataclass(frozen=True)
class Verdict:
    """A target, what was measured, and whether that meets it; None: nothing to compare with."""

    target: str
    measured: str
    met: bool | None


def best(results: Sequence[Result], program: str, error: float, name: str = "") -> float | None:
    """Return the least time of a program's methods to an error, s."""
    times = [
        r.seconds_at(error) for r in results if r.program == program and r.name.startswith(name)
    ]
    return min((t for t in times if t is not None), default=None)


def ratio(
    results: Sequence[Result], program: str, errors: Sequence[float], name: str = ""
) -> tuple[float, float] | None:
    """Return a program's time relative to ours, and at which error: the least that both reach."""
    for error in errors:
        ours, theirs = best(results, OURS, error), best(results, program, error, name)
        if ours is not None and theirs is not None:
            return theirs / ours, error
    return None


def faster(
    results: Results,
    cases: Sequence[str],
    program: str,
    factor: float | Callable[[str], float],
    target: str,
    name: str = "",
) -> Verdict:
    """Judge: at equal error, ``factor`` times faster than a program, in every one of the cases."""
    texts, met = [], []
    for case in cases:
        if case not in results:
            continue
        measured = results[case]
        tried = [r for r in measured if r.program == program and r.name.startswith(name)]
        if not any(r.points for r in tried):
            continue
        wanted = factor(case) if callable(factor) else factor
        found = ratio(measured, program, (1e-9, 1e-6, 1e-4), name)
        if found is None:
            reached = best(measured, OURS, 1e-9) is not None
            texts.append(f"{case}: {'not reached by it' if reached else 'not reached by lagcli'}")
            met.append(reached)
            continue
        value, error = found
        ok = value >= wanted
        met.append(ok)
        at = "" if error == 1e-9 else f" (at {error:.0e})"
        texts.append(f"{case}: {value:.3g}{at}{'' if ok else ' ✗'}")
    return Verdict(target, "; ".join(texts) or "not measured", all(met) if met else None)


def judge(
    results: Results,
    derivation: Derivation | None,
    growth: Sequence[Growth],
    process: WholeProcess | None,
) -> list[Verdict]:
    """Judge every target."""
    hundredfold = ("pendulum", "slider_crank")
    every = (*NOT_STIFF, *STIFF)
    verdicts = [
        faster(
            results,
            SMALL,
            "lambdify + solve_ivp",
            lambda case: 100 if case in hundredfold else 20,
            "20 times faster than lambdify + solve_ivp on small cases, 100 times on pendulum and"
            " slider-crank",
        ),
        faster(results, every, "CasADi", 4, "4 times faster than CasADi's IDAS", name="IDAS"),
        faster(results, every, "CasADi", 1, "faster than CasADi at its best setting"),
        faster(results, NOT_STIFF, "scikit-sundae", 4, "4 times faster than scikit-sundae"),
        faster(results, NOT_STIFF, "heyoka", 1 / 1.5, "within 1.5 times heyoka's time (≥ 0.667)"),
        faster(results, every, "Exudyn", 1, "faster than Exudyn at its best setting"),
        faster(results, every, "PyDy", 1, "faster than PyDy"),
        faster(results, STIFF, "SciPy", 10, "stiff: 10 times faster than SciPy's Radau and BDF"),
        faster(
            results, STIFF, "scikit-sundae", 4, "stiff: 4 times faster than CVODE's BDF and IDA"
        ),
    ]
    by_length = {g.bodies: g for g in growth}
    if {50, 500} <= set(by_length):
        short, long = by_length[50], by_length[500]
        for text, value in (
            ("a right-hand side of 500 bodies costs", long.evaluation / short.evaluation),
            ("loading and deriving 500 bodies costs", long.load_and_derive / short.load_and_derive),
        ):
            verdicts.append(
                Verdict(f"{text} at most 12 times that of 50", f"{value:.3g}", value <= 12)
            )
    if derivation is not None:
        target = "deriving the pendulum of ten links 100 times faster than SymPy's LagrangesMethod"
        if derivation.sympy is None:
            verdicts.append(Verdict(target, "no result of SymPy's in time", None))
        else:
            value = derivation.sympy / derivation.lagcli
            verdicts.append(Verdict(target, f"{value:.3g}", value >= 100))
    if process is not None:
        value = process.simulate / process.imports
        target = "the whole process at most 2.2 times the bare imports"
        verdicts.append(Verdict(target, f"{value:.3g}", value <= 2.2))
    return verdicts
