"""Models in Modelica as lagcli writes them: read by the grammar of Modelica, and evaluated.

Of the language there is what exported models use: declarations of Real, functions, equations.
A choice reaches as far as it can, as in the specification (B.2.7): the last value of
``if c then x else y + z`` is ``y + z``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from lagcli.export.names import words

Tree = Any  # a number, or a tuple of a kind and its parts
Values = dict[str, Any]

_TOKEN = re.compile(
    r"\s*(?://[^\n]*\n\s*)*(?:"
    r"(?P<number>\d+\.?\d*(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_]\w*)"
    r'|(?P<text>"(?:\\.|[^"\\])*")|(?P<sign>:=|<=|>=|[-+*/^()\[\]{},;:=<>]))'
)
_KEYWORDS = words(
    "algorithm and annotation constant else end equation function if input loop model not or output"
    " parameter protected then while Real Integer"
)
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{x: getattr(math, x) for x in ("sin", "cos", "tan", "asin", "acos", "atan", "atan2")},
    **{x: getattr(math, x) for x in ("sinh", "cosh", "tanh", "exp", "log", "sqrt")},
    "abs": abs,
    "max": max,
    "floor": lambda x: float(math.floor(x)),
    "ceil": lambda x: float(math.ceil(x)),
    "div": lambda a, b: int(a / b),
}


class Function(NamedTuple):
    """A function: its inputs, its output, its local variables with values, its statements."""

    inputs: list[str]
    output: str
    local: list[tuple[str, Tree | None]]
    statements: list[Tree]


class ModelicaModel:
    """An exported model.

    Attributes
    ----------
    name : str
    parameters : dict
        Values by name, in order.
    start : dict
        Start values by name, in order: those of the coordinates, then those of the velocities.
    variables : list of str
        The variables that are no parameters, in order.
    equations : list of (left, right)
    """

    def __init__(self, text: str):
        self._tokens = _tokens(text)
        self._at = 0
        self.parameters: dict[str, float] = {}
        self.start: dict[str, float] = {}
        self.variables: list[str] = []
        self.functions: dict[str, Function] = {}
        self.equations: list[tuple[Tree, Tree]] = []
        self._take("model")
        self.name = self._name()
        self._comment()
        while self._next != "equation":
            self._declaration()
        self._take("equation")
        while self._next != "annotation":
            left = self._expression()
            self._take("=")
            self.equations.append((left, self._expression()))
            self._take(";")
        while self._next != "end":
            self._at += 1
        self._take("end", self.name, ";")
        assert self._next == ""

    # reading

    @property
    def _next(self) -> str:
        return self._tokens[self._at][1]

    def _take(self, *texts: str) -> None:
        for text in texts:
            assert self._next == text, (text, self._tokens[max(self._at - 9, 0) : self._at + 3])
            self._at += 1

    def _skip(self, text: str) -> bool:
        found = self._next == text
        self._at += found
        return found

    def _name(self) -> str:
        kind, text = self._tokens[self._at]
        assert kind == "name", text
        assert text not in _KEYWORDS, text
        self._at += 1
        return text

    def _comment(self) -> None:
        self._at += self._tokens[self._at][0] == "text"

    def _new(self) -> str:
        """Read a name that nothing else has."""
        name = self._name()
        assert name not in {*self.parameters, *self.variables, *self.functions}, name
        return name

    def _declaration(self) -> None:
        if self._skip("protected"):
            return
        if self._skip("function"):
            name = self._new()
            self.functions[name] = self._function(name)
            return
        parameter = self._skip("parameter")
        self._take("Real")
        name = self._new()
        if self._skip("["):
            self._expression()
            self._take("]")
        if self._skip("("):
            while not self._skip(")"):
                attribute = self._name()
                self._take("=")
                if self._tokens[self._at][0] == "text":
                    self._comment()
                else:
                    value = self._value(self._expression(), {"true": True})
                    self.start |= {name: value} if attribute == "start" else {}
                self._skip(",")
        if parameter:
            self._take("=")
            self.parameters[name] = self._value(self._expression(), {})
        else:
            self.variables.append(name)
        self._comment()
        self._take(";")

    def _function(self, name: str) -> Function:
        self._comment()
        inputs, local, output = list[str](), list[tuple[str, Tree | None]](), ""
        while self._next != "algorithm":
            self._skip("protected")
            kind = self._next
            self._at += kind in ("input", "output", "constant")
            self._at += 1  # the type
            own, value = self._name(), None
            if self._skip("["):
                while not self._skip("]"):
                    self._at += 1
            if self._skip("="):
                value = self._expression()
            self._take(";")
            if kind == "input":
                inputs.append(own)
            elif kind == "output":
                output = own
            else:
                local.append((own, value))
        self._take("algorithm")
        statements = self._statements()
        self._take("end", name, ";")
        return Function(inputs, output, local, statements)

    def _statements(self) -> list[Tree]:
        found: list[Tree] = []
        while self._next not in ("end", "else"):
            if self._skip("while"):
                condition = self._expression()
                self._take("loop")
                found.append(("while", condition, self._statements()))
                self._take("end", "while", ";")
            elif self._skip("if"):
                condition = self._expression()
                self._take("then")
                yes = self._statements()
                no = self._statements() if self._skip("else") else []
                found.append(("choice", condition, yes, no))
                self._take("end", "if", ";")
            elif self._skip("assert"):
                self._take("(")
                found.append(("assert", self._expression()))
                self._take(",")
                self._comment()
                self._take(")", ";")
            else:
                target = self._primary()
                self._take(":=")
                found.append(("set", target, self._expression()))
                self._take(";")
        return found

    def _expression(self) -> Tree:
        if self._skip("if"):
            condition = self._expression()
            self._take("then")
            yes = self._expression()
            self._take("else")
            return ("if", condition, yes, self._expression())
        return self._joined("or", lambda: self._joined("and", self._negated))

    def _joined(self, word: str, part: Callable[[], Tree]) -> Tree:
        left = part()
        while self._skip(word):
            left = (word, left, part())
        return left

    def _negated(self) -> Tree:
        return ("not", self._relation()) if self._skip("not") else self._relation()

    def _relation(self) -> Tree:
        left = self._sum()
        sign = self._next
        if sign not in ("<", "<=", ">", ">="):
            return left
        self._at += 1
        return (sign, left, self._sum())

    def _sum(self) -> Tree:
        left: Tree = ("-", 0.0, self._product()) if self._skip("-") else self._product()
        while (sign := self._next) in ("+", "-"):
            self._at += 1
            left = (sign, left, self._product())
        return left

    def _product(self) -> Tree:
        left = self._power()
        while (sign := self._next) in ("*", "/"):
            self._at += 1
            left = (sign, left, self._power())
        return left

    def _power(self) -> Tree:
        base = self._primary()
        return ("^", base, self._primary()) if self._skip("^") else base

    def _primary(self) -> Tree:
        kind, text = self._tokens[self._at]
        if kind == "number":
            self._at += 1
            return float(text)
        if self._skip("("):
            inside = self._expression()
            self._take(")")
            return inside
        if self._skip("{"):
            return ("array", self._list("}"))
        name = self._name()
        if self._skip("("):
            return ("call", name, self._list(")"))
        if self._skip("["):
            return ("entry", name, self._list("]"))
        return ("name", name)

    def _list(self, end: str) -> list[Tree]:
        found: list[Tree] = []
        while not self._skip(end):
            found.append(":" if self._skip(":") else self._expression())
            self._skip(",")
        return found

    # values

    def _value(self, e: Tree, at: Mapping[str, Any]) -> Any:
        if not isinstance(e, tuple):
            return e
        kind, *parts = e
        match kind:
            case "name":
                return at[parts[0]]
            case "if":
                return self._value(parts[1 if self._value(parts[0], at) else 2], at)
            case "and" | "or":
                both = (self._value(x, at) for x in parts)
                return all(both) if kind == "and" else any(both)
            case "not":
                return not self._value(parts[0], at)
            case "array":
                return np.array([self._value(x, at) for x in parts[0]])
            case "entry":
                return at[parts[0]][self._place(parts[1], at)]
            case "call":
                return self._called(parts[0], [self._value(x, at) for x in parts[1]])
        left, right = (self._value(x, at) for x in parts)
        match kind:
            case "+":
                return left + right
            case "-":
                return left - right
            case "*":
                return left * right
            case "/":
                return float(np.divide(left, right))
            case "^":
                return float(np.power(left, right))
            case "<":
                return left < right
            case "<=":
                return left <= right
            case ">":
                return left > right
        return left >= right

    def _place(self, indices: Sequence[Tree], at: Mapping[str, Any]) -> Any:
        found = [slice(None) if x == ":" else int(self._value(x, at)) - 1 for x in indices]
        return tuple(found) if len(found) > 1 else found[0]

    def _called(self, name: str, arguments: list[Any]) -> Any:
        if name in self.functions:
            inputs, output, local, statements = self.functions[name]
            at = dict(zip(inputs, arguments, strict=True))
            for own, value in local:
                at[own] = None if value is None else self._value(value, at)
            self._run(statements, at)
            return at[output]
        try:
            return _FUNCTIONS[name](*arguments)
        except ValueError:
            return math.nan

    def _run(self, statements: Sequence[Tree], at: Values) -> None:
        for kind, *parts in statements:
            match kind:
                case "while":
                    while self._value(parts[0], at):
                        self._run(parts[1], at)
                case "choice":
                    self._run(parts[1 if self._value(parts[0], at) else 2], at)
                case "assert":
                    assert self._value(parts[0], at)
                case _:
                    target, value = parts[0], self._value(parts[1], at)
                    if target[0] == "name":
                        at[target[1]] = np.copy(value) if isinstance(value, np.ndarray) else value
                    else:
                        at[target[1]][self._place(target[2], at)] = value

    # the solution

    def solution(
        self, time: float, state: Mapping[str, float], parameters: Mapping[str, float]
    ) -> Values:
        """Return the values of all variables at a state.

        Equations of one unknown variable are solved in turn; those that are left are linear, apart
        from products of one variable in `lambda` and one of a share, which are solved first.
        """
        at: Values = {"time": time, **self.parameters, **parameters, **state}
        rest = []
        for left, right in self.equations:
            if left[0] == "call" and left[1] == "der":
                at[f"der({left[2][0][1]})"] = right
            else:
                rest.append((left, right))
        rest = self._assigned(rest, at)
        motion = [pair for pair in rest if pair[0][0] != "name"]
        shares = [pair for pair in motion if all("share_" in x for x in self._unknown(pair, at))]
        self._solve(shares, at)
        motion = [pair for pair in motion if pair not in shares]
        motion += [pair for pair in rest if pair[0][0] == "name" and "lambda_" in pair[0][1]]
        self._solve(motion, at)
        assert not self._assigned([x for x in rest if x not in (*shares, *motion)], at)
        for name in state:
            at[f"der({name})"] = self._value(at[f"der({name})"], at)
        return at

    def _assigned(self, rest: list[Tree], at: Values) -> list[Tree]:
        """Assign the variables whose equations have no other unknown one; return what is left."""
        while True:
            left = []
            for target, value in rest:
                if target[0] == "name" and not self._unknown(value, at):
                    at[target[1]] = self._value(value, at)
                else:
                    left.append((target, value))
            if len(left) == len(rest):
                return left
            rest = left

    def _unknown(self, e: Tree, at: Values) -> set[str]:
        """Return the variables of an expression that have no value yet."""
        if not isinstance(e, tuple | list):
            return set()
        if len(e) == 2 and e[0] == "name":
            return set() if e[1] in at else {e[1]}
        return set().union(*(self._unknown(x, at) for x in e))

    def _solve(self, equations: Sequence[Tree], at: Values) -> None:
        names = sorted(set().union(*(self._unknown(pair, at) for pair in equations)))
        assert len(names) == len(equations), names

        def residual(values: Sequence[float]) -> np.ndarray:
            own = {**at, **dict(zip(names, values, strict=True))}
            return np.array([self._value(x, own) - self._value(y, own) for x, y in equations])

        none = np.zeros(len(names))
        start = residual(none)
        columns = [residual(unit) - start for unit in np.eye(len(names))]
        matrix = np.array(columns).T.reshape(len(names), len(names))
        found = np.linalg.solve(matrix, -start)
        found -= np.linalg.solve(matrix, residual(found))
        at |= dict(zip(names, found.tolist(), strict=True))


def _tokens(text: str) -> list[tuple[str | None, str]]:
    found: list[tuple[str | None, str]] = []
    at, text = 0, text.rstrip()
    while at < len(text):
        match = _TOKEN.match(text, at)
        assert match, text[at : at + 60]
        found.append((match.lastgroup, match[match.lastgroup]))
        at = match.end()
    return [*found, (None, "")]
