"""Initial values of vectors and rotations, component by component."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from lagcli.model.draft import Draft, Formula, Indices
from lagcli.model.expression.quantities import Quantity, read_quantity
from lagcli.model.expression.tensors import Tensor
from lagcli.model.expression.trees import (
    ComponentExpr,
    Name,
    NumberExpr,
    ProductExpr,
    SumExpr,
    Tree,
    VectorExpr,
    walk,
)
from lagcli.model.initial_values import InitialReader, initial_names, unwrapped
from lagcli.model.model import InitialValue, Written
from lagcli.model.names.expansion import substituted
from lagcli.model.names.families import Declaration
from lagcli.model.symbols import Context, Symbols
from lagcli.model.vectors.kinds import KINDS
from lagcli.model.yaml.source import Sequence, YamlNode

Values = dict[str, InitialValue]
_AXES = ("x", "y", "z")
#: 2 e' = e (0, ω): for each e.k the terms sign·e.i·ω.j.
_RATES = (
    ((-1, 1, 0), (-1, 2, 1), (-1, 3, 2)),
    ((1, 0, 0), (1, 2, 2), (-1, 3, 1)),
    ((1, 0, 1), (1, 3, 0), (-1, 1, 2)),
    ((1, 0, 2), (1, 1, 1), (-1, 2, 0)),
)


class VectorReader:
    """Reads the initial value of a vector or rotation, or its derivative.

    Parameters
    ----------
    draft : Draft
    declaration : Declaration
        The entry of ``initial``, with its value as node.
    kind : str
        One of `KINDS`. The derivative of a quaternion is given by the angular velocity in the body
        frame.
    constants : Symbols
        Parameters with their values.
    """

    def __init__(
        self,
        draft: Draft,
        declaration: Declaration,
        kind: str,
        constants: Symbols,
    ):
        self.draft, self.declaration, self.constants = draft, declaration, constants
        self.what = f"the initial value of `{declaration.title}`"
        self.rotates = kind == "quaternion"
        self.turning = self.rotates and bool(declaration.primes)
        self.parts = _AXES if self.turning else KINDS[kind].parts
        self.location = declaration.node.location
        value, self.fixed = unwrapped(draft, declaration.node, self.what)
        self.cells: dict[str, InitialReader] = {}
        self.found: dict[str, Values] = {}
        if isinstance(value, Sequence):
            self.listed(value)
        elif value is not None:
            self.written(value)

    def listed(self, node: Sequence) -> None:
        """Read a list of components, each with its unit, fixed or guessed."""
        if len(node.items) != len(self.parts):
            self.wrong_shape(node, f"a list of {len(node.items)}")
            return
        for part, item in zip(self.parts, node.items, strict=True):
            own = self.declaration._replace(node=item, part=f".{part}")
            self.cells[part] = InitialReader(self.draft, own, self.constants, self.fixed)

    def written(self, node: YamlNode) -> None:
        """Read an expression, such as ``l*[1, 0, 0]`` or ``rot_z(30 deg)``."""
        names = initial_names(self.draft, self.constants)
        quantity = read_quantity(self.draft, node, self.what, names)
        if quantity is None:
            return
        tree = quantity.parsed.tree
        trees = self.parts_of(tree, quantity)
        for part, component in trees.items():
            own = quantity._replace(parsed=quantity.parsed._replace(tree=component))
            declared = self.declaration._replace(part=f".{part}", node=node)
            reader = InitialReader(self.draft, declared, self.constants, self.fixed, own)
            self.cells[part] = reader

    def parts_of(self, tree: Tree, quantity: Quantity) -> dict[str, Tree]:
        """Return the components of an expression of the right shape."""
        identity = self.rotates and not self.turning
        if quantity.number == identity:  # 0 for a vector, 1 for a rotation
            numbers = [identity, *(0 for _ in self.parts[1:])]
            place = tree.start, tree.end
            return {
                part: NumberExpr(*place, Fraction(x))
                for part, x in zip(self.parts, numbers, strict=True)
            }
        if isinstance(tree, VectorExpr) and len(tree.items) == len(self.parts):
            return dict(zip(self.parts, tree.items, strict=True))
        context = Context(self.what, coordinates=False, definitions=False, time=False)
        names = initial_names(self.draft, self.constants)
        indices = self.declaration.indices
        formula = Formula(self.draft, quantity.parsed, context, names, indices)
        sized = formula.value(dict.fromkeys(indices, 1))
        if sized is None:
            return {}
        value = sized.value
        wanted = (3, 3) if identity else (len(self.parts), 1)
        if not isinstance(value, Tensor) or value.shape != wanted:
            kind = value.kind if isinstance(value, Tensor) else "a scalar"
            self.wrong_shape(quantity.parsed.node, kind)
            return {}
        return {p: ComponentExpr(tree.start, tree.end, tree, p) for p in self.parts}

    def wrong_shape(self, node: YamlNode, found: str) -> None:
        """Report a value that is not a vector or rotation of the right size."""
        if self.turning:
            wanted = "the angular velocity in the frame of the body, a vector of 3"
            help_ = f"write `{self.declaration.title}: [0, 0, 2 rad/s]`"
        elif self.rotates:
            wanted = "a rotation, or the four components of a quaternion"
            help_ = f"write `{self.declaration.title}: rot_z(30 deg)`, or `[1, 0, 0, 0]`"
        else:
            wanted = f"a vector of {len(self.parts)}"
            help_ = f"write `{self.declaration.title}: [0, 0, 0]`"
        message = f"{self.what} must be {wanted}, not {found}"
        self.draft.report.add("shape", message, node.location, help_)

    @property
    def fixed_spin(self) -> tuple[bool, bool, bool]:
        """Which components of an angular velocity are fixed."""
        x, y, z = (axis in self.cells and self.cells[axis].fixed for axis in _AXES)
        return x, y, z

    def read(self, canonical: str, indices: Indices, values: Values) -> None:
        """Evaluate one component, ``r.x``, ``e.0`` or ``e.0'``."""
        base, _, part = canonical.rstrip("'").rpartition(".")
        if self.turning:
            found = self.found.get(base)
            if found is None:
                found = self.found[base] = self.rates(base, indices, values)
            if canonical in found:
                values[canonical] = found[canonical]
        elif part in self.cells:
            self.cells[part].read(canonical, indices, values)

    def rates(self, base: str, indices: Indices, values: Values) -> Values:
        """Return the derivatives of a quaternion from the angular velocity."""
        omega: Values = {}
        for axis, cell in self.cells.items():
            cell.read(axis, indices, omega)
        e = [values.get(f"{base}.{k}") for k in KINDS["quaternion"].parts]
        known = [x for x in e if x is not None]
        if len(omega) < len(_AXES) or len(known) < len(e):
            return {}
        w = [omega[axis] for axis in _AXES]
        found: Values = {}
        for k, terms in enumerate(_RATES):
            value = sum(sign * known[i].value * w[j].value for sign, i, j in terms) / 2
            tree = _half_sum([(sign, known[i], w[j]) for sign, i, j in terms])
            varies = any(isinstance(x, Name) for x in walk(tree))
            written = Written(tree, 1, {}) if varies else None
            fixed = all(x.fixed for x in w)
            unit = "1/s" if varies else None
            found[f"{base}.{k}'"] = InitialValue(value, fixed, self.location, written, unit)
        return found


def _half_sum(terms: list[tuple[int, InitialValue, InitialValue]]) -> Tree:
    """Return half the sum of products of initial values, unevaluated."""
    half = NumberExpr(0, 0, Fraction(1, 2))
    products = [
        (sign, ProductExpr(0, 0, ((1, half), (1, _tree(a)), (1, _tree(b))))) for sign, a, b in terms
    ]
    return SumExpr(0, 0, tuple(products))


def _tree(value: InitialValue) -> Tree:
    written = value.written
    if written is None:
        return NumberExpr(0, 0, Fraction(value.value))
    numbers: Mapping[str, Tree] = {
        name: NumberExpr(0, 0, Fraction(k)) for name, k in written.indices.items()
    }
    tree = substituted(written.tree, numbers, (0, 0))
    if written.factor == 1:
        return tree
    return ProductExpr(0, 0, ((1, tree), (1, NumberExpr(0, 0, Fraction(written.factor)))))
