"""Bands around curves: the effect of uncertain parameters on the motion.

With the derivatives in the result, the half-width is (Σ (∂y/∂p · spread of p)²)^½ to first order.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import DERIVATIVES
from lagcli.errors import UsageError
from lagcli.pictures.plots.curves import Curve
from lagcli.pictures.run_file import RunFile

#: The fields with derivatives, and the fields of these.
_DERIVED = dict(zip(("q", "v", "multipliers"), (x.name for x in DERIVATIVES), strict=True))


def read_bands(run: RunFile, given: Sequence[str]) -> dict[str, float]:
    """Return the spreads of parameters by name, in SI.

    Parameters
    ----------
    run : RunFile
    given : sequence of str
        ``l=0.01`` (in SI) or ``l=5%`` of the parameter's value.

    Raises
    ------
    UsageError
        An entry has another form, or the result has no derivatives with respect to the name.
    """
    found: dict[str, float] = {}
    for text in given:
        name, equals, spread = (x.strip() for x in text.partition("="))
        percent = spread.endswith("%")
        try:
            value = float(spread.removesuffix("%"))
        except ValueError:
            value = -1.0
        if not equals or not 0 <= value < np.inf:
            raise UsageError(
                f"--band {text!r} is not of the form NAME=SPREAD, as in l=0.01 or l=5%"
            )
        if name not in run.sensitivity:
            has = (
                f"it has those by {', '.join(run.sensitivity)}"
                if run.sensitivity
                else (f"simulate with --sensitivity {name or 'NAME'}")
            )
            raise UsageError(f"--band {text}: {run.name} has no derivatives by `{name}`; {has}")
        if percent:
            known = {**run.record.parameters, **_initial(run)}
            if name not in known:
                raise UsageError(
                    f"--band {text}: {run.name} lacks the value of `{name}`, which a CSV file"
                    " without its sidecar (--meta) does not contain; give the spread in SI, as in"
                    f" {name}=0.01"
                )
            value *= abs(known[name]) / 100
        found[name] = value
    return found


def _initial(run: RunFile) -> dict[str, float]:
    """Return the initial values by name."""
    first = run.columns(["q", "v"], np.array([0]))
    names = run.coordinates
    found = dict(zip(names, first["q"][0].tolist(), strict=True))
    return {**found, **{f"{q}'": x for q, x in zip(names, first["v"][0].tolist(), strict=True)}}


def half_widths(
    run: RunFile, curves: Iterable[Curve], spreads: Mapping[str, float]
) -> dict[str, Array]:
    """Return the half-widths of the bands of curves, by name; others have none.

    Raises
    ------
    UsageError
        None of the curves has derivatives.
    """
    if not spreads:
        return {}
    wanted = {c.name: c for c in curves if c.field in _DERIVED}
    if not wanted:
        raise UsageError(
            "--band: bands are drawn around coordinates, velocities and multipliers over time, and"
            " none of the curves is one; name some of these, or omit --band"
        )
    fields = run.columns({_DERIVED[c.field] for c in wanted.values()})
    weights = np.array([spreads.get(name, 0.0) for name in run.sensitivity])
    return {
        name: np.linalg.norm(fields[_DERIVED[c.field]][:, c.place[0]] * weights, axis=1)
        for name, c in wanted.items()
    }
