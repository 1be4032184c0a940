"""Machine code of tapes beside the interpreter and C: nanoseconds per evaluation of the dynamics.

    python tests/benchmark/native_code.py [MODEL ...]

The same tape, as the default run of a model has it, is interpreted, emitted as machine code, and
printed as C that `gcc -O3` compiles (without contraction, as the core). The three take turns; the
least of several counts, as other work only adds to it. The promise is at most 1.2 times the time of
C in the median of the models.
"""

from __future__ import annotations

import ctypes
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "tests" / "support"), str(ROOT / "tests" / "benchmark")]
from comparison.models import chain, pendulum_of_links  # noqa: E402
from core_parts import NativeProgram, parts  # noqa: E402

import lagcli  # noqa: E402
from lagcli.arrays import Array  # noqa: E402
from lagcli.engine.core.library import KERNEL  # noqa: E402
from lagcli.engine.core.program import Program  # noqa: E402
from lagcli.engine.core.structures import address  # noqa: E402
from lagcli.engine.integrate import prepared  # noqa: E402
from lagcli.engine.tape.operations import ARITY, ROUNDING, Op  # noqa: E402
from lagcli.engine.tape.tape import Tape  # noqa: E402

SHIPPED = (
    *("slider_crank", "four_bar", "andrews_squeezer", "car_axis", "rolling_disk", "heavy_top"),
    *("parallelogram", "double_pendulum_cartesian", "charged_pendulum", "chaplygin_sleigh"),
    *("pendulum_chain", "knife_edge_incline", "bead_on_rotating_hoop"),
)
FOUND = ("stewart", "armx5", "whipple_bicycle", "sarrus", "bennett", "bricard_a04", "ring100")
#: Seconds of one measurement, and how many there are of each.
LONG, TURNS = 0.02, 7

_C = {
    Op.ADD: "{} + {}",
    Op.SUB: "{} - {}",
    Op.MUL: "{} * {}",
    Op.DIV: "{} / {}",
    Op.NEG: "-{}",
    Op.POW: "pow({}, {})",
    Op.ATAN2: "atan2({}, {})",
    Op.ABS: "fabs({})",
    Op.LT: "{} < {}",
    Op.LE: "{} <= {}",
    Op.EQ: "{} == {}",
    Op.NE: "{} != {}",
    Op.AND: "{} * {}",
    Op.OR: "fmax({}, {})",
    Op.NOT: "1.0 - {}",
    Op.SELECT: "{} != 0.0 ? {} : {}",
    Op.CLIP: f"clip({{}}, {ROUNDING * ROUNDING!r} * {{}})",
}


class Case(NamedTuple):
    """A model's dynamics: the tape, its program, and the inputs of a state."""

    name: str
    tape: Tape
    program: Program
    inputs: Array


def models(names: Sequence[str]) -> Iterator[tuple[str, lagcli.Model]]:
    """Yield models by name."""
    for name in names or SHIPPED:
        yield name, lagcli.load(ROOT / "models" / f"{name}.yaml")
    for name in [] if names else FOUND:
        yield name, lagcli.load(ROOT / "tests" / "found" / f"{name}.yaml")
    if not names:
        yield "pendulum of 20 links", lagcli.load_text(pendulum_of_links(20))
        yield "chain of 100", lagcli.load_text(chain(100))


def cases(names: Sequence[str]) -> Iterator[Case]:
    """Yield the dynamics of models, as a run has them."""
    found: list[tuple[Tape, Program]] = []
    assemble = prepared.assemble

    def noted(tape: Tape, *rest: Any) -> Program:
        found.append((tape, assemble(tape, *rest)))
        return found[-1][1]

    prepared.assemble = noted
    for name, model in models(names):
        found.clear()
        run = lagcli.simulate(model, samples=2, method="DOP853")
        tape, program = max(found, key=lambda of: len(of[1].main))
        state = np.concatenate([run.time[:1], run.q[0], run.v[0]])
        inputs = np.ones(tape.inputs)
        inputs[: len(state)] = state
        yield Case(name, tape, program, inputs)
    prepared.assemble = assemble


def needed(tape: Tape, outputs: Sequence[int]) -> set[int]:
    """Return the registers on which outputs depend."""
    found = set(outputs)
    for op, to, *operands in reversed(tape.code):
        if to in found:
            found.update(operands[: ARITY[op]])
    return found


def text_of(tape: Tape) -> tuple[str, int]:
    """Return the C of a tape's dynamics, and how many numbers `in` has: what does not depend on the
    state comes first."""
    first, fixed = len(tape.outputs) - sum(tape.deferred), tape.inputs + len(tape.constants)
    now = needed(tape, tape.outputs[:first])
    later = needed(tape, tape.outputs[first:]) - now
    rates = tape.inputs - tape.rhs_inputs
    known = {*range(rates - tape.parameters, rates), *range(tape.inputs, fixed)}
    place = {x: f"in[{x}]" for x in range(fixed)}
    lines, used = [], set(tape.outputs)
    for op, to, *operands in tape.code:
        if to in now and known.issuperset(operands[: ARITY[op]]):
            known.add(to)
            place[to] = f"in[{len(place)}]"
        if to in later:
            used.update(operands[: ARITY[op]])
    count = len(place)
    kept = 0
    for op, to, *operands in tape.code:
        if to not in now or to in known:
            continue
        value = _C.get(op, f"{Op(op).name.lower()}({{}})")
        place[to] = f"v{to}"
        lines.append(
            f"const double v{to} = {value.format(*[place[x] for x in operands[: ARITY[op]]])};"
        )
        if to in used:
            lines.append(f"out[{kept}] = v{to};")
            kept += 1
    body = "\n    ".join(lines)
    return (
        f"void rate(const double *restrict in, double *restrict out)\n{{\n    {body}\n}}\n",
        count,
    )


_LOOPS = """
#include <math.h>
#include <stdint.h>
static inline double clip(double a, double bound)
{{
    return a < 0.0 && a * a <= bound ? a - a : a;
}}
{}
void compiled(const double *in, double *out, long times)
{{
    for (long i = 0; i < times; ++i)
        rate(in, out);
}}
void interpreted(void (*run)(int, const int32_t *, double *), int kernel, const int32_t *stream,
                 double *r, long times)
{{
    for (long i = 0; i < times; ++i)
        run(kernel, stream, r);
}}
"""


def compiled(text: str, folder: Path) -> ctypes.CDLL:
    """Return a library of some C."""
    source = folder / f"rate{len(list(folder.iterdir()))}.c"
    source.write_text(_LOOPS.format(text))
    library = source.with_suffix(".so")
    options = ["-O3", "-fno-math-errno", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run(["gcc", *options, source, "-o", library, "-lm"], check=True)
    return ctypes.CDLL(str(library))


def nanoseconds(works: Sequence[Callable[[int], object]]) -> list[float]:
    """Return the least time of one turn of each work."""
    times = []
    for work in works:
        count = 1
        while True:
            began = time.process_time()
            work(count)
            spent = time.process_time() - began
            if spent > LONG / 4:
                break
            count *= 4
        times.append(max(1, int(count * LONG / spent)))
    least = [float("inf")] * len(works)
    for _ in range(TURNS):
        for i, work in enumerate(works):
            began = time.process_time()
            work(times[i])
            least[i] = min(least[i], (time.process_time() - began) / times[i])
    return [1e9 * x for x in least]


def measured(case: Case, folder: Path) -> tuple[int, list[float]]:
    """Return the operations of a case, and its times: interpreted, emitted, compiled."""
    program, tape = case.program, case.tape
    text, count = text_of(tape)
    library = compiled(text, folder)
    registers = program.registers.copy()
    registers[: len(case.inputs)] = case.inputs
    parts.lag_part_run(KERNEL, address(program.prelude), address(registers))
    native = NativeProgram(program)
    native.run(0, registers.copy())
    assert native.size(0), "no machine code on this machine"
    inner = np.ones(count)
    inner[: len(case.inputs)] = case.inputs
    inner[tape.inputs : tape.inputs + len(tape.constants)] = tape.constants
    out = np.empty(len(program.registers) + len(tape.outputs) + len(tape.code))
    run = ctypes.cast(parts.lag_part_run, ctypes.c_void_p)
    stream = ctypes.c_void_p(address(program.main))
    pointers = [ctypes.c_void_p(address(x)) for x in (registers, inner, out)]

    def interpret(times: int) -> None:
        library.interpreted(run, KERNEL, stream, pointers[0], ctypes.c_long(times))

    def emitted(times: int) -> None:
        native.run(0, registers, times)

    def by_gcc(times: int) -> None:
        library.compiled(pointers[1], pointers[2], ctypes.c_long(times))

    return program.size, nanoseconds([interpret, emitted, by_gcc])


def main() -> None:
    """Print the table."""
    ratios = []
    print(
        f"{'model':28}{'operations':>11}{'interpreted':>12}{'emitted':>9}{'gcc -O3':>9}{'ratio':>7}"
    )
    with tempfile.TemporaryDirectory() as folder:
        for case in cases(sys.argv[1:]):
            size, (interpreted, emitted, by_gcc) = measured(case, Path(folder))
            ratios.append(emitted / by_gcc)
            print(
                f"{case.name:28}{size:11}{interpreted:12.0f}{emitted:9.0f}{by_gcc:9.0f}"
                f"{ratios[-1]:7.2f}",
                flush=True,
            )
    print(f"emitted / gcc -O3, median of {len(ratios)}: {median(ratios):.2f}")


if __name__ == "__main__":
    main()
