"""The motion of a mode as a trajectory, to be animated or plotted."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lagcli.analysis.linear.modes import Mode, modes_about
from lagcli.analysis.linear.operating_points import equations_of, find_operating_point
from lagcli.analysis.local.gradients import Point
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.steady_terms import Given
from lagcli.analysis.output.files import stored_model
from lagcli.arrays import Array, rank_of
from lagcli.engine.constraints.initial import NoStart, consistent_state
from lagcli.engine.contract import Block
from lagcli.engine.system import State
from lagcli.errors import NumericalError, UsageError
from lagcli.model.model import Model
from lagcli.model.result_units import result_display
from lagcli.results.hdf5.analysis_file import read_analysis
from lagcli.results.hdf5.opening import damage
from lagcli.simulations.derived import DerivedColumns
from lagcli.simulations.inputs import input_tables
from lagcli.trajectory.samples import Record
from lagcli.trajectory.trajectory import Trajectory, complete
from lagcli.version import __version__

ComplexArray = NDArray[np.complex128]

_PERIODS, _CONSTANTS = 3, 3  # periods of oscillations, time constants of other modes
_SAMPLES = 181
_DRIFT = 2.0  # duration of neutral motions, s
_CHOICES = 20  # largest number of modes in a message
_APART = 1e-9  # between samples of one instant, which a trajectory has in order; s
_LARGE = 0.25  # largest deviation, relative to the coordinates' lengths


def mode_motion(
    model: Model,
    number: int,
    *,
    amplitude: float | None = None,
    at: float | None = None,
    equilibrium: bool = False,
    steady: Given | None = None,
) -> Trajectory:
    """Return the motion q₀ + ε Re(δq e^(st)) of a mode, with λ₀ + ε Re(δλ e^(st)).

    Positions are projected onto the constraints, so that rods keep their lengths. Oscillations have
    a constant amplitude, regardless of their damping. In a steady motion, coordinates on which the
    equations do not depend are constant: the observer moves along.

    Parameters
    ----------
    model : Model
    number : int
        Number of the mode, from 1.
    amplitude : float, optional
        ε, in the unit of the coordinate whose shape is 1; by default large enough for the motion to
        be visible.
    at, equilibrium, steady
        As for `lagcli.modes`.

    Returns
    -------
    Trajectory
        Three periods, or three time constants.

    Raises
    ------
    UsageError
        There is no mode of this number, or the amplitude is not positive.
    ModelError, NumericalError
        As `lagcli.modes`.
    """
    local, operating_point = find_operating_point(
        model, at=at, equilibrium=equilibrium, steady=steady
    )
    modes = modes_about(model, local, operating_point).modes
    _check_number(number, [(mode.eigenvalue, mode.kind) for mode in modes], model.name)
    mode, name = modes[number - 1], operating_point.name
    wave = _wave(mode.eigenvalue)
    return _motion(local, operating_point.point, mode, number, name, amplitude, wave)


def stored_mode_motion(
    path: str | os.PathLike[str], number: int, *, amplitude: float | None = None
) -> Trajectory:
    """Return the motion of a mode of a file that ``lagcli modes -o`` wrote.

    Parameters
    ----------
    path : path
        HDF5.
    number, amplitude
        As for `mode_motion`.

    Raises
    ------
    FileError
        It cannot be read, or is no file of modes.
    UsageError, ModelError, NumericalError
        As `mode_motion`.
    """
    content = read_analysis(path, "modes")
    model = stored_model(path)
    _check_number(number, _stored(content), model.name)
    stored = StoredModes(content, model, os.fspath(path))
    return stored.motion(number, amplitude)


class StoredModes:
    """The modes of a file, with their operating point.

    Parameters
    ----------
    content : mapping
        Content of ``lagcli modes``.
    model : Model
    path : str
        The file, for messages.

    Raises
    ------
    FileError
        The content is not that of the model.
    ModelError, NumericalError
        As `mode_motion`.
    """

    def __init__(self, content: Mapping[str, Any], model: Model, path: str):
        self._stored = content["modes"]
        held = content["operating_point"]
        _check_names(path, "q", held["q"], model.coordinate_names)
        q, v = (np.array([held[part][name] for name in model.coordinate_names]) for part in "qv")
        p = tuple(model.parameter_values.values())
        local = equations_of(model, State(held["time"], q, v, p), held.get("contacts", ()))
        constraints = local.system.constraints
        _check_names(path, "multipliers", held["multipliers"], constraints)
        rows = local.evaluator(local.p).constraints(held["time"], q, v).jacobian
        point = local.moving(State(held["time"], q, v, local.p), rank_of(rows))
        multipliers = np.array([held["multipliers"][name] for name in constraints])
        self._local, self._point = local, point._replace(multipliers=multipliers)
        self._name = held["name"]

    def _mode(self, number: int) -> Mode:
        stored = self._stored[number - 1]

        def shape(part: str, names: Sequence[str]) -> ComplexArray:
            return np.array([complex(*stored[part][name]) for name in names], dtype=complex)

        coordinates = self._local.model.coordinate_names
        return Mode(
            stored["kind"],
            complex(*stored["eigenvalue"]),
            shape("position", coordinates),
            shape("velocity", coordinates),
            shape("multipliers", self._local.system.constraints),
        )

    def motion(self, number: int, amplitude: float | None = None) -> Trajectory:
        """Return the motion of a mode; see `mode_motion`."""
        mode = self._mode(number)
        wave = _wave(mode.eigenvalue)
        return _motion(self._local, self._point, mode, number, self._name, amplitude, wave)

    def extremes(self, number: int) -> Trajectory:
        """Return three samples: the operating point, and the ends of a mode's motion."""
        mode, apart = self._mode(number), _APART * max(1.0, abs(self._point.t))
        wave = apart * np.arange(3.0), np.array([0, 1, -1], dtype=complex)
        return _motion(self._local, self._point, mode, number, self._name, None, wave)


def _check_names(path: str, part: str, stored: Iterable[str], names: Sequence[str]) -> None:
    """Raise FileError unless a part of the operating point has the names of the model."""
    if set(stored) != set(names):
        what = f"content.operating_point.{part} has {', '.join(stored) or 'no names'}"
        raise damage(path, ValueError(f"{what}, and the model {', '.join(names) or 'none'}"))


def no_mode_chosen(path: str | os.PathLike[str]) -> UsageError:
    """Return the error for a file of modes of which none is chosen.

    Raises
    ------
    FileError
        The file cannot be read, or does not contain modes.
    """
    content = read_analysis(path, "modes")
    modes = _stored(content)
    return UsageError(
        f"{os.fspath(path)} has the {_counted(modes)} of {content['model']}, and no run; choose"
        f" a mode with --mode N{_listed(modes)}"
    )


def _stored(content: Mapping[str, Any]) -> list[tuple[complex, str]]:
    """Return eigenvalues and kinds of the modes of a file."""
    return [(complex(*mode["eigenvalue"]), mode["kind"]) for mode in content["modes"]]


def _check_number(number: int, modes: Sequence[tuple[complex, str]], name: str) -> None:
    if not 1 <= number <= len(modes):
        raise UsageError(f"--mode {number}: {name} has {_counted(modes)}{_listed(modes)}")


def _counted(modes: Sequence[object]) -> str:
    return f"{len(modes) or 'no'} mode{'s' * (len(modes) != 1)}"


def _listed(modes: Sequence[tuple[complex, str]]) -> str:
    """Return a line for each mode, up to a maximum."""
    lines = [
        f"\n{'   help: ' if number == 1 else '':<9}--mode {number:<3}"
        f"{f'{s.imag / (2 * np.pi):.6g} Hz' if s.imag else f's = {s.real:.6g} 1/s':<20}{kind}"
        for number, (s, kind) in enumerate(modes[:_CHOICES], 1)
    ]
    if len(modes) > _CHOICES:
        lines.append(f"\n{'':<9}and {len(modes) - _CHOICES} more, which lagcli modes lists")
    return "".join(lines)


def _motion(
    local: LocalEquations,
    point: Point,
    mode: Mode,
    number: int,
    place: str,
    amplitude: float | None,
    wave: tuple[Array, ComplexArray],
) -> Trajectory:
    """Return the motion of a mode about a point; ``wave`` are times and factors of its shape."""
    model = local.model
    if amplitude is not None and not (np.isfinite(amplitude) and amplitude > 0):
        raise UsageError(f"--amplitude {amplitude:g}: give a positive number")
    with np.errstate(all="ignore"):
        if amplitude is None:
            amplitude = _LARGE / np.abs(mode.position / local.lengths).max()
        block = _block(local, point, mode, float(amplitude), *wave)
        columns = DerivedColumns(local.whole_system, point.p)
        samples = columns(block)
    record = Record(
        scale_position=columns.scale_position,
        scale_velocity=columns.scale_velocity,
        units={c.name: c.unit for c in model.coordinates if c.unit},
        message=f"mode {number} ({mode.kind}) about {place}, amplitude {amplitude:.6g}",
        model=model.text,
        parameters=model.declared_values,
        options={"mode": number, "amplitude": float(amplitude)},
        lagcli_version=__version__,
        display=result_display(model),
        inputs=input_tables(model),
    )
    return complete(samples, record)


def _block(
    local: LocalEquations,
    point: Point,
    mode: Mode,
    amplitude: float,
    time: Array,
    wave: ComplexArray,
) -> Block:
    """Return the samples of the motion."""
    s = mode.eigenvalue
    scaled = amplitude * wave

    def deviation(shape: ComplexArray) -> Array:
        return np.real(np.outer(scaled, shape))

    moving = np.zeros(len(point.q))
    moving[list(local.entering)] = point.v[list(local.entering)]
    guesses = point.q + np.outer(time, moving) + deviation(mode.position)
    v, a = point.v + deviation(mode.velocity), point.a + deviation(s * mode.velocity)
    multipliers = point.multipliers + deviation(mode.multipliers)
    if not all(np.isfinite(x).all() for x in (guesses, v, a, multipliers)):
        raise NumericalError(
            f"the motion of a mode of {local.model.name} has no finite values: its eigenvalue"
            f" {s:.3g} 1/s or its shape is too large, or no coordinate moves"
        )
    q = np.array([_placed(local, point.t + t, q) for t, q in zip(time, guesses, strict=True)])
    points = (
        Point(point.t + float(t), q[i], v[i], a[i], multipliers[i], point.p)
        for i, t in enumerate(time)
    )
    return Block(
        time=point.t + time,
        q=q,
        v=v,
        a=a,
        multipliers=np.array([local.all_multipliers(x) for x in points]),
        work=np.zeros(len(time)),
    )


def _wave(s: complex) -> tuple[Array, ComplexArray]:
    """Return times from 0, and e^(st) scaled to a largest magnitude of 1."""
    if s.imag:
        time = np.linspace(0.0, _PERIODS * 2 * np.pi / s.imag, _SAMPLES)
        return time, np.exp(1j * s.imag * time)
    if s:
        time = np.linspace(0.0, _CONSTANTS / abs(s.real), _SAMPLES)
        return time, np.exp(s.real * time - max(0.0, s.real * time[-1])).astype(complex)
    time = np.linspace(0.0, _DRIFT, _SAMPLES)
    return time, (time / _DRIFT).astype(complex)


def _placed(local: LocalEquations, t: float, q: Array) -> Array:
    """Return the point on the constraints nearest to a guess; the guess itself if there is none."""
    free = np.zeros(len(q), bool)
    given = local.evaluator(local.p).state(t, q, np.zeros(len(q)))
    try:
        return consistent_state(local.system, given, free, free).state.q
    except NoStart:
        return q
