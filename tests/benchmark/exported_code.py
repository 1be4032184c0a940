"""Exported C beside a dense solution, and beside C of lagcli's own operations: ns per evaluation.

    python tests/benchmark/exported_code.py [MODEL ...]

`gcc -O2` compiles the code; it evaluates a and λ at 64 states of the model's run. The dense
solution is the same file without the call of its elimination. lagcli's own operations are those of
`native_code.py`: they leave out what depends on parameters alone, which a run computes once, and
the check of the solution, which it makes once a step.
"""

from __future__ import annotations

import ctypes
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np
from native_code import SHIPPED, cases, compiled, models, nanoseconds, text_of

import lagcli
from lagcli.arrays import Array
from lagcli.export.c import write_c
from lagcli.export.content import content_of

#: Number of states.
_STATES = 64
_CALL = "    if (eliminated(t, q, v, p, a, lambda))\n        return 0;\n"
_LOOP = """
int failures;
void loop(const double *states, const double *p, double *out, long times)
{
    for (long i = 0; i < times; ++i) {
        const double *s = states + (i % STATES) * (1 + 2 * NQ);
        failures += NAME_dynamics(s[0], s + 1, s + 1 + NQ, p, out, out + NQ);
    }
}
"""


def library(text: str, source: Path) -> ctypes.CDLL:
    """Return a library of exported code with a loop over states."""
    found = re.search(r"int (\w+)_dynamics\(", text)
    assert found
    loop = _LOOP.replace("STATES", str(_STATES)).replace("NAME", found[1])
    source.write_text(text + loop, encoding="utf-8")
    built = source.with_suffix(".so")
    options = ["-std=c11", "-O2", "-Wno-unused-function", "-shared", "-fPIC"]
    subprocess.run(["gcc", *options, source, "-o", built, "-lm"], check=True)
    return ctypes.CDLL(str(built))


def pointer(array: Array) -> ctypes.c_void_p:
    """Return the address of an array."""
    return ctypes.c_void_p(array.ctypes.data)


def exported(model: lagcli.Model, folder: Path) -> list[Callable[[int], object]]:
    """Return evaluations by the dense solution and by exported code."""
    content, run = content_of(model), lagcli.simulate(model, samples=_STATES)
    states = np.ascontiguousarray(np.column_stack([run.time, run.q, run.v]))
    p, out = np.array(content.start.state.p), np.zeros(content.system.counts.unknowns + 1)
    text = write_c(content)
    assert _CALL in text

    def work(own: ctypes.CDLL) -> Callable[[int], object]:
        return lambda times: own.loop(
            pointer(states), pointer(p), pointer(out), ctypes.c_long(times)
        )

    texts = {"dense.c": text.replace(_CALL, ""), "exported.c": text}
    return [work(library(x, folder / name)) for name, x in texts.items()]


def main() -> None:
    """Print the table."""
    names, ratios = sys.argv[1:] or [*SHIPPED], []
    print(f"{'model':28}{'dense':>9}{'exported':>10}{'lagcli':>9}{'ratio':>7}")
    with tempfile.TemporaryDirectory() as root:
        own = {}
        (Path(root) / "own").mkdir()
        for case in cases(names):
            text, count = text_of(case.tape)
            inputs = np.ones(count)
            inputs[: len(case.inputs)] = case.inputs
            constants = case.tape.constants
            inputs[case.tape.inputs : case.tape.inputs + len(constants)] = constants
            size = len(case.tape.outputs) + len(case.tape.code)
            own[case.name] = compiled(text, Path(root) / "own"), inputs, np.empty(size)
        for name, model in models(names):
            folder = Path(root) / name
            folder.mkdir()
            of_lagcli, inputs, out = own[name]

            def run(
                times: int, f: ctypes.CDLL = of_lagcli, x: Array = inputs, y: Array = out
            ) -> None:
                f.compiled(pointer(x), pointer(y), ctypes.c_long(times))

            dense, new, least = nanoseconds([*exported(model, folder), run])
            ratios.append(new / least)
            print(f"{name:28}{dense:9.0f}{new:10.0f}{least:9.0f}{ratios[-1]:7.2f}", flush=True)
    print(f"exported / lagcli's operations, median of {len(ratios)}: {median(ratios):.2f}")


if __name__ == "__main__":
    main()
