"""Functions of a model: ``f(x): …``, expanded where they are used."""

from __future__ import annotations

import re

from lagcli.model.draft import Draft
from lagcli.model.expression.building import name_errors
from lagcli.model.expression.calls import TENSOR_FUNCTIONS
from lagcli.model.expression.functions import FUNCTIONS
from lagcli.model.expression.grammar import KEYWORDS
from lagcli.model.expression.tokens import is_name
from lagcli.model.expression.trees import Name
from lagcli.model.names.expansion import MACROS, Macro, expand
from lagcli.model.names.families import Declaration, valid_name
from lagcli.model.names.scope import ModelScope
from lagcli.model.spelling import shorten
from lagcli.model.symbols import Context
from lagcli.model.yaml.source import Scalar

_KEY = r"\s*([^\s(]+)\s*\(([^()]*)\)\s*"
_RESERVED = {*FUNCTIONS, *TENSOR_FUNCTIONS, *MACROS, *KEYWORDS, "sum"}


def read_functions(draft: Draft) -> list[Declaration]:
    """Return the declarations of the functions, and enter them into the draft's names."""
    found: list[Declaration] = []
    functions: dict[str, Macro] = {}
    for _, key, node in draft.entries("functions") or []:
        head = _head(draft, key)
        if head is None:
            continue
        name, arguments = head
        if name in functions:
            first = next(d for d in found if d.name == name)
            draft.report.add(
                "duplicate-name",
                f"the function `{name}` is declared twice",
                key.location,
                "rename one of the two",
                (("the first one is here", first.key.location),),
            )
            continue
        parsed = draft.parse_alone(node, f"the function `{name}`")
        functions[name] = Macro(arguments, None if parsed is None else parsed.tree)
        found.append(Declaration(name, key, node if parsed is None else parsed.node))
    draft.names.functions = functions
    return found


def _head(draft: Draft, key: Scalar) -> tuple[str, tuple[str, ...]] | None:
    """Return name and arguments of a function; report an invalid key."""
    match = re.fullmatch(_KEY, key.value)
    if match is None:
        draft.report.add(
            "bad-name",
            f"`{shorten(key.value)}` is not a function with its arguments",
            key.location,
            "write `f(x): x^2`, or `f(x, y): …`; a name without arguments belongs under"
            " `definitions`",
        )
        return None
    name, arguments = match[1], tuple(x.strip() for x in match[2].split(","))
    if name in _RESERVED:
        draft.report.add(
            "reserved-name",
            f"`{name}` cannot be the name of a function: it is built in",
            key.location,
            "choose another name",
        )
        return None
    if not valid_name(draft, name, key, "function"):
        return None
    for argument in arguments:
        if not is_name(argument) or argument in (*KEYWORDS, "t", "pi"):
            draft.report.add(
                "bad-name",
                f"`{shorten(argument)}` cannot be an argument of the function `{name}`",
                key.location,
                "an argument is a name: a letter followed by letters, digits and _",
            )
            return None
    if len(set(arguments)) < len(arguments):
        draft.report.add(
            "duplicate-name",
            f"the function `{name}` has two arguments of the same name",
            key.location,
            "rename one of the two",
        )
        return None
    return name, arguments


def check_functions(draft: Draft, declared: list[Declaration]) -> None:
    """Report unknown names in the expressions of functions, and functions that call themselves."""
    functions = dict(draft.names.functions)
    for d in declared:
        macro = functions[d.name]
        good = False
        assert isinstance(d.node, Scalar) or macro.tree is None
        if macro.tree is not None:
            with draft.report.expression(d.node):
                tree = expand(macro.tree, draft.names, (d.name,))
                errors, broken = name_errors(tree, _FunctionScope(draft, d.name, macro))
                for error in errors:
                    draft.report.add_expression_error(error, d.node)
                good = not (errors or broken)
        if not good:
            draft.names.functions = {
                **draft.names.functions,
                d.name: macro._replace(tree=None),
            }


class _FunctionScope(ModelScope):
    """Scope of a function's expression, in which its arguments may have any value."""

    def __init__(self, draft: Draft, name: str, macro: Macro):
        context = Context(f"the function `{name}`", accelerations=True, multipliers=True)
        super().__init__(draft.names, context, macro.arguments)

    def check(self, name: Name) -> None:
        """Check a name that is not an argument."""
        if re.split(r"[.\[]", name.text)[0] in self.bound:
            for index in name.indices:
                self.check_index(index)
            return
        super().check(name)
