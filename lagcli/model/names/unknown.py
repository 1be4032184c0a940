"""Errors for undeclared names, with suggestions."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from lagcli.functions import FUNCTIONS
from lagcli.model.diagnostics import Broken
from lagcli.model.expression.tokens import ExpressionError, error_at, is_name
from lagcli.model.expression.trees import Name, as_written
from lagcli.model.names.members import format_members, members_clause
from lagcli.model.names.namespace import Allowed, Namespace
from lagcli.model.spelling import did_you_mean, nearest

if TYPE_CHECKING:
    from lagcli.model.names.scope import Scope

_CONSTANTS = {
    "dt": "a time derivative is written with primes: `x'`",
    "e": "e^x is written `exp(x)`, e itself `exp(1)`",
    "E": "e^x is written `exp(x)`, e itself `exp(1)`",
    "Pi": "the constant is `pi`",
    "PI": "the constant is `pi`",
    "π": "the constant is `pi`",
}


def unknown(scope: Scope, name: Name) -> ExpressionError:
    """Return the error for an undeclared name, with similar names.

    Raises
    ------
    Broken
        A malformed declaration may have been meant to declare it.
    """
    names, text = scope.names, name.text
    base = text.partition("[")[0]
    if names.incomplete or base in names.suspects:
        raise Broken
    if text != base and (names.declared(base) or base in ("t", "pi")):
        what = names.lines.get(base, ("name", 0))[0]
        return error_at(
            "not-a-family",
            f"{scope.where} uses a member of `{base}`, but `{base}` is a single {what}",
            name,
            f"write `{base}` without an index, or declare a family, as in `{base}[1..3]`",
            base,
        )
    if text == base and f"{text}[]" in names.families:
        members = names.members(base)
        which = f": {members_clause(base, members)}" if members else ""
        return error_at(
            "a-family",
            f"{scope.where} uses `{text}`, which is a family{which}",
            name,
            f"name a member, as in `{members[0] if members else base + '[1]'}`",
            text,
        )
    return error_at(
        "unknown-name",
        f"{scope.where} uses `{as_written(name)}`, which is not declared",
        name,
        _help(scope, name, base),
        text,
    )


def unknown_index(scope: Scope, name: Name) -> ExpressionError:
    """Return the error for an undeclared name in an index or a range.

    Raises
    ------
    Broken
        A malformed declaration may have been meant to declare it.
    """
    names = scope.names
    if names.incomplete or name.text in names.suspects:
        raise Broken
    close = _close(names, Allowed.PARAMETERS, name.text)
    index = name.text if is_name(name.text) else "i"
    return error_at(
        "unknown-name",
        f"{scope.where} uses `{as_written(name)}` in an index, which is not declared",
        name,
        did_you_mean(close)
        or f"declare the index in the name of the entry, as in `name[{index} = 1..N]: …`, or"
        f" in a sum, `sum(…, {index} = 1..N)`",
        f"index {name.text}",
    )


def _help(scope: Scope, name: Name, base: str) -> str | None:
    text = name.text
    if text == "lambda":
        return "name the constraint: `lambda.NAME`"
    if text in FUNCTIONS:
        return f"`{text}` is a function: write `{text}(x)`"
    if text.lower() in ("inf", "nan", "infinity"):
        return "numbers are finite"
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    motion = scope.allowed >= Allowed.MOTION
    if motion and (velocity := meant_derivative(scope.names, as_written(name))):
        return f"a time derivative is written with primes: `{velocity}`"
    if close := _close(scope.names, scope.allowed, text):
        return did_you_mean(close)
    if text != base:
        return f"declare the family, for instance under `coordinates`: `{base}[1..3]`"
    if name.primes or not motion:
        block = "coordinates" if name.primes else "parameters"
        return f"declare it under `{block}`"
    return f"declare it, for instance under `parameters`: `{text}: 1`"


def meant_derivative(names: Namespace, text: str) -> str | None:
    """Return ``x'`` for ``xdot`` and ``x''`` for ``xddot`` if x is a coordinate or definition."""
    base, bracket, index = text.partition("[")
    for suffix, primes in (("ddot", "''"), ("dot", "'")):
        stem = base.removesuffix(suffix)
        if stem != base and (names.declared(stem) or f"{stem}[]" in names.families):
            return f"{stem}{bracket}{index}{primes}"
    if base.startswith("d") and names.declared(base[1:]):  # of dx/dt
        return f"{base[1:]}'"
    return None


def _close(names: Namespace, allowed: Allowed, text: str) -> list[str]:
    """Return the most similar of the allowed names, with their kinds."""
    tables: list[tuple[Collection[str], str]] = [(names.parameters, "parameter")]
    if allowed >= Allowed.MOTION:
        tables += [
            (names.coordinates, "coordinate"),
            (names.definitions, "definition"),
            (names.inputs, "input"),
        ]
    known: list[str] = []
    for table, kind in tables:
        known += [k for k in table if not k.endswith("]")]
        known += [k for k, kinds in names.families.items() if kind in kinds]
    shown = []
    for other in nearest(text, known):
        what, line = names.lines.get(other, ("", 0))
        location = f", line {line}" if line else ""
        label = _shown(other)
        shown.append(f"`{label}` ({what}{location})" if what else f"`{label}`")
    return shown


def _shown(text: str) -> str:
    return text.replace("[]", "[i]")


def unknown_part(scope: Scope, name: Name, used: tuple[str, str], what: str) -> ExpressionError:
    """Return the error for a dotted name whose constraint or coordinate is not declared.

    Parameters
    ----------
    scope, name : Scope, Name
    used : two of str
        The whole name, and its unknown part.
    what : str
        "constraint" or "coordinate".

    Raises
    ------
    Broken
        A malformed declaration may have been meant to declare it.
    """
    names, (text, part) = scope.names, used
    text = as_written(name) if "[]" in text else text
    base = part.partition("[")[0]
    if base in names.suspects or names.incomplete or f"{base}[]" in names.broken:
        raise Broken
    if what == "constraint" and names.may_be_constraint(part):
        raise Broken
    known = list(names.constraints if what == "constraint" else names.coordinates)
    members = [k for k in known if k.startswith(f"{base}[")]
    close = nearest(_shown(part), known) or known[:3]
    help_ = f"the members are {format_members(base, members)}" if members else did_you_mean(close)
    return error_at(
        "unknown-name",
        f"{scope.where} uses `{text}`{scope.at()}, but there is no {what} `{_shown(part)}`",
        name,
        help_ or f"the model has no {what}s",
    )
