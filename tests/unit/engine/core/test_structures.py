"""The binding's structures and functions are those of the core's headers."""

from __future__ import annotations

import ctypes
import re
import subprocess
from ctypes import c_char_p, c_double, c_int, c_int64, c_void_p
from pathlib import Path
from typing import Any

import core_parts
import pytest

from lagcli.engine.core import batch, library, program, run, structures, switching
from lagcli.engine.core.structures import Arguments

CORE = Path(structures.__file__).parent
MODULES = (structures, run, switching, batch, program, core_parts)
STRUCTURES = [
    kind
    for module in MODULES
    for kind in vars(module).values()
    if isinstance(kind, type)
    and issubclass(kind, ctypes.Structure)
    and kind.__module__ == module.__name__
    and kind.__name__.startswith("lag_")
]
HEADERS = ("lagcore.h", "lagbatch.h", "lagmodel.h", "lagprogram.h", "parts.h")
#: Functions of the headers, as the binding declares them.
DECLARED: dict[str, tuple[Any, ...]] = {
    name: signature
    for signatures in (
        *(
            x.signatures
            for x in (library._core, *(m.core for m in (run, switching, batch, program)))
        ),
        core_parts.SIGNATURES,
    )
    for name, signature in signatures.items()
}
#: Whether a parameter or a result is a pointer is what counts: the binding gives addresses.
NUMBERS = {"int": c_int, "double": c_double, "int64_t": c_int64, "size_t": ctypes.c_size_t}


def test_the_layout_of_structures_is_the_compilers(tmp_path: Path) -> None:
    """Each structure's size, and each field's place and size."""
    core_library = pytest.importorskip("core_library")
    try:
        compiler = core_library.find_compiler()
    except core_library.CannotCompile as error:
        pytest.skip(str(error))
    assert len(STRUCTURES) > 20
    expected, lines = [], []
    for kind in STRUCTURES:
        name = kind.__name__
        expected.append(ctypes.sizeof(kind))
        lines.append(f"sizeof({name})")
        for field, *_ in kind._fields_:
            place = getattr(kind, field)
            expected += [place.offset, place.size]
            lines += [f"offsetof({name}, {field})", f"sizeof((({name} *)0)->{field})"]
    source, program = tmp_path / "sizes.c", tmp_path / "sizes"
    includes = "".join(f'#include "{name}"\n' for name in HEADERS[1:])
    numbers = ",\n".join(f"    (int){line}" for line in lines)
    source.write_text(
        f"#include <stdio.h>\n{includes}"
        f"static const int all[] = {{\n{numbers}}};\n"
        "int main(void)\n{\n    for (unsigned i = 0; i < sizeof all / sizeof *all; ++i)\n"
        '        printf("%d\\n", all[i]);\n    return 0;\n}\n'
    )
    subprocess.run([*compiler.command, f"-I{CORE}", source, "-o", program], check=True)
    printed = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    for line, size, here in zip(lines, map(int, printed.split()), expected, strict=True):
        assert size == here, line


def functions_of(header: str) -> dict[str, tuple[str, list[str]]]:
    """Return the functions that a header declares: their results and parameters."""
    text = (CORE / header).read_text("utf-8")
    text = re.sub(r"/\*.*?\*/|^#.*?$", "", text, flags=re.S | re.M)
    text = re.sub(r"typedef struct \{.*?\} \w+;", "", text, flags=re.S)
    found = re.findall(r"^([a-z][\w ]*?[ *]+)(lag_\w+)\(([^)]*)\);", text, flags=re.M)
    return {
        name: (result.strip(), [p.strip() for p in parameters.split(",") if p.strip() != "void"])
        for result, name, parameters in found
    }


@pytest.mark.parametrize("header", HEADERS)
def test_every_function_of_a_header_is_declared_as_there(header: str) -> None:
    functions = functions_of(header)
    assert functions
    for name, (result, parameters) in functions.items():
        declared, *arguments = DECLARED[name]
        assert len(arguments) == len(parameters), name
        for parameter, argument in zip(parameters, arguments, strict=True):
            kind = parameter.removeprefix("const ").split()[0]
            if "*" in parameter or kind not in NUMBERS:
                assert argument is c_void_p or kind == "lag_scalar_function", (name, parameter)
            else:
                assert argument is NUMBERS[kind], (name, parameter)
        if result.endswith("*"):
            assert declared in (c_void_p, c_char_p, structures.Doubles), name
        elif result == "void":
            assert declared is None, name
        elif result in NUMBERS:
            assert declared is NUMBERS[result], name
        else:
            assert declared.__name__ == result, name


def test_nothing_else_is_declared() -> None:
    of_headers = set().union(*(functions_of(header) for header in HEADERS))
    assert set(DECLARED) == of_headers


def test_the_numbers_of_lanes_and_kernels_are_those_of_c() -> None:
    assert f"#define LAG_LANES {batch.LANES} " in (CORE / "lagbatch.h").read_text("utf-8")
    assert "enum lag_kernel { LAG_PORTABLE, LAG_AVX2, LAG_NATIVE };" in (
        CORE / "lagcore.h"
    ).read_text("utf-8")
    assert (library.PORTABLE, library.AVX2, library.NATIVE) == (0, 1, 2)


def test_a_structure_is_filled_from_all_its_fields() -> None:
    given = Arguments()
    with pytest.raises(KeyError, match="column"):
        given.filled(structures.lag_pivots, n=0, row=[])
    names = ("row", "column", "start", "columns", "diagonal", "places")
    block = {"n": 0, **{name: [1, 2] for name in names}}
    with pytest.raises(TypeError, match="lag_pivots has no other"):
        given.filled(structures.lag_pivots, **block, other=1)
    record = given.filled(structures.lag_pivots, **block)
    assert structures.listed(record.places, 2) == [1, 2]
