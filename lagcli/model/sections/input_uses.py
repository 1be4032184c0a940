"""Restrictions on inputs: the equations differentiate the expressions that contain them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from symengine import Basic, Derivative, FunctionSymbol

from lagcli.errors import SourceLocation
from lagcli.model.draft import Draft
from lagcli.model.inputs import Input, read_input
from lagcli.model.model import Constraint

_ENERGY = ", or write its force under `Q`"


class InputUses:
    """Reports inputs whose required derivatives do not exist.

    Parameters
    ----------
    draft : Draft
    inputs : mapping of str to Input
    """

    def __init__(self, draft: Draft, inputs: Mapping[str, Input]):
        self.draft, self.inputs = draft, inputs

    def check(
        self,
        constraints: Iterable[Constraint],
        expressions: Iterable[tuple[str, Iterable[Basic | None], int]],
    ) -> None:
        """Check the constraints, and other expressions of a model.

        Parameters
        ----------
        constraints : iterable of Constraint
        expressions : iterable of (key, expressions, order)
            Expressions under a key of the model, and how many times the equations differentiate
            them.
        """
        if not self.inputs:
            return
        for key, several, more in expressions:
            found = next(
                (x for e in several if e is not None and (x := self._rough(e, more))), None
            )
            if found is not None:
                location = self.draft.root.entries[key][1].location
                self._report(found, f"`{key}`", location, _ENERGY if more else "")
        for c in constraints:
            found = self._rough(c.expression, 2 if c.kind == "holonomic" else 1)
            if found is not None and c.location is not None:
                self._report(found, f"the {c.kind} constraint `{c.name}`", c.location, "")

    def _rough(self, expression: Basic, more: int) -> Input | None:
        """Return an input in an expression that cannot be differentiated ``more`` times."""
        for part in expression.atoms(FunctionSymbol, Derivative):
            found = read_input(part)
            if found is not None and found[1] + more > self.inputs[found[0]].smoothness:
                return self.inputs[found[0]]
        return None

    def _report(self, used: Input, where: str, location: SourceLocation, remedy: str) -> None:
        kind = {"step": "jumps", "linear": "has kinks"}.get(used.interpolation, "is not smooth")
        smoother = "linear" if remedy and used.interpolation == "step" else "cubic"
        self.draft.report.add(
            "not-smooth",
            f"{where} depends on `{used.name}`, which {kind} at the rows of its table"
            f" (`interpolation: {used.interpolation}`): the motion would have to jump",
            location,
            f"give `{used.name}` the interpolation `{smoother}`{remedy}",
            ((f"`{used.name}` is declared here", used.location),),
        )
