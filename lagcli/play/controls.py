"""Controls of the page: parameters and initial values with unit and range."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal

from lagcli.columns import unit_quotient
from lagcli.equations.typesetting.notation import Notation
from lagcli.model.expression.dimension import same
from lagcli.model.expression.units import read_unit, to_si
from lagcli.model.model import Coordinate, InitialValue, Model, Parameter, Written
from lagcli.model.names.members import family_of
from lagcli.model.sections.parameters import names_used
from lagcli.pictures.page import unit as printed
from lagcli.pictures.scene.timing import round_number
from lagcli.settings.settings import Settings

#: Number of steps of a slider, about the number of its pixels.
_PLACES = 400
#: Range of a value that is 0, if the model does not suggest another one.
_USUAL = {"rad/s": 10.0}
#: Half a turn, and a step, by unit.
_TURNS = {"rad": (3.15, 0.01), "deg": (180.0, 1.0), "°": (180.0, 1.0)}


@dataclass(frozen=True)
class Control:
    """A value with a slider.

    Parameters
    ----------
    name : str
        Name in ``--set`` and ``--set-initial``; ``t_end``.
    kind : str
    label : str
        Name in formulas.
    value : float
        Value in ``unit``.
    unit : str
        Unit in the file; may be empty.
    suffix : str
        Suffix of a number on the command line that gives it this unit.
    low, high, step : float
        Range and step of the slider.
    family : str
        Heading for the members of a family; otherwise empty.
    description : str
    text : str
        Expression of other parameters that determines the value; otherwise empty.
    free : bool
        Whether it is a guess.
    whole : bool
        Whether it must be an integer.
    """

    name: str
    kind: Literal["parameter", "position", "velocity", "end"]
    label: str
    value: float
    unit: str
    suffix: str
    low: float
    high: float
    step: float
    family: str = ""
    description: str = ""
    text: str = ""
    free: bool = False
    whole: bool = False

    def shown(self, value: float) -> float:
        """Return a value in SI in the control's unit."""
        return _in_unit(value, self.unit)

    def to_json(self) -> dict[str, Any]:
        """Return the control as JSON values, with a formatted unit."""
        return {**asdict(self), "unit": printed(self.unit)}


def controls(model: Model, settings: Settings) -> dict[str, Control]:
    """Return the controls of a model, by kind and name.

    Parameters
    ----------
    model : Model
    settings : Settings
        Complete settings.

    Returns
    -------
    dict of str to Control
        By name: parameters, then positions and velocities, then the end time. A velocity is
        ``phi'``, which no parameter can be named.
    """
    maker = _Maker(model)
    made = {name: maker.parameter(p) for name, p in model.parameters.items()}
    initial = model.initial
    for coordinate in model.coordinates:
        for name in (coordinate.name, f"{coordinate.name}'"):
            made[name] = maker.initial(coordinate, name, initial[name])
    end = _end(settings)
    return made | ({end.name: end} if end is not None else {})


class _Maker:
    """Creates the controls of one model."""

    def __init__(self, model: Model):
        self.given, self.names, self.sizes = model.set, Notation(model), _sizes(model)
        self.positive = _without_sign(model)
        self.known = {*model.parameters, *map(family_of, model.parameters)}

    def follows(self, written: Written | None) -> bool:
        """Return whether an expression depends on parameters."""
        used = names_used(written.tree) if written is not None else []
        return any(n in self.known or f"{n}[]" in self.known for n in used)

    def size(self, unit: str) -> float:
        """Return the range of a slider with value 0, by unit."""
        return self.sizes.get(unit) or _USUAL.get(unit, 1.0)

    def parameter(self, parameter: Parameter) -> Control:
        """Return the control of a parameter."""
        name, unit = parameter.name, parameter.unit or ""
        value = _in_unit(parameter.value, unit)
        one_sign = name in self.positive or _damps(parameter.unit)
        low, high, step = _span(value, self.size(unit), parameter.structural, one_sign)
        low, high, step = _bounded(parameter, (low, high, step))
        return Control(
            name,
            "parameter",
            self.names.text(name),
            value,
            unit,
            # a number without a unit has the file's unit if that is SI; not that of an option
            f" {unit}" if unit and (to_si(unit) != 1 or name in self.given) else "",
            low,
            high,
            step,
            family_label(name),
            parameter.description or "",
            " ".join(parameter.text.split()) if self.follows(parameter.written) else "",
            whole=parameter.structural,
        )

    def initial(self, coordinate: Coordinate, name: str, initial: InitialValue) -> Control:
        """Return the control of an initial coordinate or velocity."""
        base, moving = coordinate.name, name != coordinate.name
        described = coordinate.description or ""
        unit = initial.unit or _coherent(coordinate.unit, moving)
        value = _in_unit(initial.value, unit)
        if not moving and unit in _TURNS and abs(value) <= _TURNS[unit][0]:
            half, step = _TURNS[unit]
            low, high = -half, half
        else:
            size = 2 * abs(value) or self.size(unit)
            low, high, step = _grid(-size, size)
        return Control(
            name,
            "velocity" if moving else "position",
            self.names.text(base, int(moving)),
            value,
            unit,
            f" {unit}" if unit and to_si(unit) != 1 else "",
            low,
            high,
            step,
            family_label(base) + "'" * (moving and "[" in base),
            f"velocity: {described}" if moving and described else described,
            _written(initial) if self.follows(initial.written) else "",
            free=not initial.fixed,
        )


def _end(settings: Settings) -> Control | None:
    """Return the control of the end time; none if sample times are given."""
    if settings.times is not None:
        return None
    start, end = settings.t_start, settings.t_end
    low, high, step = _grid(start, start + 2 * (end - start))
    unit, description = Settings.t_end.unit, "end of the simulation"
    return Control("t_end", "end", "t_end", end, unit, "", low + step, high, step, "", description)


def family_label(name: str) -> str:
    """Return the family of a name without brackets: ``r.x`` for ``r[1].x``; otherwise empty."""
    family = family_of(name)
    return family.replace("[]", "").replace("[,]", "") if family != name else ""


def _written(initial: InitialValue) -> str:
    """Return the text of an initial value, without the braces of a guess."""
    place = initial.location
    if place is None:
        return ""
    text = place.text[place.column - 1 : place.column - 1 + place.length].strip()
    return text.removeprefix("{").removesuffix("}").strip().removeprefix("guess:").strip()


def _coherent(unit: str | None, moving: bool) -> str:
    """Return the SI unit of a coordinate, or of its velocity."""
    if not unit:
        return ""
    return unit_quotient(unit, "s") if moving else unit


def _in_unit(value: float, unit: str) -> float:
    """Return an SI value in a unit, with its original digits."""
    factor = to_si(unit) if unit else 1
    return value if factor == 1 else float(f"{value / float(factor):.15g}")


def _sizes(model: Model) -> dict[str, float]:
    """Return the largest value of each unit in the model: the range of values that are 0."""
    sizes: dict[str, float] = {}
    units = {c.name: c.unit for c in model.coordinates}
    values = [(p.unit, p.value) for p in model.parameters.values()]
    for name, x in model.initial.items():
        base = name.rstrip("'")
        values.append((x.unit or _coherent(units[base], name != base), x.value))
    for unit, value in values:
        if unit:
            sizes[unit] = max(sizes.get(unit, 0.0), abs(_in_unit(value, unit)))
    return sizes


def _without_sign(model: Model) -> set[str]:
    """Return the names of parameters that are coefficients of friction or restitution."""
    coefficients = []
    for constraint in model.constraints:
        limit = constraint.limit
        coefficients += [constraint.restitution]
        coefficients += [limit.static, limit.kinetic] if limit is not None else []
    return {s.name for x in coefficients if x is not None for s in x.free_symbols}


def _damps(unit: str | None) -> bool:
    """Return whether a unit is one of viscous friction, along a line or of a rotation."""
    if not unit:
        return False
    dimension = read_unit(unit).dimension
    return any(same(dimension, read_unit(x).dimension) for x in ("N*s/m", "N*m*s/rad"))


def _bounded(parameter: Parameter, span: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the ends and the step of a slider with the ends that the model file has."""
    unit = parameter.unit or ""
    low, high = (
        end if given is None else _in_unit(given, unit)
        for end, given in zip(span, (parameter.low, parameter.high), strict=False)
    )
    if (low, high) == span[:2]:
        return span
    if parameter.structural:
        return math.ceil(low), math.floor(high), 1.0
    if low >= high:  # one end alone, beyond the other
        low, high = (low, low + abs(low)) if parameter.high is None else (high - abs(high), high)
    return low, high, _grid(low, high)[2]


def _span(value: float, size: float, whole: bool, one_sign: bool) -> tuple[float, float, float]:
    """Return the ends and the step of a parameter's slider: from 0 to twice the value."""
    if whole:
        return 1.0, max(2 * value, 10.0), 1.0
    if not value:
        return _grid(0.0 if one_sign else -size, size)
    return _grid(min(0.0, 2 * value), max(0.0, 2 * value))


def _grid(low: float, high: float) -> tuple[float, float, float]:
    """Return ends that are multiples of a round step, and the step."""
    rough = (high - low) / _PLACES
    if not (math.isfinite(rough) and rough > 0):
        return low, high, 0.0
    step = round_number(rough * 1.000001)
    first, last = math.floor(low / step + 1e-6), math.ceil(high / step - 1e-6)
    return float(f"{first * step:.12g}"), float(f"{last * step:.12g}"), step
