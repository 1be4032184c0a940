"""The system on the page: coordinates, constraints, equations of motion, sign convention."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from html import escape

from lagcli.arrays import Array
from lagcli.columns import BY_NAME
from lagcli.equations.derivation.lagrange import ConstraintEquation
from lagcli.equations.presentation.conserved import conserved_step
from lagcli.equations.presentation.extent import abridged, is_large, items_of
from lagcli.equations.presentation.formulas import Formulas, Signs, force
from lagcli.equations.presentation.index_form import IndexForm
from lagcli.equations.presentation.matrices import Matrices
from lagcli.equations.presentation.overview import convention, in_matrices, kind_of
from lagcli.equations.presentation.steps import steps as derivation
from lagcli.equations.presentation.switching import as_inequality
from lagcli.equations.symmetry.conserved import conserved_quantities, generalized
from lagcli.equations.symmetry.linear import QUICK
from lagcli.equations.typesetting.mathml import MathmlFormula, equation, inline
from lagcli.equations.typesetting.nodes import Line, Node, Step, Symbol
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.text import TextFormula
from lagcli.equations.typesetting.writer import written_decimals
from lagcli.pictures.balance import Balance, live_equation
from lagcli.pictures.page import number, own_words, table, unit
from lagcli.pictures.selection import chosen, elided

#: Largest number of coordinates, parameters, constraints and equations that are listed; of more
#: than these, approximately this number of constraints and equations.
_ROWS, _PARAMETERS, _LISTED, _FEW = 24, 60, 12, 6
#: Largest number of coordinates for index form, which requires comparing all members.
_INDEXED = 300
#: Approximate number of lines of text of a large system's matrices.
_LINES = 150
#: Number of nodes of an equation above which it is not arranged.
_NODES = 200_000
#: Number of characters of a formula above which its sums are abridged, and above which it is
#: omitted.
_LONG, _LETTERS = 700, 4000


class EquationSystem:
    """The equations of one run, or of an analysis, in HTML.

    Parameters
    ----------
    formulas : Formulas
        Formulas of its model.
    units : mapping of str to str
        SI units, by name.
    parameters : mapping of str to float
        Values of the parameters.
    live : bool
        Whether the page shows the values of terms along a run.
    """

    def __init__(
        self,
        formulas: Formulas,
        units: Mapping[str, str],
        parameters: Mapping[str, float],
        live: bool = False,
    ):
        self.live = live
        self.formulas, self.units, self.values = formulas, units, parameters
        self.equations, self.model = formulas.equations, formulas.model
        self.index_form = IndexForm(self.model)
        self.indexed = self.index_form.families and len(self.equations.q) <= _INDEXED
        self.names = Notation(self.model)
        decimals = written_decimals(self.model)
        self.mathml = MathmlFormula(self.names, decimals)
        self.text = TextFormula(self.names, decimals)

    @cached_property
    def balance(self) -> Balance:
        """The terms of the equations of motion that are shown in full; of none if not live."""
        shown = self._motion if self.live and not self.indexed else {}
        return Balance(self.formulas, {i: x for i, x in shown.items() if self._fits(x)})

    def symbol(self, name: str, dots: int = 0) -> str:
        """Return a name of the model as an inline formula."""
        return inline(Symbol(name, dots), self.mathml)

    def multiplier(self, constraint: str) -> str:
        """Return λ of a constraint as an inline formula."""
        return inline(Symbol(constraint, kind="multiplier"), self.mathml)

    def coordinates(self, first: Sequence[Array]) -> str:
        """Return the table of coordinates, with their values at the first sample if there is one.

        Parameters
        ----------
        first : sequence of (nq,) arrays
            q and v; none if the run has no samples.
        """
        given = self.model.coordinates
        places = chosen(self.model.coordinate_names, _ROWS)
        head = ["Coordinate", "Meaning", "Unit"]
        head += ["At the start", "Rate at the start", "Unit of the rate"] if first else []
        rows = []
        for j in places:
            c = given[j]
            row = [self.symbol(c.name), own_words(c.description), unit(self.units.get(c.name))]
            values = [number(float(x[j])) for x in first]
            rate = [unit(BY_NAME["v"].unit_at(self.units.get(c.name)))] if first else []
            rows.append([*row, *values, *rate])
        title = "Coordinates and initial values" if first else "Coordinates"
        caption = _counted(title, len(places), len(given))
        return table(caption, head, elided(places, rows, _dots(head)), numeric=(3, 4))

    def parameters(self) -> str:
        """Return the table of parameters with the values of the run."""
        names = list(self.model.parameters)
        if not names:
            return ""
        places = chosen(names, _PARAMETERS)
        rows = []
        for i in places:
            p = self.model.parameters[names[i]]
            value = self.values.get(p.name, p.value)
            shown = unit(self.units.get(p.name, p.unit))
            rows.append([self.symbol(p.name), own_words(p.description), number(value), shown])
        caption = _counted("Parameters, in SI units", len(places), len(names))
        head = ["Parameter", "Meaning", "Value", "Unit"]
        return table(caption, head, elided(places, rows, _dots(head)), numeric=(2,))

    def energies(self) -> str:
        """Return T and V, or L, as given by the model."""
        lines = self._energies
        if self.indexed:
            lines = [Line(tuple(map(self.index_form.sums, line.sides))) for line in lines]
        return "".join(map(self._limited, lines))

    @cached_property
    def _energies(self) -> list[Line]:
        signs, trees = Signs(self.model), self.model.trees
        stated = {"L": signs.lagrangian, "T": signs.kinetic, "V": signs.potential}
        written = self.formulas.written
        return [Line((sign, written(trees[key]))) for key, sign in stated.items() if key in trees]

    def _items(self, lines: Iterable[Line]) -> list[list[Line]]:
        """Return lines in index form, grouped by label."""
        step = Step("", tuple(lines))
        if self.indexed:
            step = self.index_form.step(step)
        return items_of(step.lines)

    def _listed(
        self, lines: Mapping[int, list[Line]], count: int
    ) -> tuple[dict[int, list[Line]], int]:
        """Return the listed items, by their indices, and their total number.

        The lines of each index become an item; families become items in index form.
        """
        if not self.indexed:
            return dict(lines), count
        items = self._items(line for item in lines.values() for line in item)
        labels = [
            label.name if isinstance(label := x[0].label, Symbol) else str(label) for x in items
        ]
        return {i: items[i] for i in chosen(labels, _LISTED, _FEW)}, len(items)

    def _places(self, names: Sequence[str]) -> list[int]:
        """Return the indices of constraints or equations that are listed: all of indexed ones."""
        if self.indexed:
            return list(range(len(names)))
        return chosen(names, _LISTED, _FEW)

    @cached_property
    def _constraints(self) -> dict[int, ConstraintEquation]:
        """The listed constraints, by index."""
        every = self.equations.constraints
        return {i: every[i] for i in self._places(self.model.constraint_names)}

    @cached_property
    def _matrices(self) -> list[Step]:
        """M, f, B and γ with abbreviations, if `derive` prints them; otherwise nothing."""
        # of many short equations, a few are listed
        many = len(self.equations.q) > _LISTED
        if not (is_large(self.equations) if many else in_matrices(self.formulas)):
            return []
        matrices = Matrices(self.formulas)
        if matrices.size > _LINES:
            matrices = Matrices(self.formulas, ("M", "f", "B"))
        return matrices.steps(_LINES)

    def _step(self, step: Step) -> str:
        lines = [self._equation(line) for line in step.lines]
        remark = escape(step.remark or "").replace(
            "--full writes everything out.", "<code>lagcli derive</code> prints more."
        )
        shown = "".join(lines)
        if step.packed:
            shown = f'<div class="packed">{shown}</div>'
        return f"<h4>{escape(step.title)}</h4>{shown}<p class='note'>{remark}</p>"

    @cached_property
    def _motion(self) -> dict[int, Line]:
        """The listed equations, by index."""
        if self._matrices:
            return {}
        return {
            i: self.formulas.equation_line(i) for i in self._places(self.model.coordinate_names)
        }

    def definitions(self) -> str:
        """Return the definitions used in energies, constraints and equations, as written."""
        lines = [*self._energies, *self._motion.values()]
        nodes = [side for line in lines for side in line.sides]
        used = self.formulas.definition_lines(self._constraints.values(), nodes)
        if not used:
            return ""
        definitions = [line for item in self._items(used) for line in item]
        names = [side.name for line in definitions if isinstance(side := line.sides[0], Symbol)]
        places = chosen(names, _ROWS, _FEW)
        shown = [self._noted(definitions[i]) for i in places]
        rest = _elision(len(places), len(definitions), "definitions")
        return f"<h3>Definitions</h3>{''.join(shown)}{rest}"

    def forces(self) -> str:
        """Return the generalized forces Q without potential, including those of D."""
        applied = self.equations.applied_forces
        names = [q for q, x in zip(self.model.coordinate_names, applied, strict=True) if x != 0]
        lines = []
        for i in chosen(names, _LISTED, _FEW):
            expression = applied[self.model.coordinate_names.index(names[i])]
            if _nodes(expression, _NODES) < _NODES:
                lines.append(Line((force(Symbol(names[i])), self.formulas.arrange(expression))))
        if not lines:
            return ""
        rest = _elision(len(lines), len(names), "forces")
        return f"<h3>Applied forces</h3>{''.join(map(self._limited, lines))}{rest}"

    def constraints(self) -> str:
        """Return the constraints as written, their kinds, and their virtual displacements."""
        constraints = self._constraints
        if not constraints:
            return "<p>None: the coordinates are independent.</p>"
        shown: dict[int, list[Line]] = {}
        about: dict[str, str] = {}
        for i, c in constraints.items():
            name, kind = c.constraint.name, kind_of(c, self.equations)
            stated = as_inequality(self.formulas.constraint_line(c), c)
            variation = as_inequality(self.formulas.variation_line(c), c)
            shown[i] = [replace(stated, label=name, note=kind), variation]
            about[_family(name)] = c.constraint.description or ""
        listed, count = self._listed(shown, len(self.equations.constraints))
        items = []
        for item in listed.values():
            name = str(item[0].label)
            description = own_words(about[_family(name)])
            items.append(
                f'<dt><span class="name">{escape(name)}</span>:'
                f" {escape(item[0].remark or '')}, multiplier"
                f" {self.multiplier(name)}{f' – {description}' if description else ''}</dt>"
                f"<dd>{''.join(map(self._equation, item))}</dd>"
            )
        rest = _elision(len(items), count, "constraints")
        return f'<dl class="constraints">{"".join(elided(list(listed), items, _DOTS))}</dl>{rest}'

    def freedom(self) -> str:
        """Return a sentence on the degrees of freedom."""
        n, m = len(self.equations.q), len(self.equations.constraints)
        freedom = self.formulas.freedom
        coordinates, constraints = _number_of(n, "coordinate"), _number_of(m, "constraint")
        if not m:
            return f"<p>{coordinates}, no constraint: {_number_of(n, 'degree')} of freedom.</p>"
        active = freedom.constraints  # fewer than m if some are open or engaged later
        counted, condition = f"{n} − {active}", ", if the constraints are independent"
        if freedom.rank is not None:
            counted, condition = f"{n} − {freedom.rank}", ""
            if freedom.rank != active:
                condition = f": the rank of B is {freedom.rank} at the start"
            elif self.equations.model.switches:
                condition = f", with {_number_of(active, 'constraint')} active at the start"
        remarks = "".join(f"<p>{escape(x)}</p>" for x in freedom.remarks)
        return (
            f"<p>{coordinates}, {constraints}: {counted} ="
            f" <strong>{_number_of(freedom.degrees, 'degree')} of freedom</strong>{condition}.</p>"
            + remarks
        )

    def conserved(self) -> str:
        """Return the monitored conserved quantities and the energy, with proofs."""
        eq, parts = self.equations, []
        for quantity in conserved_quantities(eq, QUICK).quantities:
            step = conserved_step(self.formulas, generalized(eq, quantity))
            remark = f"<p class='note'>{escape(step.remark)}</p>" if step.remark else ""
            title = step.title.removeprefix("Conserved: ")
            groups: list[tuple[str, list[str]]] = []
            for line in step.lines:
                if isinstance(line.label, str):
                    groups.append((line.label, []))
                groups[-1][1].append(self._limited(line))
            listed = "".join(
                f'<dt><span class="name">{escape(name)}</span></dt><dd>{"".join(shown)}</dd>'
                for name, shown in groups
            )
            parts.append(
                f"<h4>{escape(title[0].upper() + title[1:])}</h4>"
                f'<dl class="constraints">{listed}</dl>{remark}'
            )
        return f"<h3>Conserved quantities, with proofs</h3>{''.join(parts)}" if parts else ""

    def motion(self) -> str:
        """Return the equations of motion; long ones are replaced by their size."""
        if self._matrices:
            return "".join(map(self._step, self._matrices))
        written = {i: [line] for i, line in self._motion.items()}
        listed, count = self._listed(written, len(self.equations.q))
        items = [
            f"<dt>{inline(line.label, self.mathml)}</dt><dd>{self._moving(i, line)}</dd>"
            for i, (line,) in listed.items()
            if isinstance(line.label, Node)
        ]
        rest = _elision(len(items), count, "equations")
        shown = "".join(elided(list(listed), items, _DOTS))
        return f'<dl class="equations">{shown}</dl>{rest}'

    def _moving(self, i: int, line: Line) -> str:
        if i not in self.balance.terms:
            return self._noted(line)
        return live_equation(i, line, self.balance, self.mathml, self.text)

    def steps(self) -> str:
        """Return the derivation, folded; nothing for a system that is not written out."""
        if self._matrices or len(self.equations.q) > _LISTED:
            return ""
        parts = []
        for place, step in enumerate(self.index_form.steps(derivation(self.formulas)), 1):
            lead = f"<p>{escape(step.lead)}</p>" if step.lead else ""
            lines = "".join(self._labelled(line) for line in step.lines)
            remark = f"<p class='note'>{escape(step.remark)}</p>" if step.remark else ""
            parts.append(f"<h4>{place}. {escape(step.title)}</h4>{lead}{lines}{remark}")
        return (
            '<details class="steps"><summary>Derivation, step by step</summary>'
            f"{''.join(parts)}</details>"
        )

    def _noted(self, line: Line) -> str:
        formula = self._limited(line)
        if not line.remark:
            return formula
        return f'<div class="noted">{formula}<span>{escape(line.remark)}</span></div>'

    def _labelled(self, line: Line) -> str:
        label, formula = line.label, self._noted(line)
        if label is None:
            return formula
        shown = escape(label) if isinstance(label, str) else inline(label, self.mathml)
        return f'<div class="labelled"><span class="kind">{shown}:</span>{formula}</div>'

    def convention(self) -> str:
        """Return the general equations, which define the sign of λ."""
        step = convention(self.formulas)
        remark = f"<p>{escape(step.remark)}</p>" if step.remark else ""
        return "".join(self._equation(line) for line in step.lines) + remark

    def _limited(self, line: Line) -> str:
        """Return a formula, or its length if it is too long."""
        if not self._fits(line):
            line = Line(tuple(map(abridged, line.sides)))
        letters = self._letters(line)
        return _too_long(f"{letters} letters") if letters > _LETTERS else self._equation(line)

    def _fits(self, line: Line) -> bool:
        """Whether a formula is short enough to be shown in full."""
        return self._letters(line) <= _LONG

    def _letters(self, line: Line) -> int:
        return sum(len(self.text.text(side)) for side in line.sides)

    def _equation(self, line: Line) -> str:
        return equation(line, self.mathml, self.text)


def _family(name: str) -> str:
    return name.partition("[")[0]


def _nodes(expression: object, most: int) -> int:
    """Count the nodes of an expression, up to the limit."""
    count, stack = 0, [expression]
    while stack and count < most:
        count += 1
        stack.extend(stack.pop().args)  # type: ignore[attr-defined]
    return count


def _too_long(size: str) -> str:
    return (
        f"<p class='note'>Too long to be read on a page ({size});"
        " <code>lagcli derive</code> prints it.</p>"
    )


def _elision(shown: int, count: int, what: str) -> str:
    """Return a remark on the number of omitted items."""
    if shown == count:
        return ""
    return (
        f'<p class="note">{shown} of {count} {what}; <code>lagcli derive</code> prints all of'
        " them.</p>"
    )


def _counted(title: str, shown: int, count: int) -> str:
    return title if shown == count else f"{title} ({shown} of {count})"


def _number_of(count: int, what: str) -> str:
    return f"{count} {what}" + ("" if count == 1 else "s")


_DOTS = '<dt class="dots">⋮</dt><dd></dd>'


def _dots(head: Sequence[str]) -> list[str]:
    """Return a row of a table that represents omitted ones."""
    return ["⋮", *[""] * (len(head) - 1)]
