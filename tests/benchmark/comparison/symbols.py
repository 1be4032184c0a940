"""A case's equations in SymPy: input of the programs without computer algebra."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from types import SimpleNamespace
from typing import Any

from comparison.cases import Case
from comparison.kinetics import Kinetics, derive


class SymbolicCase:
    """A case in SymPy's symbols.

    Attributes
    ----------
    q, v : lists of Symbol
    """

    def __init__(self, case: Case):
        import sympy as sp

        self.case = case
        count = range(len(case.start.q))
        self.q = [sp.Symbol(f"q{i}", real=True) for i in count]
        self.v = [sp.Symbol(f"v{i}", real=True) for i in count]
        index = {x: i for i, x in enumerate(self.q)}
        self.algebra = SimpleNamespace(
            sin=sp.sin,
            cos=sp.cos,
            sqrt=sp.sqrt,
            diff=lambda x, s: sp.sympify(x).diff(s),
            variables=lambda x: sorted(index[s] for s in sp.sympify(x).free_symbols if s in index),
            is_zero=lambda x: x == 0,
        )

    @cached_property
    def kinetics(self) -> Kinetics:
        """M, f, B and γ."""
        geometry = self.case.geometry(self.algebra, self.q, self.case.start.parameters)
        return derive(self.algebra, geometry, self.q, self.v)

    @property
    def states(self) -> list[Any]:
        """q and v."""
        return [*self.q, *self.v]


def c_source(name: str, arrays: dict[str, Sequence[Any]], results: dict[str, Sequence[Any]]) -> str:
    """Return C code of a function that fills arrays with expressions, as SymPy prints them.

    Parameters
    ----------
    name : str
        Of the function; its arguments are the names of ``arrays``, then those of ``results``.
    arrays : dict
        Name → symbols that stand for the array's entries.
    results : dict
        Name → expressions; common subexpressions are shared between all.
    """
    import sympy as sp

    flat = [sp.sympify(x) for values in results.values() for x in values]
    shared, reduced = sp.cse(flat, symbols=sp.numbered_symbols("w"))
    arguments = [*(f"const double *{x}" for x in arrays), *(f"double *{x}" for x in results)]
    lines = ["#include <math.h>", f"void {name}({', '.join(arguments)}) {{"]
    needed = set().union(*(x.free_symbols for x in flat))
    for array, symbols in arrays.items():
        lines += [f"double {s} = {array}[{i}];" for i, s in enumerate(symbols) if s in needed]
    lines += [f"double {s} = {sp.ccode(x)};" for s, x in shared]
    rest = iter(reduced)
    for result, values in results.items():
        lines += [f"{result}[{i}] = {sp.ccode(next(rest))};" for i in range(len(values))]
    return "\n".join([*lines, "}"]) + "\n"
