"""Model: the checked content of a model file."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import symengine as se
from symengine import Basic

from lagcli.errors import SourceLocation
from lagcli.model.expression.trees import Tree
from lagcli.model.expression.units import Factor
from lagcli.model.names.scoping import Value

if TYPE_CHECKING:
    from lagcli.model.symbols import Symbols

Kind = Literal["holonomic", "nonholonomic"]

TIME = se.Symbol("t")

METHODS = ("auto", "DOP853", "Taylor", "Rodas5P", "RK45", "RK23", "Radau", "BDF", "LSODA")
FORMULATIONS = ("projection", "baumgarte", "index1")
ENGINES = ("compiled", "scipy")
MAX_SAMPLES = 10**8
NO_INDICES: Mapping[str, int] = MappingProxyType({})

_POSITIVE = ("dt", "rtol", "max_step", "max_steps", "timeout")
_NUMBERS = ("t_start", "t_end", *_POSITIVE, "alpha", "beta", "samples")


def coordinate(name: str) -> Basic:
    """Return the symbol of a coordinate."""
    return se.Symbol(name)


def velocity(name: str) -> Basic:
    """Return the symbol of a coordinate's velocity."""
    return se.Symbol(f"{name}'")


def acceleration(name: str) -> Basic:
    """Return the symbol of a coordinate's acceleration."""
    return se.Symbol(f"{name}''")


def multiplier(constraint: str) -> Basic:
    """Return the symbol of a constraint's multiplier."""
    return se.Symbol(f"lambda.{constraint}")


def constraint_force(coordinate_name: str, constraint: str | None = None) -> Basic:
    """Return the symbol of the constraint force on a coordinate: total, or of one constraint."""
    middle = f"{constraint}." if constraint else ""
    return se.Symbol(f"Qc.{middle}{coordinate_name}")


class Coordinate(NamedTuple):
    """A generalized coordinate."""

    name: str
    unit: str | None = None
    description: str | None = None
    latex: str | None = None
    location: SourceLocation | None = None
    latex_location: SourceLocation | None = None


class Written(NamedTuple):
    """Source expression of a value, and its conversion factor to SI."""

    tree: Tree
    factor: Factor
    indices: Mapping[str, int]


class Parameter(NamedTuple):
    """A parameter with its value in SI.

    ``structural`` says whether coordinates, constraints or sums of the model depend on it: a new
    value then requires loading the model again. Any other parameter is an input of the equations.
    ``location`` is the location of the value.
    """

    name: str
    value: float
    unit: str | None = None
    description: str | None = None
    text: str = ""
    structural: bool = False
    written: Written | None = None
    location: SourceLocation | None = None


class Definition(NamedTuple):
    """A named expression; ``indices`` are the index values of a family member."""

    name: str
    value: Value
    tree: Tree
    description: str | None = None
    indices: Mapping[str, int] = NO_INDICES


class Constraint(NamedTuple):
    """A constraint, φ(q, t) = 0 or ψ(q, q', t) = 0 affine in q'.

    ``expression`` is lhs − rhs; ``indices`` are the index values of a family member.
    """

    name: str
    kind: Kind
    expression: Basic
    left: Tree
    right: Tree | None
    description: str | None = None
    location: SourceLocation | None = None
    indices: Mapping[str, int] = NO_INDICES


class InitialValue(NamedTuple):
    """An initial coordinate or velocity: fixed, or a guess that consistent initialization adjusts.

    ``unit`` is the unit in the file; ``value`` is in SI.
    """

    value: float
    fixed: bool
    location: SourceLocation | None = None
    written: Written | None = None
    unit: str | None = None


class Segment(NamedTuple):
    """A line between two points of a view: a rod, a spring or a guide."""

    kind: Literal["rod", "spring", "guide"]
    name: str
    start: str
    end: str


class Disc(NamedTuple):
    """A disc of a view; ``angle`` rotates its spoke, ``normal`` (in 3D) is its axis."""

    name: str
    center: str
    radius: Basic
    angle: Basic | None = None
    normal: tuple[Basic, ...] | None = None


class Arrow(NamedTuple):
    """An arrow of a view: a vector at a point, or the force of a constraint.

    A constraint force is drawn at each of its ``points``. Any other arrow has one point and
    ``components``, expressions in the names that outputs may use.
    """

    name: str
    quantity: Literal["velocity", "force", "vector"]
    points: tuple[str, ...]
    components: tuple[Basic, ...] = ()
    constraint: str | None = None
    unit: str | None = None


class View(NamedTuple):
    """The drawing of a model.

    Parameters
    ----------
    dimension : int
        2 or 3.
    points : mapping of str to expressions
        Positions in q, q', t and parameters; ``dimension`` components per point.
    segments, discs, vectors : tuples
    grounds, trails : tuples of str
        Points fixed to the ground, and points that leave a trail.
    labels : mapping of str to str or None
        Text at a point; None stands for the point's name.
    """

    dimension: int
    points: Mapping[str, tuple[Basic, ...]]
    segments: tuple[Segment, ...] = ()
    discs: tuple[Disc, ...] = ()
    grounds: tuple[str, ...] = ()
    trails: tuple[str, ...] = ()
    labels: Mapping[str, str | None] = MappingProxyType({})
    vectors: tuple[Arrow, ...] = ()


class SettingError(ValueError):
    """A setting out of its range; ``key`` says which."""

    def __init__(self, key: str, message: str, help_: str | None = None):
        super().__init__(message)
        self.key, self.help = key, help_


@dataclass(frozen=True, eq=False)
class Settings:
    """How to simulate. What is None is left to the next level: option, model file, default.

    Parameters
    ----------
    t_start, t_end : float
        s.
    samples : int
        Number of written samples, ends included.
    dt : float
        Spacing of the samples, s; in place of ``samples``.
    times : tuple of float
        The sample times, s; in place of both.
    rtol : float
        Relative tolerance of the error control on q and v.
    atol : float or mapping of str to float
        Absolute tolerance: one number for all, or by coordinate and velocity (``phi'``). What it
        does not name, and everything without it, follows the size that the motion reaches.
    method, formulation, engine : str
    alpha, beta : float
        Baumgarte's coefficients, 1/s: φ̈ + 2α φ̇ + β² φ = 0.
    max_step : float
        Largest step, s.
    max_steps : int
        Steps after which the run is given up.
    timeout : float
        Seconds of wall time after which the run is given up.
    through_singular : bool
        Whether to pass a singular configuration instead of stopping there.
    """

    t_start: float | None = None
    t_end: float | None = None
    samples: int | None = None
    dt: float | None = None
    times: tuple[float, ...] | None = None
    rtol: float | None = None
    atol: float | Mapping[str, float] | None = None
    method: str | None = None
    formulation: str | None = None
    engine: str | None = None
    alpha: float | None = None
    beta: float | None = None
    max_step: float | None = None
    max_steps: int | None = None
    timeout: float | None = None
    through_singular: bool | None = None

    def over(self, lower: Settings) -> Settings:
        """Return these settings with the gaps filled from a lower level."""
        values = {
            f.name: getattr(self if getattr(self, f.name) is not None else lower, f.name)
            for f in dataclasses.fields(self)
        }
        grid = ("samples", "dt", "times")
        if any(getattr(self, key) is not None for key in grid):
            # the three describe one thing: the higher level's choice replaces the lower's
            values.update({key: getattr(self, key) for key in grid})
        if self.times is not None:
            values["t_end"] = self.t_end  # the last time is the end
        return Settings(**values)

    def check(self) -> None:
        """Raise SettingError for the first value that is out of its range."""
        for problem in self.problems():
            raise problem

    def problems(self) -> Iterator[SettingError]:
        """Yield what is out of its range, or contradicts another setting."""
        yield from self._value_problems()
        yield from self._time_problems()

    def _value_problems(self) -> Iterator[SettingError]:
        for key in _NUMBERS:
            value = getattr(self, key)
            if value is None:
                continue
            if not math.isfinite(value):
                yield SettingError(key, f"{key} must be a finite number, not {value}")
            elif key in _POSITIVE and value <= 0:
                yield SettingError(key, f"{key} must be greater than 0, not {value:g}")
            elif key in ("alpha", "beta") and value < 0:
                yield SettingError(key, f"{key} must not be negative, not {value:g}")
            elif key == "rtol" and not 1e-13 <= value <= 0.1:
                yield SettingError(
                    key,
                    f"rtol must lie between 1e-13 and 0.1, not {value:g}",
                    "doubles hold no more than 1e-13" if value < 1e-13 else "1e-9 is usual",
                )
            elif key == "samples" and not 1 <= value <= MAX_SAMPLES:
                yield SettingError(key, f"samples must lie between 1 and 10^8, not {value}")
        yield from self._tolerance_problems()
        for key, known in (("method", METHODS), ("formulation", FORMULATIONS), ("engine", ENGINES)):
            value = getattr(self, key)
            if value is not None and value not in known:
                same = [k for k in known if k.lower() == value.lower()]
                help_ = f"did you mean `{same[0]}`?" if same else "known are " + ", ".join(known)
                yield SettingError(key, f"there is no {key} `{value}`", help_)

    def _tolerance_problems(self) -> Iterator[SettingError]:
        if self.atol is None:
            return
        given = self.atol if isinstance(self.atol, Mapping) else {"": self.atol}
        for name, value in given.items():
            what = f"atol of `{name}`" if name else "atol"
            if not math.isfinite(value):
                yield SettingError("atol", f"{what} must be a finite number, not {value}")
            elif value <= 0:
                yield SettingError("atol", f"{what} must be greater than 0, not {value:g}")

    def _time_problems(self) -> Iterator[SettingError]:
        start = self.t_start or 0.0
        if self.t_end is not None and self.t_end <= start:
            yield SettingError("t_end", f"t_end {self.t_end:g} must lie after t_start {start:g}")
        given = [k for k in ("samples", "dt", "times") if getattr(self, k) is not None]
        if len(given) > 1:
            yield SettingError(
                given[1], f"{' and '.join(given)} contradict each other", "give one of them"
            )
        if self.times is not None:
            yield from self._sample_time_problems(self.times, start)
        if (
            self.dt is not None
            and self.dt > 0
            and self.t_end is not None
            and (self.t_end - start) / self.dt > MAX_SAMPLES
        ):
            yield SettingError("dt", "dt asks for more than 10^8 samples", "take a larger dt")

    def _sample_time_problems(
        self, times: tuple[float, ...], start: float
    ) -> Iterator[SettingError]:
        if not times:
            yield SettingError("times", "times must hold at least one time")
        elif not all(math.isfinite(x) for x in times):
            yield SettingError("times", "times must be finite numbers")
        elif any(b <= a for a, b in pairwise(times)):
            yield SettingError("times", "times must increase")
        elif times[0] < start:
            yield SettingError("times", f"times begin before t_start {start:g}")
        elif self.t_end is not None and times[-1] > self.t_end:
            yield SettingError("times", f"times go beyond t_end {self.t_end:g}")


DEFAULTS = Settings(
    t_start=0.0,
    t_end=10.0,
    rtol=1e-9,
    method="auto",
    formulation="projection",
    max_steps=10_000_000,
    through_singular=False,
)


@dataclass(frozen=True, eq=False)
class Model:
    """A checked model.

    ``kinetic`` and ``potential`` are T and V; a model written with L has ``kinetic`` None and
    ``potential`` −L. Expressions are in the symbols of this module's functions and the
    parameters' names. ``set`` and ``set_initial`` are the values that replaced the file's;
    ``settings_need`` are the parameters that the settings depend on.
    """

    name: str
    description: str | None
    path: str
    text: str
    sha256: str
    coordinates: tuple[Coordinate, ...]
    parameters: Mapping[str, Parameter]
    definitions: Mapping[str, Definition]
    kinetic: Basic | None
    potential: Basic
    applied_forces: Mapping[str, Basic]
    dissipation: Basic | None
    constraints: tuple[Constraint, ...]
    initial_positions: Mapping[str, InitialValue]
    initial_velocities: Mapping[str, InitialValue]
    outputs: Mapping[str, Basic]
    output_units: Mapping[str, str]
    settings: Settings
    settings_need: frozenset[str]
    trees: Mapping[str, Tree]
    names: Symbols
    set: Mapping[str, object]
    set_initial: Mapping[str, object]
    view: View | None = None

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        """Names of the coordinates, in the model's order."""
        return tuple(c.name for c in self.coordinates)

    @property
    def constraint_names(self) -> tuple[str, ...]:
        """Names of the constraints, in the model's order."""
        return tuple(c.name for c in self.constraints)

    @property
    def initial(self) -> dict[str, InitialValue]:
        """The initial values by the names of coordinates and velocities (``q'``)."""
        velocities = {f"{name}'": value for name, value in self.initial_velocities.items()}
        return {**self.initial_positions, **velocities}

    @property
    def structural_parameters(self) -> tuple[str, ...]:
        """Names of the parameters whose change requires a new derivation."""
        return tuple(name for name, p in self.parameters.items() if p.structural)

    @property
    def parameter_values(self) -> dict[str, float]:
        """Parameter values in SI, by name."""
        return {name: p.value for name, p in self.parameters.items()}

    def as_dict(self) -> dict[str, Any]:
        """Return names and values for machine-readable summaries."""
        return {
            "name": self.name,
            "coordinates": list(self.coordinate_names),
            "constraints": {c.name: c.kind for c in self.constraints},
            "parameters": self.parameter_values,
        }
