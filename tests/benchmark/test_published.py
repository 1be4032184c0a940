"""Published and closed-form problems: every case of ``cases/`` against its reference values.

How many digits can be requested is stated case by case (``cases/README.md``), and limited here by
the tolerance of the run.
"""

from __future__ import annotations

import math
import re
from functools import cache
from typing import Any

import numpy as np
import pytest
import reader
from scipy.integrate import quad

import lagcli
from lagcli.model.model import Model
from lagcli.trajectory.trajectory import Trajectory

RTOL = 1e-12
ATOL_OF = {"slider_crank_ivptestset": 1e-16}  # its elastic coordinates are of the order of 1e-5

#: Samples come from the dense output, whose order is one less than the method's: seen to be good
#: to some ten times RTOL.
DIGITS_OF_RUN = 10.5

#: The digits of `verification` are those of another run of the same kind, with other steps.
MARGIN = 1.0

#: Initial entries solved from the others, for a published initial state that satisfies the
#: constraints to ten digits only. How the defect is shared out is arbitrary, so the run starts
#: from the consistent state that the reference solution started from.
FREED = {"slider_crank_ivptestset": ("phi2", "x3", "phi2'", "x3'")}

#: Components so much smaller than the others that they are compared among themselves. Not their
#: accelerations, the differences of large forces.
SMALL = {"slider_crank_ivptestset": {"q1", "q2", "q3", "q4"}}
#: Their digits: they vibrate at up to 5e4 rad/s, 5000 rad in the 0.1 s of the case, and an error
#: of phase grows by RTOL at each of the 8000 steps.
DIGITS_OF_SMALL = 8.0

#: Reference times that take more than about 5 s to reach: not in the everyday run.
SLOW = {
    ("pendulum_iftomm_a01", 100.0),
    ("pendulum_iftomm_a01", 2000.0),
    ("slider_crank_ivptestset", 0.1),
}

CASES = {name: reader.Case(name) for name in reader.case_names()}
CLOSED = [name for name, case in CASES.items() if case.has_closed_form]
SINGULAR = [name for name, case in CASES.items() if case.singular]


def published() -> list:
    """Return one parameter set per row of reference values."""
    sets = []
    for name, case in CASES.items():
        for row, reference in enumerate(case.references):
            marks = [pytest.mark.slow] if (name, reference.time) in SLOW else []
            label = f"{name}-{reference.kind}-t{reference.time:g}-{row}"
            sets.append(pytest.param(name, row, id=label, marks=marks))
    return sets


@cache
def model(name: str) -> Model:
    free = FREED.get(name, ())
    start = next(r for r in CASES[name].references if r.time == 0) if free else None
    return lagcli.load_text(CASES[name].model_text(free, start))


def simulate(name: str, times: tuple[float, ...], **options: Any) -> Trajectory:
    atol = ATOL_OF.get(name, RTOL)
    return lagcli.simulate(model(name), times=times, rtol=RTOL, atol=atol, **options)


def along(name: str) -> list[float]:
    """Return the times at which a closed form is compared."""
    return list(np.linspace(0, CASES[name].t_end, 26))


@cache
def run(name: str, slow: float | None) -> Trajectory:
    """Simulate to all times that are not slow, or to one that is."""
    times = {r.time for r in CASES[name].references if (name, r.time) not in SLOW}
    if name in CLOSED:
        times.update(along(name))
    trajectory = simulate(
        name,
        tuple(sorted(times)) if slow is None else (0.0, slow),
        through_singular=CASES[name].singular,
    )
    assert trajectory.status == "completed", trajectory.message
    # the promise of every completed run
    position = np.abs(trajectory.residual_position / trajectory.scale_position)
    velocity = np.abs(trajectory.residual_velocity / trajectory.scale_velocity)
    assert np.nanmax(position, initial=0.0) <= 1e-12
    assert velocity.max(initial=0.0) <= 1e-12
    return trajectory


def sample(name: str, trajectory: Trajectory, time: float) -> dict[str, dict[str, float]]:
    """Return the quantities of a reference row from the sample at its time."""
    (i,) = np.flatnonzero(trajectory.time == time)

    def by_coordinate(values: np.ndarray) -> dict[str, float]:
        return dict(zip(trajectory.coordinates, values[i], strict=True))

    return {
        "q": by_coordinate(trajectory.q),
        "qd": by_coordinate(trajectory.v),
        "qdd": by_coordinate(trajectory.a),
        "lam": dict(zip(trajectory.constraints, trajectory.multipliers[i], strict=True)),
        "constraint_force": by_coordinate(trajectory.constraint_force),
        "observables": {key: values[i] for key, values in trajectory.outputs.items()},
        "energy": {"": trajectory.energy_total[i]},
    }


def digits_of_run(case: reader.Case, time: float, quantity: str) -> float:
    """Return the digits that the run has, of the largest component."""
    return min(case.double_digits(time, quantity) - MARGIN, DIGITS_OF_RUN)


def small(case: reader.Case, quantity: str) -> set[str]:
    """Return the components that are compared among themselves."""
    return SMALL.get(case.name, set()) if quantity in ("q", "qd") else set()


def scale(case: reader.Case, reference: reader.Reference, quantity: str, component: str) -> float:
    """Return the largest component at that time, among those of the same kind.

    Where all are zero then, their largest value at the other times; where they are zero always
    (except for rounding), 1.
    """
    apart = small(case, quantity)

    def largest(row: reader.Reference) -> float:
        values = row.values.get(quantity, {})
        alike = [abs(v) for c, v in values.items() if (c in apart) == (component in apart)]
        return max(alike, default=0.0)

    now, ever = largest(reference), max(map(largest, case.references))
    if ever < 1e-12:
        return 1.0
    return now if now > 1e-9 * ever else ever


@pytest.mark.parametrize(("name", "row"), published())
def test_reference_values(name: str, row: int) -> None:
    case = CASES[name]
    reference = case.references[row]
    slow = reference.time if (name, reference.time) in SLOW else None
    trajectory = run(name, slow)
    computed = sample(name, trajectory, reference.time)
    wrong = []
    for quantity, components in reference.values.items():
        if quantity == "lam" and case.redundant:
            continue  # only Bᵀλ is unique: constraint_force
        for component, value in components.items():
            digits = digits_of_run(case, reference.time, quantity)
            if component in small(case, quantity):
                digits = min(digits, DIGITS_OF_SMALL)
            # a published value is off by 10^-digits of itself, the run by 10^-digits of its scale
            size = scale(case, reference, quantity, component)
            if quantity == "energy":  # a sum whose terms may cancel
                size = max(size, trajectory.energy_kinetic.max())
            own = abs(value) if reference.kind == "published" else size
            # + 0.1: the stated digits are rounded to one decimal
            stated = 10 ** (0.1 - reference.digits[quantity][component]) * own
            error = abs(computed[quantity][component] - value)
            if not error <= stated + 10**-digits * size:
                wrong.append(
                    f"{quantity} {component}: {computed[quantity][component]!r} is not {value!r}"
                    f" (off by {error:.1e}, allowed {stated:.1e} + {10**-digits * size:.1e})"
                )
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("name", CLOSED)
def test_closed_forms_along_the_run(name: str) -> None:
    case, trajectory = CASES[name], run(name, None)
    rows = np.searchsorted(trajectory.time, along(name))
    exact = [case.closed_form(t) for t in along(name)]
    table = {
        "q": (trajectory.coordinates, trajectory.q),
        "qd": (trajectory.coordinates, trajectory.v),
        "lam": (trajectory.constraints, trajectory.multipliers),
    }
    for quantity, components in exact[0].items():
        names, values = table[quantity]
        digits = min(digits_of_run(case, r.time, quantity) for r in case.references)
        expected = np.array([[row[quantity][c] for c in components] for row in exact])
        found = values[np.ix_(rows, [names.index(c) for c in components])]
        assert np.abs(found - expected).max() <= 10**-digits * np.abs(expected).max(), quantity


@pytest.mark.parametrize("name", CLOSED)
def test_closed_forms_agree_with_the_reference_values(name: str) -> None:
    """The reader's evaluator, the closed forms and the reference values: none from lagcli."""
    case = CASES[name]
    for reference in case.references:
        for quantity, components in case.closed_form(reference.time).items():
            for component, value in components.items():
                size = scale(case, reference, quantity, component)
                digits = min(reference.digits[quantity][component], 13)  # rounding of cos(20)
                error = abs(value - reference.values[quantity][component])
                assert error <= 10**-digits * size, (reference.time, quantity, component)


def first_passage(name: str) -> float:
    """Return the time at which a case first passes a singular configuration."""
    if name == "parallelogram_collinear":
        return math.pi / 4  # th1 = π/2 + 2 t = π
    assert name == "four_bar_double_a02"
    # one coordinate, the angle of the uprights: 3/2 p'² + 35/10 g cos p = 3/2 + 35/10 g (see the
    # case's notes), singular at p = π/2
    g = CASES[name].parameters["g"]
    return quad(lambda p: 1 / math.sqrt(1 + 7 / 3 * g * (1 - math.cos(p))), 0, math.pi / 2)[0]


@pytest.mark.parametrize("name", SINGULAR)
def test_stops_before_a_singular_configuration(name: str) -> None:
    passage = first_passage(name)
    times = tuple(np.linspace(0, 2 * passage, 201))
    trajectory = simulate(name, times)
    assert trajectory.status == "failed"
    assert "singular" in trajectory.message
    assert any(constraint in trajectory.message for constraint in CASES[name].constraints)
    stated = [float(x) for x in re.findall(r"\bt = ([0-9.]+(?:e-?\d+)?)", trajectory.message)]
    # the message names the instant to the digits that a reader wants
    assert stated == [pytest.approx(passage, rel=1e-3)], trajectory.message
    # every sample before it is kept, none after it is made up
    kept = np.array([t for t in times if t < 0.98 * passage])
    assert len(trajectory.time) >= len(kept)
    assert trajectory.time[-1] <= passage * (1 + 1e-6)
    np.testing.assert_array_equal(trajectory.time[: len(kept)], kept)


def test_every_case_is_covered() -> None:
    covered = {p.values for p in published()}
    assert covered == {(name, row) for name in CASES for row in range(len(CASES[name].references))}
    assert len(CASES) >= 22  # a case that disappears from the folder is missed
    slow = {name for name, time in SLOW if any(r.time == time for r in CASES[name].references)}
    assert slow == {name for name, _ in SLOW}
    for name, case in CASES.items():
        assert case.data["name"] == name
        assert any(r.kind == "computed" and r.time > 0 for r in case.references), name
        for row in case.data["reference"]:
            stray = set(row) - {*reader.QUANTITIES, "kind", "t", "source", "which", "digits"}
            assert stray <= {"verified_digits"}, (name, stray)
        for reference in case.references:
            for quantity, components in reference.values.items():
                assert set(components) == set(reference.digits[quantity]), (name, quantity)


def test_evaluator_rejects_what_is_not_of_the_format() -> None:
    with pytest.raises((ValueError, KeyError)):
        reader.evaluate("__import__('os').getcwd()", {})
    assert reader.evaluate("-2**2 + sqrt(m)/4e-1", {"m": 4.0}) == pytest.approx(1.0)
