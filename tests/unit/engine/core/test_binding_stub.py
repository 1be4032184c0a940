"""binding.pyi, which types are checked against, states what the binding holds."""

from __future__ import annotations

import ast
import inspect
import re
from pathlib import Path
from typing import Any

import pytest

from lagcli.engine.core import binding

FOLDER = Path(binding.__file__).parent
STUB = ast.parse((FOLDER / "binding.pyi").read_text(encoding="utf-8"))
SOURCE = "\n".join(
    (FOLDER / name).read_text("utf-8")
    for name in ("binding.pyx", "batch.pxi", "contact.pxi", "roots.pxi", "switching.pxi")
)

#: name → default, None without one
Parameters = dict[str, Any]


def in_stub(node: ast.FunctionDef) -> Parameters:
    given = [a.arg for a in node.args.args]
    defaults = [ast.literal_eval(d) for d in node.args.defaults]
    return dict(zip(given, [None] * (len(given) - len(defaults)) + defaults, strict=True))


def in_module(function: Any) -> Parameters:
    parameters = inspect.signature(function).parameters.values()
    return {p.name: None if p.default is p.empty else p.default for p in parameters}


def in_source(kind: str, method: str) -> Parameters:
    """Read from the source the parameters of special methods: the module does not give them."""
    body = re.split(rf"^cdef class {kind}\b", SOURCE, flags=re.M)[1]
    found = re.search(rf"    def {method}\((.*?)\):", body, re.S)
    assert found, (kind, method)
    out: Parameters = {}
    for parameter in found[1].split(","):
        name, _, default = parameter.partition("=")
        if name.strip() and not name.strip().startswith("*"):
            out[name.split()[-1]] = ast.literal_eval(default) if default else None
    return out


def public(space: Any) -> set[str]:
    """Return the names that the binding itself defines."""
    return {
        name
        for name, value in vars(space).items()
        if not name.startswith("_")
        and not inspect.ismodule(value)
        and getattr(value, "__module__", binding.__name__) == binding.__name__
    }


def defined(nodes: list[ast.stmt]) -> dict[str, ast.stmt]:
    out: dict[str, ast.stmt] = {}
    for node in nodes:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            out[node.name] = node
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            out[node.target.id] = node
    return out


CLASSES = {n.name: n for n in STUB.body if isinstance(n, ast.ClassDef)}


def test_names() -> None:
    assert set(defined(STUB.body)) == public(binding)


def test_functions() -> None:
    functions = [n for n in STUB.body if isinstance(n, ast.FunctionDef)]
    for node in functions:
        assert in_stub(node) == in_module(getattr(binding, node.name)), node.name


@pytest.mark.parametrize("name", CLASSES)
def test_classes(name: str) -> None:
    kind, members = getattr(binding, name), defined(CLASSES[name].body)
    assert {m for m in members if not m.startswith("_")} == public(kind)
    for member, node in members.items():
        assert isinstance(node, ast.FunctionDef)
        if node.decorator_list:
            assert inspect.isdatadescriptor(vars(kind)[member]), member
        elif member.startswith("__"):
            assert in_stub(node) == in_source(name, member), member
        else:
            assert in_stub(node) == in_module(vars(kind)[member]), member
