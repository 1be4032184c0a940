"""The columns of results, each declared once.

Result files, the signals of sweeps, and the curves of plots, reports and the live page are derived
from these declarations. Inside the program a column is a `ColumnName`; its text, such as
``phi_dot``, ``lambda.guide`` or ``Qc.guide.phi``, is formatted and parsed only here.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

if TYPE_CHECKING:
    from lagcli.arrays import Array

#: Suffix of the name of a constraint: its friction.
SLIP = ".slip"

_PER_JOULE = {"m": "N", "rad": "N*m", "1": "J", "": "J", "C": "V"}


class ResultQuantity(NamedTuple):
    """One array of a result: a column, or several along an axis.

    Parameters
    ----------
    name : str
        Name of its field of `Columns` and of its dataset in HDF5 files.
    axes : tuple of str
        Any of ``time``, ``coordinate``, ``constraint``, ``term``, ``conserved_quantity``.
    description : str
        The ``long_name`` in HDF5 files.
    unit : str
        ``{u}`` stands for the unit of the coordinate, ``{c}`` for that of the constraint,
        ``{k}`` for that of the conserved quantity.
    panel : str
        Title of plots of the quantity, in lower case; none without a time axis.
    label : str
        Label in legends; a single letter is a symbol. Columns along an axis are labelled by their
        names.
    text : str
        Pattern of the names of its columns: by default ``name``, or ``name.{constraint}``.
    role : str
        ``error`` if it is zero for an exact run; ``residual`` if it is also drawn as a magnitude on
        a logarithmic axis.
    kept : bool
        Whether sweeps store it with the trajectories.
    """

    name: str
    axes: tuple[str, ...]
    description: str
    unit: str
    panel: str = ""
    label: str = ""
    text: str = ""
    role: Literal["", "error", "residual"] = ""
    kept: bool = False

    @property
    def along(self) -> str:
        """The axis besides the time, or nothing."""
        return "".join(axis for axis in self.axes if axis != "time")

    @property
    def pattern(self) -> str:
        """Pattern of the names of its columns, with ``{coordinate}`` and ``{constraint}``."""
        return self.text or self.name + (".{constraint}" if self.along == "constraint" else "")

    @property
    def scale(self) -> str:
        """Field of `Record` that contains the scale of a residual."""
        return self.name.replace("residual", "scale")

    def unit_at(self, coordinate_unit: str | None) -> str | None:
        """Return the unit of a column, given that of its coordinate; None if unknown.

        For columns of a constraint, use `unit_of_column`.
        """
        if "{" not in self.unit:
            return self.unit
        if coordinate_unit is None or self.unit == "{u}":
            return coordinate_unit
        if self.unit == "J/{u}":
            return _PER_JOULE.get(coordinate_unit) or unit_quotient("J", coordinate_unit)
        return unit_quotient(coordinate_unit, self.unit.removeprefix("{u}/"))


def _column(
    description: str, unit: str, panel: str, label: str = "", along: str = "", **more: Any
) -> Any:
    """Return a field of `Columns`, declared as a `ResultQuantity`."""
    declared = {"description": description, "unit": unit, "panel": panel, "label": label, **more}
    return field(metadata={"axes": ("time", along) if along else ("time",), **declared})


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Columns:
    """The numbers of consecutive samples, in SI units.

    nt samples, nq coordinates, nc constraints (in the model's order), n terms of constraint force,
    ni conserved quantities.

    Parameters
    ----------
    time : (nt,) array
        s.
    q, v, a : (nt, nq) arrays
        Coordinates, velocities, accelerations.
    multipliers : (nt, nc) array
        λ.
    constraint_force_by : (nt, n) array
        λ_β b_βi, the generalized force of each constraint on each coordinate that it acts on, in
        the order of the terms.
    energy_kinetic, energy_potential : (nt,) arrays
        T and V as given by the model, J.
    energy_total : (nt,) array
        v·∂L/∂v − L; equals T + V when T is a quadratic form in the velocities.
    power_applied : (nt,) array
        Power of Q and D, W.
    power_constraint : (nt,) array
        Σ λ_β b_β·v without power_friction, W: the power of rheonomic constraints.
    power_time : (nt,) array
        −∂L/∂t, W: the power due to explicit time in T or V.
    power_friction : (nt,) array
        Σ λ_β ψ_β of limited rows, including friction, W: the power dissipated by slip.
    energy_balance : (nt,) array
        energy_total minus its first value, minus the integral of the powers and the changes by
        impacts and events; zero for an exact run.
    residual_position, residual_velocity : (nt, nc) arrays
        φ and ψ at the stored state; NaN for inactive constraints, such as open contacts and
        slipping rows, and for φ of a nonholonomic constraint.
    residual_equation : (nt,) array
        max norm of M a − f − Bᵀλ, evaluated from the stored numbers.
    conserved : (nt, ni) array
        The conserved quantities of the model other than its energy; constant for an exact run.
    """

    time: Array = _column("time", "s", "time", "t", text="t")
    q: Array = _column(
        "generalized coordinates",
        "{u}",
        "coordinates",
        along="coordinate",
        text="{coordinate}",
        kept=True,
    )
    v: Array = _column(
        "generalized velocities",
        "{u}/s",
        "velocities",
        along="coordinate",
        text="{coordinate}_dot",
        kept=True,
    )
    a: Array = _column(
        "generalized accelerations",
        "{u}/s^2",
        "accelerations",
        along="coordinate",
        text="{coordinate}_ddot",
        kept=True,
    )
    multipliers: Array = _column(
        "Lagrange multipliers",
        "J/{c}",
        "multipliers",
        along="constraint",
        text="lambda.{constraint}",
        kept=True,
    )
    constraint_force_by: Array = _column(
        "generalized constraint force lambda_beta b_beta of each constraint",
        "J/{u}",
        "constraint forces",
        along="term",
        text="Qc.{constraint}.{coordinate}",
    )
    energy_kinetic: Array = _column("kinetic energy", "J", "energies", "T", kept=True)
    energy_potential: Array = _column("potential energy", "J", "energies", "V", kept=True)
    energy_total: Array = _column("total energy", "J", "energies", "E", kept=True)
    power_applied: Array = _column("power of the applied forces", "W", "powers", "applied forces")
    power_constraint: Array = _column(
        "power of the constraint forces", "W", "powers", "constraints"
    )
    power_time: Array = _column("power by explicit time in T or V", "W", "powers", "explicit time")
    power_friction: Array = _column("power of friction and other limits", "W", "powers", "friction")
    energy_balance: Array = _column(
        "total energy minus its first value minus the integral of the powers",
        "J",
        "energy balance",
        "energy balance",
        role="error",
        kept=True,
    )
    residual_position: Array = _column(
        "residual of each position constraint",
        "{c}",
        "position residuals",
        "position",
        along="constraint",
        role="residual",
    )
    residual_velocity: Array = _column(
        "residual of each velocity constraint",
        "{c}/s",
        "velocity residuals",
        "velocity",
        along="constraint",
        role="residual",
    )
    residual_equation: Array = _column(
        "max norm of the residual of the equations",
        "J/{u}",
        "equation residual",
        "equations",
        role="residual",
    )
    conserved: Array = _column(
        "conserved quantities besides the energy",
        "{k}",
        "conserved quantities",
        along="conserved_quantity",
        text="conserved.{conserved}",
    )


#: Derived from a stored column: the sum of ``constraint_force_by`` over the constraints.
_CONSTRAINT_FORCE = ResultQuantity(
    "constraint_force",
    ("time", "coordinate"),
    "generalized constraint force, the sum of lambda_beta b_beta over beta",
    "J/{u}",
    "constraint forces",
    text="Qc.{coordinate}",
    kept=True,
)


def _quantities() -> Iterator[ResultQuantity]:
    for declared in fields(Columns):
        if declared.name == "constraint_force_by":
            yield _CONSTRAINT_FORCE
        yield ResultQuantity(declared.name, **declared.metadata)
    for what in ("position", "velocity"):
        said = f"scale by which the {what} residual is judged"
        unit = "{c}" if what == "position" else "{c}/s"
        yield ResultQuantity(f"scale_{what}", ("constraint",), said, unit)


#: All arrays of a result except the model's outputs, in the order of files.
QUANTITIES = tuple(_quantities())
BY_NAME = {quantity.name: quantity for quantity in QUANTITIES}
#: Arrays with values at each sample.
SAMPLED = tuple(quantity for quantity in QUANTITIES if quantity.axes[0] == "time")
#: Names that all files have. Another column may be newer than the file, and is then read as NaN.
REQUIRED = {
    *("time", "q", "v", "a", "multipliers", "constraint_force", "constraint_force_by"),
    *("energy_kinetic", "energy_potential", "energy_total", "energy_balance"),
    *("power_applied", "power_constraint", "power_time", "scale_position", "scale_velocity"),
    *("residual_position", "residual_velocity", "residual_equation"),
}
#: Arrays with one number per sample, which is a function of the sample.
SCALARS = tuple(q for q in SAMPLED if not q.along and q.name != "time")
#: The residuals of each constraint.
RESIDUALS = tuple(q for q in SAMPLED if q.along == "constraint" and q.role == "residual")
#: Arrays that are zero for an exact run.
ERRORS = tuple(q for q in SAMPLED if q.role)
#: Titles of plots, in order, with the quantities in them.
PANELS = {
    panel: tuple(q for q in SAMPLED if q.panel == panel)
    for panel in dict.fromkeys(q.panel for q in SAMPLED if q.name != "time")
}


#: Derivatives with respect to parameters and initial values, if a result has them.
DERIVATIVES = tuple(
    ResultQuantity(
        name,
        ("time", axis, "parameter"),
        f"derivatives of the {what} with respect to parameters and initial values",
        "of what is differentiated, per unit of the parameter",
        text=f"d{text}/d{{parameter}}",
    )
    for name, axis, what, text in (
        ("dq", "coordinate", "coordinates", "{coordinate}"),
        ("dv", "coordinate", "velocities", "{coordinate}_dot"),
        ("dmultipliers", "constraint", "Lagrange multipliers", "lambda.{constraint}"),
    )
)


#: All arrays of a result, by name.
ARRAYS = {quantity.name: quantity for quantity in (*QUANTITIES, *DERIVATIVES)}


def derivative_names(
    quantity: ResultQuantity,
    coordinates: Sequence[str],
    constraints: Sequence[str],
    parameters: Sequence[str],
) -> list[str]:
    """Return the names of the columns of one of `DERIVATIVES`, with parameters varying fastest."""
    axis = quantity.axes[1]
    rows = coordinates if axis == "coordinate" else constraints
    return [quantity.text.format(**{axis: x, "parameter": p}) for x in rows for p in parameters]


class ColumnName(NamedTuple):
    """The name of a column; `str` formats it as in files and messages.

    Parameters
    ----------
    quantity : str
        Quantity of `QUANTITIES`.
    constraint, coordinate : str
        Names of its constraint and coordinate, if it has these axes.
    conserved : str
        Name of the conserved quantity it belongs to.
    """

    quantity: str
    constraint: str = ""
    coordinate: str = ""
    conserved: str = ""

    def __str__(self) -> str:
        return BY_NAME[self.quantity].pattern.format(
            constraint=self.constraint, coordinate=self.coordinate, conserved=self.conserved
        )


def unit_of_column(name: ColumnName, units: Mapping[str, str]) -> str | None:
    """Return the unit of a column; None if unknown.

    Parameters
    ----------
    name : ColumnName
    units : mapping of str to str
        Units of coordinates, and of the columns of constraints (``lambda.guide``) and conserved
        quantities, as in ``Record.units``.
    """
    quantity = BY_NAME[name.quantity]
    if name.coordinate:
        return quantity.unit_at(units.get(name.coordinate))
    if name.conserved:
        return units.get(str(name))
    if name.constraint:
        return units.get(str(name._replace(quantity=name.quantity.replace("scale", "residual"))))
    return None if "{" in quantity.unit else quantity.unit


def unit_quotient(unit: str, by: str) -> str:
    """Return the unit of a quotient of quantities, with SI units: ``(m/s)/s``, ``J/(kg*m)``."""
    if by == "1":
        return unit
    above = f"({unit})" if "/" in unit else unit or "1"
    return f"{above}/({by})" if any(sign in by for sign in "*/ ") else f"{above}/{by}"


def impulse_unit(multiplier_unit: str | None) -> str | None:
    """Return the unit of the impulse of a constraint: that of its multiplier, times s."""
    if not multiplier_unit or multiplier_unit == "1":
        return "s" if multiplier_unit == "1" else multiplier_unit
    numerator, slash, denominator = multiplier_unit.partition("/")
    return f"{numerator}*s{slash}{denominator}"


def column_names(
    quantity: ResultQuantity,
    coordinates: Sequence[str],
    constraints: Sequence[str],
    terms: Sequence[tuple[str, str]] = (),
    conserved: Sequence[str] = (),
) -> list[ColumnName]:
    """Return the names of the columns of a quantity.

    Parameters
    ----------
    quantity : ResultQuantity
    coordinates, constraints : sequence of str
        Names, in the model's order.
    terms : sequence of (constraint, coordinate)
        Terms of ``constraint_force_by``.
    conserved : sequence of str
        Names of the conserved quantities.
    """
    match quantity.along:
        case "coordinate":
            return [ColumnName(quantity.name, "", q) for q in coordinates]
        case "constraint":
            return [ColumnName(quantity.name, c) for c in constraints]
        case "term":
            return [ColumnName(quantity.name, c, q) for c, q in terms]
        case "conserved_quantity":
            return [ColumnName(quantity.name, conserved=name) for name in conserved]
    return [ColumnName(quantity.name)]


def _readings(text: str) -> Iterator[ColumnName]:
    """Yield the columns that a text may name; names of a model may contain dots, as ``r.x``."""
    for quantity in SAMPLED:
        if not quantity.along:
            if text == quantity.pattern:
                yield ColumnName(quantity.name)
            continue
        before, *names, after = re.split(r"{(\w+)}", quantity.pattern)
        names = names[0::2]
        inner = text.removeprefix(before).removesuffix(after)
        if not inner or text != before + inner + after:
            continue
        dots = [dot.start() for dot in re.finditer(r"(?<=.)\.(?=.)", inner)]
        for indices in (
            [(inner,)] if len(names) < 2 else [(inner[:i], inner[i + 1 :]) for i in dots]
        ):
            yield ColumnName(quantity.name, **dict(zip(names, indices, strict=True)))


def read_column_name(
    text: str,
    coordinates: Container[str],
    constraints: Container[str],
    conserved: Container[str] = (),
) -> ColumnName | None:
    """Return the column with a name, given those of the coordinates and constraints.

    Parameters
    ----------
    text : str
        Text of a `ColumnName`; ``time`` and ``t`` both name the time.
    coordinates, constraints, conserved : container of str

    Returns
    -------
    ColumnName or None
        None if no column has this name.
    """
    if text in BY_NAME and not BY_NAME[text].along:
        return ColumnName(text)
    for name in _readings(text):
        known = not name.constraint or name.constraint in constraints
        known = known and (not name.conserved or name.conserved in conserved)
        if known and (not name.coordinate or name.coordinate in coordinates):
            return name
    return None


def read_dotted_name(text: str) -> ColumnName | None:
    """Return the column of a name that begins with that of a quantity, for an unknown model.

    ``lambda.guide``, ``residual_position.guide``, ``conserved.p_phi``; None for other texts, such
    as the coordinate ``r.x``. For ``Qc.rod.phi``, only the quantity is certain: `read_column_name`
    determines the constraint and the coordinate.
    """
    head = text.partition(".")[0]
    for name in _readings(text) if head in _HEADS else ():
        if BY_NAME[name.quantity].pattern.startswith(f"{head}."):
            return name
    return None


#: First parts of dotted names that are not names of a model.
_HEADS = {quantity.pattern.partition(".")[0] for quantity in SAMPLED if "." in quantity.pattern}
