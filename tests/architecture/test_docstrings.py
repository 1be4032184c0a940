"""Docstrings name what exists: parameters, attributes, and files."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from inspect import cleandoc
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULES = sorted((ROOT / "lagcli").rglob("*.py"))
TEXTS = {path: path.read_text() for path in MODULES}
Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


def documented(docstring: str, section: str) -> list[str]:
    """Return the names that a numpydoc section describes."""
    found = re.search(rf"^{section}\n-+\n(.*?)(?=^\w[\w ]*\n-+$|\Z)", docstring, re.M | re.S)
    lines = found[1].splitlines() if found else []
    # a list of names may go on in the next line
    heads = re.sub(r",\n", ", ", "\n".join(x for x in lines if x and not x[0].isspace()))
    names = ",".join(line.partition(" : ")[0] for line in heads.splitlines()).split(",")
    return [name.strip().lstrip("*") for name in names if name.strip()]


def parameters(node: Definition) -> set[str]:
    """Return the parameters of a function, or of the construction and the calls of a class."""
    if isinstance(node, ast.ClassDef):
        fields = {
            x.target.id
            for x in node.body
            if isinstance(x, ast.AnnAssign) and isinstance(x.target, ast.Name)
        }
        methods = (x for x in node.body if isinstance(x, ast.FunctionDef))
        called = [x for x in methods if x.name in ("__init__", "__new__", "__call__")]
        return fields.union(*map(parameters, called))
    a = node.args
    return {x.arg for x in [*a.posonlyargs, *a.args, *a.kwonlyargs, a.vararg, a.kwarg] if x}


def within(tree: ast.AST) -> list[Definition]:
    return [x for x in ast.walk(tree) if isinstance(x, Definition)]


@cache
def definitions() -> dict[Path, list[Definition]]:
    """Return the functions and classes of each module."""
    return {path: within(ast.parse(text)) for path, text in TEXTS.items()}


@cache
def classes() -> dict[str, ast.ClassDef]:
    every = (x for nodes in definitions().values() for x in nodes)
    return {x.name: x for x in every if isinstance(x, ast.ClassDef)}


def family(node: ast.ClassDef) -> Iterator[ast.ClassDef]:
    """Yield a class of the package and its base classes."""
    yield node
    for base in node.bases:
        name = base.id if isinstance(base, ast.Name) else ""
        if name in classes():
            yield from family(classes()[name])


def names_of(node: ast.ClassDef) -> set[str]:
    """Return what a class and its base classes define, and the attributes that they use."""
    own = [x for x in ast.walk(node) if x is not node]
    return (
        {x.attr for x in own if isinstance(x, ast.Attribute)}
        | {x.id for x in own if isinstance(x, ast.Name)}
        | {x.name for x in own if isinstance(x, ast.FunctionDef)}
    )


def stale(nodes: list[Definition]) -> list[str]:
    """Return what docstrings describe and the code lacks, and parameters that sections omit."""
    wrong = []
    for node in nodes:
        text = ast.get_docstring(node, clean=False) or ""
        if "Parameters" not in text and "Attributes" not in text:
            continue
        text = cleandoc(text)
        lineage = list(family(node)) if isinstance(node, ast.ClassDef) else []
        known = parameters(node).union(*map(parameters, lineage))
        described = documented(text, "Parameters")
        wrong += [f"{node.name}: {x}" for x in described if x not in known]
        if described and not lineage:
            omitted = known.difference(described, ("self", "cls"))
            wrong += [f"{node.name}: {x} is omitted" for x in sorted(omitted)]
        attributes = documented(text, "Attributes")
        known = known.union(*map(names_of, lineage if attributes else []))
        wrong += [f"{node.name}: {x}" for x in attributes if x not in known]
    return wrong


def test_documented_parameters_exist_and_are_all() -> None:
    wrong = {str(path.relative_to(ROOT)): stale(x) for path, x in definitions().items()}
    assert {path: names for path, names in wrong.items() if names} == {}


@pytest.mark.parametrize(
    ("code", "names"),
    [
        ("def f(a):\n '''F.\n\n Parameters\n ----------\n a, b : int\n '''", ["f: b"]),
        ("def f(a, *b, c=1, **d):\n '''F.\n\n Parameters\n ----------\n a,\n *b, c, **d\n '''", []),
        ("def f(a, b):\n '''F.\n\n Parameters\n ----------\n a : int\n '''", ["f: b is omitted"]),
        ("class A:\n '''A.\n\n Attributes\n ----------\n x : int\n '''\n y: int", ["A: x"]),
        ("class A:\n '''A.\n\n Parameters\n ----------\n x : int\n '''\n x: int", []),
    ],
)
def test_stale_names_are_found(code: str, names: list[str]) -> None:
    assert stale(within(ast.parse(code))) == names


#: Files with a folder; in C, also those of the core without one.
ENDINGS = "py|c|h|js|yaml"
IN_PYTHON = re.compile(rf"(?<![\w./{{<*-])(?:[\w-]+/)+[\w-]+\.(?:{ENDINGS})\b")
IN_C = re.compile(r"(?<![\w./{<*-])(?:[\w-]+/)*[\w-]+\.(?:py|c)\b")
#: Headers that the build writes.
GENERATED = {"tables.h", "layout.h", "settings.h"}


def docstrings(path: Path) -> str:
    """Return the docstrings of a module, whose other texts may name files that it writes."""
    nodes = [
        x for x in ast.walk(ast.parse(path.read_text())) if isinstance(x, Definition | ast.Module)
    ]
    return "\n".join(ast.get_docstring(x) or "" for x in nodes)


def test_files_in_comments_and_recipes_exist() -> None:
    core = [*(ROOT / "lagcli").rglob("*.[ch]")]
    scripts = [x for x in (ROOT / "lagcli").rglob("*.js") if "vendor" not in x.parts]
    tests = [*(ROOT / "tests").rglob("*.py")]
    models = [x for folder in ("models", "tests") for x in (ROOT / folder).rglob("*.yaml")]
    others = [*tests, *models, *(ROOT / "docs").rglob("*.py")]
    files = [f"/{x.relative_to(ROOT)}" for x in [*MODULES, *core, *scripts, *others]]
    recipes = ROOT / "CONTRIBUTING.md"
    texts = {**TEXTS, **{path: path.read_text() for path in [*scripts, recipes]}}
    texts |= {path: docstrings(path) for path in tests if IN_PYTHON.search(path.read_text())}
    named = {(path, x) for path, text in texts.items() for x in IN_PYTHON.findall(text)}
    named |= {(path, x) for path in core for x in IN_C.findall(path.read_text())}
    wrong = [
        f"{path.relative_to(ROOT)}: {name}"
        for path, name in named
        if Path(name).name not in GENERATED and not any(x.endswith("/" + name) for x in files)
    ]
    assert wrong == []
