"""The architecture, read from the source: who imports whom, what is imported when, and sizes."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from patience import PATIENCE

from lagcli.cli.app import COMMANDS

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "lagcli"
FILES = sorted(PACKAGE.rglob("*.py"))
MODULES = {".".join(f.relative_to(ROOT).with_suffix("").parts): f for f in FILES}

#: The rules that the documentation states: what each package may import of lagcli, beside itself.
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
TABLE = PAGE[PAGE.index("| package | may import |") :]
PACKAGES = {
    own: set(re.findall(r"`(\w+)`", known))
    for own, known in re.findall(r"^\| `(\w+)` \| ([^|]*) \|", TABLE, re.MULTILINE)
    if own != "cli"
}

#: Packages that a package must not import, not even inside a function.
FOREIGN = {
    "version": {"numpy", "scipy", "symengine", "sympy", "yaml", "h5py", "rich"},
    "errors": {"numpy", "scipy", "symengine", "sympy", "yaml", "h5py", "rich"},
    "files": {"numpy", "scipy", "symengine", "sympy", "yaml", "h5py", "rich"},
    "settings": {"numpy", "scipy", "symengine", "sympy", "yaml", "h5py", "rich"},
    "functions": {"numpy", "scipy", "symengine", "sympy", "yaml", "h5py", "rich"},
    "prose": {"numpy", "scipy", "symengine", "sympy", "yaml", "h5py", "rich"},
    "sparse_table": {"scipy", "symengine", "sympy", "yaml", "h5py", "rich"},
    "arrays": {"scipy", "symengine", "sympy", "yaml", "h5py", "rich"},
    "json_schema": {"numpy", "scipy", "symengine", "sympy", "yaml", "h5py", "rich"},
    "json_values": {"numpy", "scipy", "symengine", "sympy", "yaml", "h5py", "rich"},
    "columns": {"numpy", "scipy", "symengine", "sympy", "yaml", "h5py", "rich"},
    "column_units": {"numpy", "scipy", "symengine", "sympy", "yaml", "h5py", "rich"},
    "model": {"numpy", "scipy", "sympy", "h5py", "rich"},
    "equations": {"numpy", "scipy", "h5py", "yaml", "rich"},
    "engine": {"yaml", "sympy", "h5py", "rich", "os", "pathlib", "io"},
    "trajectory": {"scipy", "symengine", "sympy", "yaml", "h5py", "rich"},
    "simulations": {"yaml", "sympy", "h5py", "rich", "scipy"},
    "results": {"scipy", "symengine", "sympy", "yaml"},
    "sweeps": {"yaml", "sympy", "rich"},
    "analysis": {"yaml", "rich", "matplotlib"},
    "export": {"yaml", "scipy", "sympy", "symengine", "h5py", "rich", "matplotlib"},
    "pictures": {"yaml", "sympy", "scipy", "h5py", "rich"},
    "play": {"yaml", "sympy", "h5py", "rich", "scipy", "symengine"},
    "live": {"yaml", "sympy", "scipy", "h5py", "rich", "matplotlib"},
}

#: What finds the core's library and its sources: of the engine, only this knows of files.
LOADERS = {"lagcli.engine.core.fingerprint", "lagcli.engine.core.library"}

#: The modules of the engine that know symbols: a System can be written by hand for the others.
SYMBOLIC = {
    f"lagcli.engine.lowering.{name}"
    for name in ("compiler", "lower", "right_sides", "switching", "tangent")
}

#: What reads the command line, with what it imports itself. Other releases of Typer than those that
#: pyproject.toml allows import Pydantic (0.29) or Click, whose release is another, or Rich (0.16).
OF_COMMAND_LINE = {"typer", "shellingham", "annotated_doc"}

#: What `lagcli simulate` may import from outside the standard library.
OF_SIMULATE = {"numpy", "symengine", "yaml", *OF_COMMAND_LINE}
OF_SIMULATE |= {"backports_abc"}  # for which modules by early versions of Cython look

#: What a plain run has no use for: what only errors, inputs, contacts, vectors or other units need.
NOT_OF_PLAIN_RUNS = {
    *("lagcli.engine.event_entries", "lagcli.engine.tape.series_operations"),
    *("lagcli.engine.taylor.series_nodes", "lagcli.equations.symmetry.conserved"),
    "lagcli.engine.tape.differentiation",
    *("lagcli.model.expression.unit_table", "lagcli.results.csv.reader"),
    *("lagcli.results.csv.event_table", "lagcli.results.csv.sidecar"),
    *("lagcli.engine.core.contact_problem", "lagcli.engine.switching.switching"),
    "lagcli.engine.switching.stops",
    *("lagcli.model.expression.syntax_hints", "lagcli.model.dimensions.reporting"),
    *("lagcli.model.locations", "lagcli.model.names.unknown", "lagcli.model.sections.fit"),
    *("lagcli.model.sections.events", "lagcli.model.sections.inputs"),
    *("lagcli.results.hdf5.inputs", "lagcli.results.hdf5.opening", "lagcli.simulations.contacts"),
    *("lagcli.simulations.inputs", "numpy.ma", "numpy.random", "numpy.typing", "random"),
    *("rich", "scipy", "sympy"),
}

#: Packages that cost start-up time, and the packages that may import them at the top of a module.
HEAVY = {
    "sympy": set(),
    "matplotlib": set(),
    "PIL": set(),
    "pandas": set(),
    "dask": set(),
    "distributed": set(),
    "rich": set(),
    "h5py": set(),
    "scipy": {"engine"},
    "numpy": {
        *("arrays", "sparse_table", "engine", "trajectory", "simulations", "results"),
        *("sweeps", "pictures", "analysis", "export", "play", "cli"),
    },
    "symengine": {
        *("model", "equations", "engine", "simulations", "live", "pictures", "sweeps", "analysis"),
    },
}
#: Packages whose modules beside the folders count as one folder in the search for cycles.
WITH_TOP = {"analysis", "cli", "engine", "pictures", "play", "simulations"}
#: Modules of HDF5 files, themselves imported where they are used.
OF_HDF5 = ("lagcli.results.hdf5", "lagcli.sweeps.file.store", "lagcli.analysis.fit.file")


def folder_of(module: str) -> str:
    return module.rpartition(".")[0]


def package_of(module: str) -> str:
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else "lagcli"


@cache
def tree(module: str) -> ast.Module:
    return ast.parse(MODULES[module].read_text(encoding="utf-8"))


@cache
def imports(module: str, *, at_top: bool = False) -> tuple[str, ...]:
    """Return the full names of what a module imports at run time."""

    def visit(node: ast.AST) -> Iterator[str]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test):
                continue
            if at_top and isinstance(child, (ast.FunctionDef, ast.Lambda)):
                continue
            if isinstance(child, ast.Import):
                yield from (alias.name for alias in child.names)
            elif isinstance(child, ast.ImportFrom):
                assert child.level == 0, f"{module} has a relative import"
                assert child.module
                for alias in child.names:
                    full = f"{child.module}.{alias.name}"
                    yield full if full in MODULES or f"{full}.__init__" in MODULES else child.module
            yield from visit(child)

    return tuple(visit(tree(module)))


def test_packages_are_known() -> None:
    found = {package_of(m) for m in MODULES} - {"__init__", "__main__", "cli"}
    assert found == set(PACKAGES), "docs/architecture.md says whom a new package may import"


def test_who_imports_whom() -> None:
    def forbidden(own: str, name: str) -> bool:
        top = name.split(".")[0]
        return (
            package_of(name) not in {own, *PACKAGES[own]}
            if top == "lagcli"
            else top in FOREIGN[own]
        )

    assert [
        f"{module} imports {name}"
        for module in MODULES
        if package_of(module) in PACKAGES and module not in LOADERS
        for name in imports(module)
        if forbidden(package_of(module), name)
    ] == []


def cycles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Return the strongly connected parts of a graph that have more than one node."""
    found: list[list[str]] = []
    number: dict[str, int] = {}
    lowest: dict[str, int] = {}
    path: list[str] = []

    def visit(node: str) -> None:
        number[node] = lowest[node] = len(number)
        path.append(node)
        for other in graph[node]:
            if other not in number:
                visit(other)
            if other in path:
                lowest[node] = min(lowest[node], lowest[other])
        if lowest[node] == number[node]:
            part = path[path.index(node) :]
            del path[path.index(node) :]
            if len(part) > 1:
                found.append(part)

    for node in graph:
        if node not in number:
            visit(node)
    return found


def test_cycles_are_found() -> None:
    graph = {"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}
    assert [sorted(part) for part in cycles(graph)] == [["b", "c"]]


def test_no_module_imports_itself_by_way_of_others() -> None:
    named = {m.removesuffix(".__init__"): m for m in MODULES}
    graph = {m: {named[n] for n in imports(m) if n in named} - {m} for m in MODULES}
    assert cycles(graph) == []


def test_no_package_imports_itself_by_way_of_others() -> None:
    graph = {own: set(known) for own, known in PACKAGES.items()}
    assert cycles(graph) == []


@pytest.mark.parametrize(
    "above", sorted({"model", "equations", "engine", "sweeps", "results", *WITH_TOP})
)
def test_no_folder_of_a_package_imports_itself_by_way_of_others(above: str) -> None:
    inside = {f for f in map(folder_of, MODULES) if f"{f}.".startswith(f"lagcli.{above}.")}
    if above not in WITH_TOP:
        inside -= {f"lagcli.{above}"}
    graph: dict[str, set[str]] = {folder: set() for folder in inside}
    for module in MODULES:
        if (folder := folder_of(module)) in inside:
            named = (n if n in MODULES else f"{n}.__init__" for n in imports(module))
            graph[folder] |= inside.intersection(map(folder_of, named)) - {folder}
    assert cycles(graph) == []


def test_no_class_name_occurs_twice() -> None:
    places: dict[str, list[str]] = {}
    for module in MODULES:
        for node in ast.walk(tree(module)):
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name, []).append(module)
    assert {name: where for name, where in places.items() if len(where) > 1} == {}


def test_nothing_imports_the_command_line() -> None:
    for module in MODULES:
        if package_of(module) != "cli" and module != "lagcli.__main__":
            assert not any(n.startswith("lagcli.cli") for n in imports(module)), module


def test_nothing_imports_the_package_itself() -> None:
    # its __init__ imports every package, so that an import of it is an import of everything
    assert [module for module in MODULES if "lagcli" in imports(module)] == []


def test_version_is_stated_once() -> None:
    from lagcli.version import __version__

    stated = re.compile(rf"""['"]{re.escape(__version__)}['"]""")
    files = [*FILES, ROOT / "pyproject.toml", ROOT / "setup.py"]
    assert [f.name for f in files if stated.search(f.read_text(encoding="utf-8"))] == ["version.py"]


def test_engine_uses_symbols_only_where_equations_are_lowered() -> None:
    assert [
        f"{module} imports {name}"
        for module in MODULES
        if package_of(module) == "engine" and module not in SYMBOLIC
        for name in imports(module)
        if name.startswith(("symengine", "lagcli.equations", "lagcli.model"))
    ] == []


def test_files_are_opened_by_the_loader_the_results_and_the_command_line_alone() -> None:
    for module in MODULES:
        if package_of(module) in ("engine", "equations", "simulations", "trajectory", "settings"):
            for node in ast.walk(tree(module)):
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                    assert node.func.id != "open", f"{module}:{node.lineno}"


def test_heavy_packages_are_imported_where_they_are_used() -> None:
    def allowed(module: str, top: str) -> bool:
        return (
            top not in HEAVY
            or package_of(module) in HEAVY[top]
            or (top == "h5py" and module.startswith(OF_HDF5))
            # a renderer that prints by SymPy is itself imported inside the function that renders
            or module.startswith("lagcli.equations.render")
        )

    assert [
        f"{module} imports {name} at its top"
        for module in MODULES
        for name in imports(module, at_top=True)
        if not allowed(module, name.split(".")[0])
    ] == []


def executions(module: str) -> Iterator[str]:
    """Yield where a module calls what executes text, or imports what loads any object."""
    executing = {"eval", "exec", "sympify", "lambdify", "S", "parse_expr", "__import__"}
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.Call):
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            if name in executing or (isinstance(node.func, ast.Name) and name == "compile"):
                yield f"{module}:{node.lineno} calls {name}"
    for name in imports(module):
        if name.split(".")[0] in {"pickle", "marshal", "shelve", "dill"}:
            yield f"{module} imports {name}"


def test_executions_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), "tree", lambda module: ast.parse("import pickle\neval('1')\n"))
    assert list(executions("a")) == ["a:2 calls eval", "a imports pickle"]


def test_text_is_never_executed() -> None:
    assert [place for module in MODULES for place in executions(module)] == []


def test_no_module_is_named_after_nothing() -> None:
    for module in MODULES:
        last = module.removesuffix(".__init__").split(".")[-1]
        assert last not in {"utils", "util", "helpers", "helper", "common", "misc", "tools"}, module


def undocumented(name: str, node: ast.Module | ast.ClassDef | ast.FunctionDef) -> Iterator[str]:
    """Yield the public names without a docstring, in a module or a class; nothing in functions."""
    if not ast.get_docstring(node):
        yield name
    if not isinstance(node, ast.FunctionDef):
        for inner in node.body:
            if isinstance(inner, (ast.FunctionDef, ast.ClassDef)) and inner.name[0] != "_":
                yield from undocumented(f"{name}.{inner.name}", inner)


def test_public_names_have_docstrings() -> None:
    assert [name for module in MODULES for name in undocumented(module, tree(module))] == []


def test_types_of_arrays_are_named_once() -> None:
    defined = [
        module
        for module, path in MODULES.items()
        if re.search(
            r"^(Array|Flags|Indices|Numbers)\b.*= (NDArray|np.ndarray)",
            path.read_text("utf-8"),
            re.M,
        )
    ]
    assert defined == ["lagcli.arrays"]


# the package


def test_every_folder_is_a_package() -> None:
    for file in FILES:
        assert (file.parent / "__init__.py").exists(), file.parent


def test_package_holds_its_data() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    declared = settings["setuptools"].get("package-data", {})
    patterns = [p for values in declared.values() for p in values]
    for file in PACKAGE.rglob("*"):
        compiled = {".c", ".h", ".so", ".sources"}  # what the library is made of, and it
        if file.is_file() and file.suffix not in {".py", ".pyc", *compiled}:
            inside = file.relative_to(PACKAGE)
            assert any(inside.match(p) for p in patterns), f"{inside} would not be installed"


def test_dependencies_are_declared() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    used_by = ("pictures", "cluster", "notebook")
    every = [*project["dependencies"], *(d for extra in used_by for d in extras[extra])]
    declared = {re.split(r"[<>=\[; ]", d)[0].lower() for d in every}
    named = {"yaml": "pyyaml", "PIL": "pillow", "dask": "distributed"}
    used = {name.split(".")[0] for module in MODULES for name in imports(module)}
    outside = used - set(sys.stdlib_module_names) - {"lagcli", "lagcli_core"}
    assert {named.get(n, n).lower() for n in outside} <= declared


# start-up


def imported(*arguments: str, status: int = 0) -> set[str]:
    """Return the top-level packages that a Python process imports."""
    done = subprocess.run(
        [sys.executable, "-X", "importtime", *arguments],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == status, done.stderr[-500:]
    names = re.findall(r"^import time:[^|]*\|[^|]*\|\s*(\S+)", done.stderr, re.MULTILINE)
    return {name.split(".")[0] for name in names}


@cache
def surroundings() -> set[str]:
    """Return what is not lagcli's: the standard library, and what Python imports at every start."""
    # the standard library's `copy` looks for `org.python` of Jython
    return imported("-c", "pass") | set(sys.stdlib_module_names) | {"org"}


def loaded(*arguments: str, status: int = 0) -> set[str]:
    """Return the packages from outside the standard library that a command imports."""
    names = imported("-m", "lagcli", *arguments, status=status)
    assert "lagcli" in names
    return names - surroundings() - {"lagcli"}


def test_help_imports_nothing_but_the_command_line() -> None:
    words = [["--help"], *([name, "--help"] for name in COMMANDS)]
    code = f"from lagcli.cli.app import run\nassert not any(map(run, {words}))"
    assert imported("-c", code) - surroundings() == {"lagcli", *OF_COMMAND_LINE}


@pytest.mark.parametrize(("suffix", "format_"), [(".csv", set()), (".h5", {"h5py"})])
def test_simulate_imports_what_it_uses(tmp_path: Path, suffix: str, format_: set[str]) -> None:
    model = ROOT / "models" / "slider_crank.yaml"
    out = str(tmp_path / f"run{suffix}")
    found = loaded("simulate", str(model), "--t-end", "0.1", "-o", out)
    assert {"numpy", "symengine", *format_} <= found <= OF_SIMULATE | format_


def test_events_that_set_values_need_no_more() -> None:
    # SymEngine imports SymPy to compare an expression with what it does not know, such as None
    model = next((ROOT / "models").rglob("sampled_pendulum.yaml"))
    found = imported("-m", "lagcli", "simulate", str(model), "--t-end", "0.1")
    assert found - surroundings() <= OF_SIMULATE | {"lagcli"}
    # which loads OpenSSL; only files contain digests
    assert "hashlib" not in found


@pytest.mark.parametrize(
    ("file", "writer", "without"),
    [
        ("run.h5", "lagcli.results.hdf5.trajectories", set()),
        ("run.csv", "lagcli.results.csv.writer", {"hashlib", "json"}),
    ],
)
def test_plain_runs_start_with_little(
    tmp_path: Path, file: str, writer: str, without: set[str]
) -> None:
    model = ROOT / "models" / "slider_crank.yaml"
    code = (
        "import sys\n"
        "from lagcli.cli.app import run\n"
        f"run(['simulate', {str(model)!r}, '-q', '-o', {str(tmp_path / file)!r}])\n"
        "print(*sys.modules)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},  # as the program sets it
        check=True,
        timeout=PATIENCE,
        capture_output=True,
        text=True,
    )
    modules = set(done.stdout.split())
    assert writer in modules
    assert not (NOT_OF_PLAIN_RUNS | without) & modules


def test_the_way_to_a_singular_configuration_needs_no_more() -> None:
    """SciPy's minimization and interpolation would take longer than the run."""
    model = str(ROOT / "models" / "parallelogram.yaml")
    found = loaded("simulate", model, "--set-initial", "alpha_1'=6", status=3)
    assert found <= OF_SIMULATE


def test_reports_need_no_extra(tmp_path: Path) -> None:
    run, page = str(tmp_path / "run.h5"), str(tmp_path / "report.html")
    loaded("simulate", str(ROOT / "models" / "slider_crank.yaml"), "--t-end", "0.1", "-o", run)
    of_checks = imported("-c", "import jsonschema; jsonschema.Draft7Validator({})")
    assert loaded("report", run, "-o", page) <= OF_SIMULATE | of_checks | {"h5py"}


def test_plots_of_runs_do_not_read_the_model(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="lagcli[pictures] is not installed")
    run, plot = str(tmp_path / "run.h5"), str(tmp_path / "plot.svg")
    loaded("simulate", str(ROOT / "models" / "slider_crank.yaml"), "--t-end", "0.1", "-o", run)
    assert not loaded("plot", run, "-o", plot) & {"symengine", "sympy", "yaml", "scipy"}


def test_errors_of_a_model_are_reported_without_more(tmp_path: Path) -> None:
    model = tmp_path / "wrong.yaml"
    model.write_text("coordinates: [x]\nT: x'^2/2 + y\nV: 0\ninitial: {x: 0, x': 1}\n")
    assert loaded("simulate", str(model), status=2) <= OF_SIMULATE


def test_the_command_that_is_called_is_built_alone() -> None:
    code = (
        "import sys\nfrom lagcli.cli.app import run\nrun(['simulate', '--help'])\n"
        "assert 'lagcli.cli.commands.simulate' in sys.modules\n"
        "assert not {'lagcli.cli.commands.derive', 'lagcli.cli.commands.info'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=PATIENCE, capture_output=True)


def test_simulate_can_be_called_whatever_was_imported_first() -> None:
    code = (
        "from lagcli.settings.settings import resolve\nimport lagcli\n"
        f"m = lagcli.load({str(ROOT / 'models' / 'pendulum_cartesian.yaml')!r})\n"
        "assert lagcli.simulate(m, t_end=0.01, samples=2).status == 'completed'"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=PATIENCE)


def test_no_file_of_the_core_includes_itself_by_way_of_others() -> None:
    core = PACKAGE / "engine" / "core"
    graph: dict[str, set[str]] = {}
    for file in sorted(core.rglob("*.[ch]")):
        own = str(file.relative_to(core).with_suffix(""))
        included = re.findall(
            r'^#include "(.*)\.h"', file.read_text(encoding="utf-8"), re.MULTILINE
        )
        graph.setdefault(own, set()).update(set(included) - {own})
    for own in [name for names in graph.values() for name in names if name not in graph]:
        graph[own] = set()  # a header that the build writes
    assert {"run", "motion", "switching/instant", "batch/batch"} <= set(graph)
    assert cycles(graph) == []


def test_the_core_counts_with_integers_of_one_size_on_every_platform() -> None:
    """`long` has 32 bits on Windows."""
    core = PACKAGE / "engine" / "core"
    for file in sorted(core.rglob("*.[ch]")):
        code = re.sub(r"/\*.*?\*/", "", file.read_text(encoding="utf-8"), flags=re.DOTALL)
        assert re.findall(r"\blong\b|\bLONG_|\b\d+[lL]\b", code) == [], file
