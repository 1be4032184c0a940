"""The core as a separate library: a C program on it, its symbols, and its headers."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lowered import lowered

import lagcli
from lagcli.engine.contract import Block, IntegrationRequest
from lagcli.engine.core.headers import headers
from lagcli.engine.core.program import Program
from lagcli.engine.integrate import run as integrate_run
from lagcli.engine.system import State, System
from lagcli.settings.settings import SettingsOverrides, resolve

ROOT = Path(__file__).parents[4]
CORE = ROOT / "lagcli" / "engine" / "core"
SOURCES = sorted(CORE.rglob("*.c"))
COMPILER = os.environ.get("CC", "cc").split()
STRICT = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic"]

needs_compiler = pytest.mark.skipif(
    shutil.which(COMPILER[0]) is None, reason=f"no C compiler: {COMPILER[0]}"
)

#: What the core may need from outside: functions of libm and of memory, executable memory too, and
#: what GCC finds the processor's instruction set with, for the versions of Taylor's loops.
ALLOWED = {
    *("mmap", "mprotect", "munmap"),
    *(
        "acos",
        "acosh",
        "asin",
        "asinh",
        "atan",
        "atan2",
        "atanh",
        "ceil",
        "copysign",
        "cos",
        "cosh",
    ),
    *(
        "erf",
        "erfc",
        "exp",
        "expm1",
        "fegetround",
        "fesetround",
        "floor",
        "fma",
        "fmax",
        "fmin",
        "log",
        "log1p",
        "nextafter",
        "pow",
        "sin",
    ),
    *(
        "sincos",
        "sinh",
        "sqrt",
        "tan",
        "tanh",
        "memcmp",
        "memcpy",
        "memmove",
        "memset",
        "malloc",
        "free",
    ),
    *("__cpu_indicator_init", "__cpu_model"),
}


@pytest.fixture(scope="module")
def headers_written() -> None:
    """Headers that are generated are there after every build; without one they are written."""
    for name, text in headers().items():
        if not (CORE / name).exists():
            (CORE / name).write_text(text, encoding="utf-8")


@pytest.fixture(scope="module")
def objects(tmp_path_factory: pytest.TempPathFactory, headers_written: None) -> list[Path]:
    """The objects of the core, compiled without Python's headers."""
    folder = tmp_path_factory.mktemp("objects")
    found = []
    for source in SOURCES:
        found.append(folder / ("_".join(source.relative_to(CORE).parts) + ".o"))
        # tables of pointers are constant data only in code that is not moved
        flags = [*STRICT, "-O0", "-fno-pic", "-fno-pie", "-fno-stack-protector", f"-I{CORE}"]
        subprocess.run([*COMPILER, *flags, "-c", source, "-o", found[-1]], check=True)
    return found


def number(value: float) -> str:
    """Return a number in C."""
    if isinstance(value, int):
        return str(value)
    return value.hex() if math.isfinite(value) else "NAN" if math.isnan(value) else "INFINITY"


class Emitter:
    """Writes a System's programs and settings as C."""

    def __init__(self) -> None:
        self.text = ""

    def integers(self, name: str, values: Iterable[int]) -> str:
        return self.array("int32_t", name, [str(int(x)) for x in values])

    def doubles(self, name: str, values: Iterable[float]) -> str:
        return self.array("double", name, [float(x).hex() for x in values])

    def array(self, kind: str, name: str, texts: list[str]) -> str:
        self.text += f"static const {kind} {name}_[] = {{{', '.join(texts or ['0'])}}};\n"
        return f"{name}_"

    def stream(self, name: str, code: np.ndarray) -> str:
        return f"{{{self.integers(name, code)}, {len(code)}}}"

    def program(self, name: str, program: Program) -> str:
        deferred = [
            self.stream(f"{name}_deferred_{i}", code) for i, code in enumerate(program.deferred)
        ]
        output_subsets = [
            self.stream(f"{name}_subset_{i}", code) for i, code in enumerate(program.output_subsets)
        ]
        fields = {
            "prelude": self.stream(f"{name}_prelude", program.prelude),
            "main": self.stream(f"{name}_main", program.main),
            **({"deferred": f"{{{', '.join(deferred)}}}"} if deferred else {}),
            **({"output_subsets": f"{{{', '.join(output_subsets)}}}"} if output_subsets else {}),
            "inputs": program.inputs,
            "registers": self.doubles(f"{name}_registers", program.registers),
            "register_count": len(program.registers),
            "outputs": self.integers(f"{name}_outputs", program.outputs),
            "output_count": len(program.outputs),
        }
        return self.structure(fields)

    def structure(self, fields: dict[str, object]) -> str:
        return "{" + ", ".join(f".{name} = {value}" for name, value in fields.items()) + "}"

    def equations(self, system: System, constraint: Program) -> str:
        mass, jacobian = system.mass_pattern, system.jacobian_pattern
        first = {j: group[0] for group in system.same_unit for j in group}
        count = len(system.coordinates)
        return self.structure(
            {
                "nq": count,
                "nc": len(system.constraints),
                "nh": len(system.holonomic),
                "np": len(system.parameters),
                "holonomic": self.integers("holonomic", system.holonomic),
                "nm": len(mass),
                "nb": len(jacobian),
                "mass_row": self.integers("mass_row", [i for i, _ in mass]),
                "mass_column": self.integers("mass_column", [j for _, j in mass]),
                "jacobian_row": self.integers("jacobian_row", [i for i, _ in jacobian]),
                "jacobian_column": self.integers("jacobian_column", [j for _, j in jacobian]),
                "unit": self.integers("unit", [first.get(j, j) for j in range(count)]),
                "constraint": self.program("constraint", constraint),
            }
        )

    def problem(self, given: dict[str, Any]) -> str:
        """Write the problem that the binding's Integrator is given."""
        given = given | {"times_count": len(given["times"])}
        del given["block_rows"]
        for name in ("y", "times", "sizes", "lengths", "plain_lengths", "atol", "parameters"):
            given[name] = self.doubles(name, given[name])
        given["kind"] = self.integers("kind", given["kind"])
        given["t"] = float(given["t"]).hex()
        given["settings"] = self.structure({k: number(x) for k, x in given["settings"].items()})
        return self.structure(
            {k: int(x) if x is True or x is False else x for k, x in given.items()}
        )


@pytest.mark.slow
@needs_compiler
def test_a_c_program_integrates_as_the_binding_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, objects: list[Path]
) -> None:
    """The pendulum of the developer guide's program, bit by bit and against its energy."""
    what = lowered(lagcli.load(ROOT / "models" / "pendulum_cartesian.yaml"))
    system, start = what.system, State(0.0, np.array([0.0, -1.0]), np.array([1.5, 0.0]), what.p)
    overrides = SettingsOverrides(t_end=5.0, method="DOP853", rtol=1e-10, atol=1e-12)
    request = IntegrationRequest(
        state=start,
        rank=1,
        settings=resolve(overrides),
        times=np.linspace(0.0, 5.0, 51),
        atol=1e-12,
    )
    made: list[tuple[Any, ...]] = []
    original = integrate_run.Integrator

    def recorded(*arguments: Any) -> Any:
        made.append(arguments)
        return original(*arguments)

    monkeypatch.setattr(integrate_run, "Integrator", recorded)
    blocks: list[Block] = []
    integration = integrate_run.Integration(system, request, blocks.append, None)
    assert integration.run().status == "completed"
    [block] = blocks
    parts = [block.time, block.q, block.v, block.a, block.multipliers, block.work]
    expected = np.column_stack(parts)

    model, problem, _ = made[0]
    emitter = Emitter()
    constants = {
        "lag_equations equations": emitter.equations(
            system, model.parts["equations"]["constraint"]
        ),
        "lag_program dynamics": emitter.program("dynamics", integration.in_use.dynamics),
        "lag_problem problem": emitter.problem(problem),
    }
    text = "#include <math.h>\n\n" + emitter.text
    text += "".join(f"static {name} = {value};\n" for name, value in constants.items())
    text += f"enum {{ SAMPLES = {len(expected)}, WIDTH = {expected.shape[1]} }};\n"
    (tmp_path / "pendulum.h").write_text(text, encoding="utf-8")
    program = tmp_path / "pendulum"
    own = Path(__file__).with_name("pendulum.c")
    flags = [*STRICT, "-no-pie", f"-I{CORE}", f"-I{tmp_path}"]
    subprocess.run([*COMPILER, *flags, own, *objects, "-lm", "-o", program], check=True)
    printed = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    found = np.array([[float.fromhex(x) for x in row.split()] for row in printed.splitlines()])
    np.testing.assert_array_equal(found, expected)

    y, v = found[:, 2], found[:, 3:5]
    length = np.hypot(found[:, 1], y)
    np.testing.assert_allclose(length, 1.0, rtol=1e-14)
    energy = 0.5 * (v**2).sum(axis=1) + 9.81 * y
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


@pytest.mark.slow
@needs_compiler
def test_the_core_needs_nothing_but_libm_and_functions_of_memory(objects: list[Path]) -> None:
    if shutil.which("nm") is None:
        pytest.skip("no nm")
    # FMUs read files, and pages use what they use
    inner = [path for path in objects if not path.name.startswith(("fmi_", "page_"))]
    listed = subprocess.run(["nm", *inner], check=True, capture_output=True, text=True).stdout
    symbols = re.findall(r"^[0-9a-f ]+ ([A-Za-z]) (\w+)$", listed, re.M)
    own = {name for kind, name in symbols if kind in "TRi"}  # i: versions for processors
    assert {name for kind, name in symbols if kind == "U"} - own <= ALLOWED
    assert [name for kind, name in symbols if kind in "DdBbC"] == [], "variables"


def test_no_header_of_the_core_needs_itself() -> None:
    """Headers include each other in no circle."""
    included = {
        str(f.relative_to(CORE)): re.findall(r'#include "(.*)"', f.read_text(encoding="utf-8"))
        for f in CORE.rglob("*.h")
    }

    def below(header: str, path: tuple[str, ...]) -> None:
        assert header not in path, " → ".join((*path, header))
        for other in included.get(header, ()):
            below(other, (*path, header))

    for header in included:
        below(header, ())
