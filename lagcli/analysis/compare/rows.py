"""The runs of a comparison: formulations, methods and tolerances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from lagcli.errors import UsageError
from lagcli.model.spelling import did_you_mean, nearest
from lagcli.settings.methods import FORMULATIONS, METHODS, has, methods_of
from lagcli.settings.resolve import compiled_available
from lagcli.settings.settings import Settings

#: Formulations in addition to those of the engines, integrated by SciPy's DOP853.
REDUCED = ("ggl", "maggi", "second")
#: Factor of the reference run's tolerance.
_TIGHTER = 1e-3
_LEAST_RTOL = 1e-13


class ComparedRow(NamedTuple):
    """A formulation, a method and a relative tolerance."""

    formulation: str
    method: str
    engine: str
    rtol: float


def reference_row(settings: Settings, rtols: Sequence[float]) -> ComparedRow:
    """Return the reference run: projection, with the smallest tolerance."""
    rtol = max(_TIGHTER * min(rtols or [settings.rtol]), _LEAST_RTOL)
    engine = "compiled" if compiled_available() else "scipy"
    return ComparedRow("projection", "DOP853", engine, rtol)


def rows_of(
    settings: Settings,
    formulations: Sequence[str] = (),
    methods: Sequence[str] = (),
    rtols: Sequence[float] = (),
) -> tuple[ComparedRow, ...]:
    """Return the runs to compare.

    By default: all formulations with DOP853, all methods of the compiled engine and DOP853
    of the reference engine with projection, and a tolerance that is a thousand times larger.
    Otherwise all supported combinations of the chosen formulations, methods and tolerances.

    Raises
    ------
    UsageError
        A formulation or method is unknown, or no chosen method supports a chosen formulation.
    """
    _check(formulations, (*FORMULATIONS, *REDUCED), "formulation")
    _check(methods, tuple(METHODS), "method")
    rtol = settings.rtol
    if not (formulations or methods or rtols):
        first = _row("projection", "DOP853", rtol)
        coarse = _row("projection", "DOP853", min(1e3 * rtol, 0.1))
        others = [_row(f, "DOP853", rtol) for f in (*FORMULATIONS[1:], *REDUCED)]
        compiled = methods_of("compiled") if compiled_available() else ()
        others += [_row("projection", m, rtol) for m in compiled if m != "DOP853"]
        reference = ComparedRow("projection", "DOP853", "scipy", rtol)
        rows = [first, *others, reference, coarse]
    else:
        rows = [
            _row(formulation, method, tolerance)
            for formulation in formulations or ("projection",)
            for method in methods or ("DOP853",)
            for tolerance in rtols or (rtol,)
            if _suits(formulation, method)
        ]
        if not rows:
            raise UsageError(
                f"no method of {', '.join(methods)} has the formulation {', '.join(formulations)};"
                " DOP853 has all of them"
            )
    return tuple(dict.fromkeys(rows))


def _check(names: Sequence[str], known: Sequence[str], what: str) -> None:
    for name in names:
        if name not in known:
            remedy = did_you_mean(nearest(name, known)) or f"there are {', '.join(known)}"
            raise UsageError(f"there is no {what} `{name}`; {remedy}")


def _suits(formulation: str, method: str) -> bool:
    if formulation in REDUCED:
        return method == "DOP853"
    return any(has(engine, method, formulation) for engine in _engines())


def _engines() -> tuple[str, ...]:
    return ("compiled", "scipy") if compiled_available() else ("scipy",)


def _row(formulation: str, method: str, rtol: float) -> ComparedRow:
    if formulation in REDUCED:
        return ComparedRow(formulation, method, "scipy", rtol)
    engine = next(e for e in _engines() if has(e, method, formulation))
    return ComparedRow(formulation, method, engine, rtol)
