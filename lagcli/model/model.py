"""Model: the checked content of a model file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, NamedTuple

import symengine as se
from symengine import Basic

from lagcli.columns import ColumnName
from lagcli.errors import Diagnostic, SourceLocation, check_argument
from lagcli.model.dimensions.model_units import NO_UNITS, ModelUnits
from lagcli.model.expression.dimension import Factor
from lagcli.model.expression.functions import is_opaque
from lagcli.model.expression.tensors import Value
from lagcli.model.expression.trees import Tree
from lagcli.prose import counted
from lagcli.settings.settings import SettingsOverrides

if TYPE_CHECKING:
    from array import array

    from lagcli.model.names.namespace import Namespace

Kind = Literal["holonomic", "nonholonomic", "nonlinear"]
#: The sign between the sides of a constraint.
Relation = Literal["=", ">=", "<="]
#: Changes of a contact or a limited row, as named in conditions of events.
ContactChange = Literal["closes", "opens", "slips", "sticks", "impacts"]

#: Interpolations between the rows of a table, and the number of finite derivatives.
INTERPOLATIONS: Mapping[str, int] = MappingProxyType({"step": 0, "linear": 1, "cubic": 3})

#: Values of an input outside its table.
EXTENSIONS = ("hold", "periodic")

TIME = se.Symbol("t")

NO_INDICES: Mapping[str, int] = MappingProxyType({})


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
    return se.Symbol(str(ColumnName("multipliers", constraint)))


def constraint_force(coordinate_name: str, constraint: str | None = None) -> Basic:
    """Return the symbol of the constraint force on a coordinate: total, or of one constraint."""
    quantity = "constraint_force_by" if constraint else "constraint_force"
    return se.Symbol(str(ColumnName(quantity, constraint or "", coordinate_name)))


def input_function(name: str, order: int = 0) -> Basic:
    """Return a known function of time, u(t), or a derivative of it."""
    function = se.Function(name)(TIME)
    for _ in range(order):
        function = function.diff(TIME)
    return function


def read_input(expression: Basic) -> tuple[str, int] | None:
    """Return the name of a known function of time and the order of its derivative.

    None for any other expression.
    """
    function, order = expression, 0
    if isinstance(expression, se.Derivative):
        function, order = expression.args[0], len(expression.args) - 1
    if is_opaque(function):
        return None
    if isinstance(function, se.FunctionSymbol) and function.args == (TIME,):
        return function.get_name(), order
    return None


def as_symbols(expression: Basic) -> Basic:
    """Return an expression with the inputs and their derivatives as symbols: u, u', u''."""
    inputs = {x: read_input(x) for x in expression.atoms(se.FunctionSymbol, se.Derivative)}
    return expression.xreplace(
        {x: se.Symbol(read[0] + "'" * read[1]) for x, read in inputs.items() if read is not None}
    )


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

    ``structural`` states whether coordinates, constraints or sums of the model depend on it: a new
    value then requires loading the model again. Any other parameter is an input of the equations.
    ``location`` is the location of the value; ``low`` and ``high`` are the ends of its slider.
    """

    name: str
    value: float
    unit: str | None = None
    description: str | None = None
    text: str = ""
    structural: bool = False
    written: Written | None = None
    location: SourceLocation | None = None
    low: float | None = None
    high: float | None = None


class Definition(NamedTuple):
    """A named expression; ``indices`` are the index values of a family member."""

    name: str
    value: Value
    tree: Tree
    description: str | None = None
    indices: Mapping[str, int] = NO_INDICES


class MultiplierLimit(NamedTuple):
    """Bounds of a multiplier: |λ| ≤ static while ψ = 0, |λ| = kinetic otherwise.

    ``normal`` is the constraint to whose multiplier the limits are proportional, if any: they are
    then friction.
    """

    static: Basic
    kinetic: Basic
    normal: str | None = None


#: Suffix of a first-order coordinate's name: the constraint that is its equation.
RATE = ".rate"
#: Suffix of a constraint's name: the parameter that is its weight in M while it holds.
WEIGHT = ".weight"
#: Suffix of a coordinate's name: its row of dry friction, a `sign` in Q or an `abs` in D.
SIGN = ".sign"


class Constraint(NamedTuple):
    """A constraint, φ(q, t) = 0, or ψ(q, q', t) = 0, affine in q' unless its kind is nonlinear.

    ``expression`` is lhs − rhs, regardless of the ``relation`` between them; ``indices`` are the
    index values of a family member. A unilateral constraint has a coefficient of ``restitution``,
    and a velocity constraint with bounded λ has a ``limit``. A constraint that is not ``active``
    can be engaged by an event. The friction of a constraint is a separate constraint, after it in
    the model's order: ``floor.slip``. Two kinds of constraints are not written in the file: the
    equation of a first-order coordinate, ``x.rate``, which has no ``left`` and whose λ is 0
    (``projected`` if it is a combination of equations that does not contain the λ of others); and
    dry friction in Q or D, ``x.sign``.
    """

    name: str
    kind: Kind
    expression: Basic
    left: Tree | None = None
    right: Tree | None = None
    description: str | None = None
    location: SourceLocation | None = None
    indices: Mapping[str, int] = NO_INDICES
    relation: Relation = "="
    restitution: Basic | None = None
    limit: MultiplierLimit | None = None
    active: bool = True
    projected: bool = False

    @property
    def of_coordinate(self) -> bool:
        """Whether it is the equation of a first-order coordinate."""
        return self.left is None

    @property
    def sign(self) -> int:
        """Sign of φ and λ of a unilateral constraint, 1 or −1; 0 for any other."""
        return {">=": 1, "<=": -1, "=": 0}[self.relation]

    @property
    def from_sign(self) -> bool:
        """Whether it is dry friction, given as a force or a dissipation function."""
        return SIGN in self.name

    @property
    def lasting(self) -> bool:
        """Whether it holds at all times, unless an event releases it."""
        return self.active and not self.sign and self.limit is None


class EventAction(NamedTuple):
    """Actions of an event, in the order of the file.

    Parameters
    ----------
    set : mapping of str to expression
        New values of coordinates, velocities (``x'``) and parameters, as functions of the old ones.
    impulse : mapping of str to expression
        Generalized impulses by coordinate.
    release, engage : tuples of str
        Names of constraints.
    stop : bool
    record : tuple of str or None
        Names of columns to record; None for all.
    """

    set: Mapping[str, Basic] = MappingProxyType({})
    impulse: Mapping[str, Basic] = MappingProxyType({})
    release: tuple[str, ...] = ()
    engage: tuple[str, ...] = ()
    stop: bool = False
    record: tuple[str, ...] | None = None


class EventClock(NamedTuple):
    """The clock of an event: it happens at offset + k·period, for k = 0, 1, 2, …

    Parameters
    ----------
    period, offset : expression
        Of parameters, s.
    written : tuple of str
        Period and offset as written in the file; the period alone without an offset.
    location : SourceLocation, optional
        Of the period.
    """

    period: Basic
    offset: Basic
    written: tuple[str, ...]
    location: SourceLocation | None = None


class ModelEvent(NamedTuple):
    """An event of the model.

    Parameters
    ----------
    name : str
    when : str
        Condition as written in the file; of a clock, ``every 10 ms``.
    condition : expression or None
        Function that rises through zero when the condition becomes true.
    either : bool
        Whether it triggers in both directions.
    change : (str, ContactChange) or None
        Instead of a condition: the change of a constraint's state.
    action : EventAction
    times : int or None
        Maximum number of occurrences.
    sides : tuple of Tree
        The condition, or the two sides of an equation; none for a change or a clock.
    clock : EventClock or None
        Instead of a condition.
    """

    name: str
    when: str
    condition: Basic | None
    either: bool
    change: tuple[str, ContactChange] | None
    action: EventAction
    times: int | None = None
    sides: tuple[Tree, ...] = ()
    indices: Mapping[str, int] = NO_INDICES
    description: str | None = None
    location: SourceLocation | None = None
    clock: EventClock | None = None


class InputData(NamedTuple):
    """The table of an input, in SI units.

    Parameters
    ----------
    times, values : array of float
        Increasing times, s.
    unit : str or None
        Unit of the values in the file.
    file : str
        Path of the CSV file, as given in the model; empty for a table in the model.
    sha256 : str
        SHA-256 of the file; empty if there is none.
    """

    times: array[float]
    values: array[float]
    unit: str | None = None
    file: str = ""
    sha256: str = ""


class Input(NamedTuple):
    """A known function of time, given by a table.

    Parameters
    ----------
    name : str
    data : InputData
    interpolation : str
        One of `INTERPOLATIONS`.
    extend : str or None
        One of `EXTENSIONS`; None if the function is undefined outside the table.
    description : str, optional
    location : SourceLocation, optional
        Location of its name in the model file.
    """

    name: str
    data: InputData
    interpolation: str
    extend: str | None = None
    description: str | None = None
    location: SourceLocation | None = None

    @property
    def smoothness(self) -> int:
        """Number of times it can be differentiated."""
        return INTERPOLATIONS[self.interpolation]


class InitialValue(NamedTuple):
    """An initial coordinate or velocity: fixed, or a guess that consistent initialization adjusts.

    ``unit`` is the unit in the file; ``value`` is in SI.
    """

    value: float
    fixed: bool
    location: SourceLocation | None = None
    written: Written | None = None
    unit: str | None = None


class Tolerance(NamedTuple):
    """The expression of an absolute tolerance, and its key in the file, which may name several."""

    key: str
    tree: Tree


class DataFile(NamedTuple):
    """Measured data of one experiment.

    Parameters
    ----------
    path : str
        CSV file, relative to the model's folder.
    time : str
        The column of the times.
    set, initial : mappings of str to str
        Values of the experiment, in the syntax of ``--set`` and ``--set-initial``.
    location : SourceLocation
    """

    path: str
    time: str
    set: Mapping[str, str]
    initial: Mapping[str, str]
    location: SourceLocation


class ObservedQuantity(NamedTuple):
    """A quantity measured by a column of the data.

    Parameters
    ----------
    name : str
        Text of the quantity in the file.
    expression : expression or str
        In t, q, q', q'', λ and parameters; or the name of a column that every run has.
    column : str
        Column of the data.
    sigma : float or None
        Standard deviation of a measured value; None if it is to be estimated.
    sigma_given : str, Tree or None
        The unit in which sigma is given, or its expression of parameters; sigma is in SI then.
        None if it is in the unit of the column.
    unit : str or None
        Unit of the column; None if its title may state it.
    location : SourceLocation
    """

    name: str
    expression: Basic | str
    column: str
    sigma: float | None
    sigma_given: str | Tree | None
    unit: str | None
    location: SourceLocation


class FittedQuantity(NamedTuple):
    """A parameter or initial value to be found, and its bounds in SI."""

    name: str
    low: float
    high: float
    location: SourceLocation


class FitBlock(NamedTuple):
    """The `fit` block of a model file."""

    data: tuple[DataFile, ...]
    observed: tuple[ObservedQuantity, ...]
    fitted: tuple[FittedQuantity, ...]
    location: SourceLocation


class Segment(NamedTuple):
    """A line between two points of a view; an edge is a line of an outline."""

    kind: Literal["rod", "rope", "spring", "damper", "belt", "guide", "wall", "edge"]
    name: str
    start: str
    end: str


class Plate(NamedTuple):
    """A filled outline of a view, through points."""

    name: str
    points: tuple[str, ...]


class Disc(NamedTuple):
    """A disc of a view; ``angle`` rotates its spoke, ``normal`` (in 3D) is its axis."""

    name: str
    center: str
    radius: Basic
    angle: Basic | None = None
    normal: tuple[Basic, ...] | None = None


class Arrow(NamedTuple):
    """An arrow of a view: a vector at a point, or the force of a constraint.

    A constraint force is drawn at each of its ``points``; that of a vector constraint is the sum of
    those of its components, ``parts``. Any other arrow has one point and
    ``components``, expressions in the names that outputs may use.
    """

    name: str
    quantity: Literal["velocity", "force", "vector"]
    points: tuple[str, ...]
    components: tuple[Basic, ...] = ()
    constraint: str | None = None
    unit: str | None = None
    parts: tuple[str, ...] = ()


class View(NamedTuple):
    """The drawing of a model.

    Parameters
    ----------
    dimension : int
        2 or 3.
    points : mapping of str to expressions
        Positions in q, q', t and parameters; ``dimension`` components per point.
    segments, plates, discs, vectors : tuples
    grounds, trails, sliders : tuples of str
        Points fixed to the ground, points that leave a trail, and points drawn as sliding blocks.
    masses : tuple of str or None
        Points drawn as masses; None for those whose velocities T contains.
    labels : mapping of str to str or None
        Text at a point; None for the point's name.
    """

    dimension: int
    points: Mapping[str, tuple[Basic, ...]]
    segments: tuple[Segment, ...] = ()
    discs: tuple[Disc, ...] = ()
    grounds: tuple[str, ...] = ()
    trails: tuple[str, ...] = ()
    labels: Mapping[str, str | None] = MappingProxyType({})
    vectors: tuple[Arrow, ...] = ()
    plates: tuple[Plate, ...] = ()
    sliders: tuple[str, ...] = ()
    masses: tuple[str, ...] | None = None


class Preset(NamedTuple):
    """Values that the author names.

    Parameters
    ----------
    name : str
        Any text.
    description : str or None
    set, set_initial : mappings of str to str
        In the syntax of ``--set`` and ``--set-initial``.
    location : SourceLocation
    errors : tuple of Diagnostic
        Why the preset cannot be taken with the number of members that the model has now.
    """

    name: str
    description: str | None
    set: Mapping[str, str]
    set_initial: Mapping[str, str]
    location: SourceLocation
    errors: tuple[Diagnostic, ...] = ()


@dataclass(frozen=True, eq=False)
class Model:
    """A checked model.

    ``name`` identifies the model, as in names of files; ``title`` is its heading.
    ``kinetic`` and ``potential`` are T and V; a model written with L has ``kinetic`` None and
    ``potential`` −L. Expressions are in the symbols of this module's functions and the
    parameters' names. ``set`` and ``set_initial`` are the values that replaced the file's;
    ``settings_need`` are the parameters that the settings depend on, ``tolerances`` the absolute
    tolerances by coordinate and velocity; ``units`` are the units of all quantities, as they follow
    from the text. ``closed`` are the contacts that the initial values state to be closed,
    ``left_out`` the components of vector constraints that hold for all values of the coordinates,
    ``view_errors`` the errors of a view that is left out. ``spins`` states by
    quaternion which components of its initial angular velocity are fixed, where this is given.
    """

    name: str
    title: str
    description: str | None
    path: str
    text: str
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
    settings: SettingsOverrides
    settings_need: frozenset[str]
    trees: Mapping[str, Tree]
    tolerances: Mapping[str, Tolerance]
    names: Namespace
    set: Mapping[str, object]
    set_initial: Mapping[str, object]
    view: View | None = None
    view_errors: tuple[Diagnostic, ...] = ()
    units: ModelUnits = NO_UNITS
    fit: FitBlock | None = None
    events: tuple[ModelEvent, ...] = ()
    closed: frozenset[str] = frozenset()
    left_out: tuple[str, ...] = ()
    spins: Mapping[str, tuple[bool, bool, bool]] = field(default_factory=dict)
    inputs: Mapping[str, Input] = field(default_factory=dict)
    presets: tuple[Preset, ...] = ()

    def __repr__(self) -> str:
        coordinates = counted(len(self.coordinates), "coordinate")
        constraints = counted(len(self.constraints), "constraint")
        return f"<Model {self.name}: {coordinates}, {constraints}>"

    @property
    def sha256(self) -> str:
        """The SHA-256 of the text."""
        import hashlib  # OpenSSL, which a run that writes no file does not need

        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def switches(self) -> bool:
        """Whether the model has constraints that switch, or events."""
        return bool(self.events) or not all(c.lasting for c in self.constraints)

    @property
    def changing_parameters(self) -> frozenset[str]:
        """Names of the parameters that events set."""
        targets = (name for event in self.events for name in event.action.set)
        return frozenset(name for name in targets if name in self.parameters)

    @property
    def data(self) -> dict[str, InputData]:
        """Tables of the inputs by name, as `load_text` needs them."""
        return {name: x.data for name, x in self.inputs.items()}

    @cached_property
    def coordinate_names(self) -> tuple[str, ...]:
        """Names of the coordinates, in the model's order."""
        return tuple(c.name for c in self.coordinates)

    @cached_property
    def constraint_names(self) -> tuple[str, ...]:
        """Names of the constraints, in the model's order."""
        return tuple(c.name for c in self.constraints)

    @property
    def declared_names(self) -> tuple[str, ...]:
        """Names of the coordinates, parameters, definitions and inputs."""
        return (*self.coordinate_names, *self.parameters, *self.definitions, *self.inputs)

    @property
    def initial(self) -> dict[str, InitialValue]:
        """The initial values by the names of coordinates and velocities (``q'``): a copy. `load`
        with ``set_initial`` changes them."""
        velocities = {f"{name}'": value for name, value in self.initial_velocities.items()}
        return {**self.initial_positions, **velocities}

    @property
    def input_files(self) -> tuple[str, ...]:
        """Paths of the CSV files of the inputs."""
        folder = os.path.dirname(self.path)
        return tuple(os.path.join(folder, x.file) for x in self.data.values() if x.file)

    @property
    def structural_parameters(self) -> tuple[str, ...]:
        """Names of the parameters whose change requires a new derivation."""
        return tuple(name for name, p in self.parameters.items() if p.structural)

    @property
    def parameter_values(self) -> dict[str, float]:
        """Parameter values in SI, by name: a copy. `load` with ``set`` changes them."""
        return {name: p.value for name, p in self.parameters.items()}

    @property
    def declared_values(self) -> dict[str, float]:
        """Values in SI of the parameters that the model file declares, by name.

        Without the weights of constraints that coordinates without mass need while they hold.
        """
        return {n: x for n, x in self.parameter_values.items() if not n.endswith(WEIGHT)}


def check_is_model(value: object, function: str) -> None:
    """Raise UsageError if the argument of a function of the package is not a Model."""
    check_argument(function, value, Model, "lagcli.load reads one from a file")
