"""Programs that integrate the equations of ported models, all given the same right-hand side.

- C: the operations printed as C, `gcc -O3`, and Hairer's DOP853 in C around them.
- heyoka: the operations as its expressions; Taylor's method compiled by LLVM.
- CasADi: the operations in SX; CVODES with its own Jacobians.

States are in units of their sizes along the motion, so that one absolute tolerance suits all.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate._ivp import dop853_coefficients as dop853

from comparison.methods import Method, decades
from comparison.ported_cases import PortedCase
from comparison.tape_equations import TapeEquations, Unsuited
from lagcli.engine.tape.operations import Op

Array = NDArray[np.float64]
#: Operations up to which a program is given the equations: its compiler takes minutes beyond.
MOST_IN_C, MOST_IN_HEYOKA, MOST_IN_CASADI = 10_000, 1_500, 10_000
#: Operations of Taylor's recursion up to which heyoka's code is unrolled.
LONGEST_UNROLLED = 300
_STEPS = 10_000_000

_C = {
    Op.ADD: "{} + {}",
    Op.SUB: "{} - {}",
    Op.MUL: "{} * {}",
    Op.DIV: "{} / {}",
    Op.NEG: "-{}",
    Op.ABS: "fabs({})",
    Op.CLIP: "{}",
}
_PLAIN: Mapping[Op, Callable[..., Any]] = {
    Op.ADD: lambda a, b: a + b,
    Op.SUB: lambda a, b: a - b,
    Op.MUL: lambda a, b: a * b,
    Op.DIV: lambda a, b: a / b,
    Op.NEG: lambda a: -a,
    Op.POW: lambda a, b: a**b,
    Op.CLIP: lambda a, b: a,
}
#: Functions that all of the programs have, and those that are their operations.
_FUNCTIONS = ("sin", "cos", "tan", "sqrt", "exp", "log", "atan2", "tanh", "sinh", "cosh", "pow")


def _fits(equations: TapeEquations, most: int) -> None:
    count = len(equations.tape.code)
    if count > most:
        raise Unsuited(f"{count} operations")


class Compiled:
    """DOP853 in C around the operations, compiled by `gcc -O3`."""

    def __init__(self, case: PortedCase):
        self.case = case
        equations = case.equations
        _fits(equations, MOST_IN_C)
        text = _SOURCE.format(
            rate=_rate_in_c(equations),
            size=2 * case.nq,
            stages=_stages(1, 12),
            more_stages=_stages(13, 16),
            third=_combined(dop853.E3),
            fifth=_combined(dop853.E5),
            sum=_combined(dop853.B),
            dense="\n                ".join(
                f"f[{d}][i] = h * ({_combined(row)});" for d, row in enumerate(dop853.D, 3)
            ),
        )
        folder = Path(tempfile.mkdtemp(prefix="comparison-"))
        source, library = folder / "rate.c", folder / "rate.so"
        source.write_text(text, encoding="utf-8")
        options = ["-O3", "-fno-math-errno", "-ffp-contract=off", "-shared", "-fPIC"]
        subprocess.run(["gcc", *options, str(source), "-lm", "-o", str(library)], check=True)
        self.run = ctypes.CDLL(str(library)).integrate
        shutil.rmtree(folder)  # the loaded library stays
        self.run.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int, ctypes.c_double]
        self.run.argtypes += [ctypes.c_void_p, ctypes.c_void_p]
        self.start, self.sizes = equations.start, case.sizes

    def at(self, setting: float) -> Callable[[], Array]:
        """Prepare a run at a tolerance."""
        times, absolute = self.case.times, setting * self.sizes
        out = np.empty((len(times), len(self.start)))

        def run() -> Array:
            pointers = [x.ctypes.data for x in (self.start, times, absolute, out)]
            y, t, atol, to = pointers
            if self.run(y, t, len(times), setting, atol, to):
                raise RuntimeError("the step size fell to its minimum")
            return out

        return run

    def positions(self, result: Array) -> Array:
        """Return q."""
        return result[:, : self.case.nq].copy()


def _rate_in_c(equations: TapeEquations) -> str:
    lines: list[str] = []

    def number(x: Any) -> str:
        return f"({x!r})" if isinstance(x, float) else x

    def operation(op: Op, operands: list[Any]) -> str:
        name = op.name.lower()
        if op not in _C and name not in _FUNCTIONS:
            raise Unsuited(f"{name} is not smooth")
        value = _C.get(op, f"{name}({', '.join(['{}'] * len(operands))})")
        lines.append(f"const double x{len(lines)} = {value.format(*map(number, operands))};")
        return f"x{len(lines) - 1}"

    size = len(equations.start)
    a = equations.accelerations("t", [f"y[{i}]" for i in range(size)], operation)
    lines += [f"out[{i}] = y[{i + size // 2}];" for i in range(size // 2)]
    lines += [f"out[{i}] = {number(x)};" for i, x in enumerate(a, size // 2)]
    return "\n    ".join(lines)


def _combined(coefficients: Array) -> str:
    """Return a combination of the stages k at i as C, without those whose coefficient is zero."""
    terms = enumerate(coefficients.tolist())
    return " + ".join(f"{x!r} * k[{s}][i]" for s, x in terms if x) or "0.0"


def _stages(first: int, last: int) -> str:
    """Return the evaluation of stages as C."""
    return "\n        ".join(
        f"for (int i = 0; i < N; ++i)\n            at[i] = y[i] + h * ({_combined(dop853.A[s])});"
        f"\n        rate(t + {float(dop853.C[s])!r} * h, at, k[{s}]);"
        for s in range(first, last)
    )


_SOURCE = """
#include <math.h>
#include <string.h>
enum {{ N = {size} }};

static __attribute__((noinline)) void rate(double t, const double *restrict y, double *restrict out)
{{
    {rate}
}}

static double k[16][N];

static double scaled(const double *x, const double *y, double rtol, const double *atol)
{{
    double sum = 0.0;
    for (int i = 0; i < N; ++i) {{
        const double r = x[i] / (atol[i] + rtol * fabs(y[i]));
        sum += r * r;
    }}
    return sqrt(sum / N);
}}

int integrate(const double *start, const double *times, int count, double rtol, const double *atol,
              double *out)
{{
    double y[N], at[N], next[N], f[7][N], t = times[0];
    const double end = times[count - 1];
    memcpy(y, start, sizeof y);
    rate(t, y, k[0]);
    /* the first step, by Hairer, Norsett and Wanner, section II.4 */
    const double d0 = scaled(y, y, rtol, atol), d1 = scaled(k[0], y, rtol, atol);
    const double h0 = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
    for (int i = 0; i < N; ++i)
        next[i] = y[i] + h0 * k[0][i];
    rate(t + h0, next, k[1]);
    for (int i = 0; i < N; ++i)
        next[i] = k[1][i] - k[0][i];
    const double d2 = scaled(next, y, rtol, atol) / h0, most = fmax(d1, d2);
    double h = fmin(100.0 * h0, most <= 1e-15 ? fmax(1e-6, 1e-3 * h0) : pow(0.01 / most, 1.0 / 8));
    int sampled = 0, refused = 0;
    memcpy(out, y, sizeof y);
    while (++sampled < count) {{
        --sampled;
        if (t + h > end)
            h = end - t;
        if (h < 10.0 * (nextafter(fabs(t), INFINITY) - fabs(t)))
            return 1;
        {stages}
        double e3 = 0.0, e5 = 0.0;
        for (int i = 0; i < N; ++i) {{
            const double third = {third}, fifth = {fifth};
            next[i] = y[i] + h * ({sum});
            const double size = atol[i] + rtol * fmax(fabs(y[i]), fabs(next[i]));
            e3 += third / size * (third / size);
            e5 += fifth / size * (fifth / size);
        }}
        const double both = e5 + 0.01 * e3;
        const double error = both > 0.0 ? h * e5 / sqrt(both * N) : 0.0;
        if (!(error < 1.0)) {{
            h *= error == error ? fmax(0.2, 0.9 * pow(error, -1.0 / 8)) : 0.2;
            refused = 1;
            continue;
        }}
        rate(t + h, next, k[12]);
        if (sampled + 1 < count && times[sampled + 1] <= t + h) {{
            {more_stages}
            for (int i = 0; i < N; ++i) {{
                const double rise = next[i] - y[i];
                f[0][i] = rise;
                f[1][i] = h * k[0][i] - rise;
                f[2][i] = 2.0 * rise - h * (k[12][i] + k[0][i]);
                {dense}
            }}
            while (sampled + 1 < count && times[sampled + 1] <= t + h) {{
                double *to = out + (long)++sampled * N, x = (times[sampled] - t) / h;
                for (int i = 0; i < N; ++i) {{
                    double sum = 0.0;
                    for (int d = 6; d >= 0; --d)
                        sum = (sum + f[d][i]) * (d % 2 ? 1.0 - x : x);
                    to[i] = y[i] + sum;
                }}
            }}
        }}
        t += h;
        memcpy(y, next, sizeof y);
        memcpy(k[0], k[12], sizeof y);
        double factor = error > 0.0 ? fmin(10.0, 0.9 * pow(error, -1.0 / 8)) : 10.0;
        if (refused)
            factor = fmin(1.0, factor);
        refused = 0;
        h *= factor;
    }}
    return 0;
}}
"""


def _expressions(
    case: PortedCase, program: Any, t: Any, state: Sequence[Any], most: int
) -> list[Any]:
    """Return the rates of the scaled state as expressions of a program."""
    equations = case.equations
    _fits(equations, most)

    def operation(op: Op, operands: list[Any]) -> Any:
        name = op.name.lower()
        function = _PLAIN.get(op) or (getattr(program, name, None) if name in _FUNCTIONS else None)
        if function is None:
            raise Unsuited(f"{name} is not smooth")
        return function(*operands)

    sizes, nq = case.sizes.tolist(), case.nq
    y = [x * size for x, size in zip(state, sizes, strict=True)]
    rates = [*y[nq:], *equations.accelerations(t, y, operation)]
    return [x / size for x, size in zip(rates, sizes, strict=True)]


class Heyoka:
    """The equations, compiled at each tolerance."""

    def __init__(self, case: PortedCase):
        import heyoka as hy

        self.case = case
        y = hy.make_vars(*[f"y{i}" for i in range(2 * case.nq)])
        rates = _expressions(case, hy, hy.time, y, MOST_IN_HEYOKA)
        self.system = [(a, hy.expression(b)) for a, b in zip(y, rates, strict=True)]
        self.start = case.equations.start / case.sizes
        trial = hy.taylor_adaptive(self.system, self.start, tol=1e-4, compact_mode=True)
        self.compact = len(trial.decomposition) > LONGEST_UNROLLED

    def at(self, setting: float) -> Callable[[], Array]:
        """Compile, and prepare a run at a tolerance."""
        import heyoka as hy

        integrator = hy.taylor_adaptive(
            self.system, self.start, tol=setting, compact_mode=self.compact
        )

        def run() -> Array:
            integrator.time = self.case.times[0]
            integrator.state[:] = self.start
            *_, states = integrator.propagate_grid(self.case.times)
            return states

        return run

    def positions(self, result: Array) -> Array:
        """Return q."""
        return result[:, : self.case.nq] * self.case.sizes[: self.case.nq]


class Cvodes:
    """The equations in CasADi's CVODES."""

    def __init__(self, case: PortedCase, options: dict[str, Any]):
        import casadi as ca

        self.case = case
        self.options = {"max_num_steps": _STEPS, **options}
        t, y = ca.SX.sym("t"), ca.SX.sym("y", 2 * case.nq)
        rates = _expressions(case, ca, t, ca.vertsplit(y), MOST_IN_CASADI)
        self.dae = {"t": t, "x": y, "ode": ca.vertcat(*rates)}
        self.start = case.equations.start / case.sizes

    def at(self, setting: float) -> Callable[[], Any]:
        """Prepare a run at a tolerance."""
        import casadi as ca

        options = {**self.options, "reltol": setting, "abstol": setting}
        times = self.case.times
        integrator = ca.integrator("run", "cvodes", self.dae, times[0], times, options)
        return lambda: integrator(x0=self.start)

    def positions(self, result: Any) -> Array:
        """Return q."""
        return np.array(result["xf"]).T[:, : self.case.nq] * self.case.sizes[: self.case.nq]


def _settings(first: int, last: int, case: PortedCase) -> tuple[float, ...]:
    return decades(first, last)[::2]


_ADAMS = {"linear_multistep_method": "adams", "nonlinear_solver_iteration": "functional"}
METHODS = (
    Method("C", "DOP853, gcc -O3", Compiled, partial(_settings, 5, 13)),
    Method("heyoka", "Taylor, given", Heyoka, partial(_settings, 6, 16), packages=("heyoka",)),
    *(
        Method(
            "CasADi",
            f"CVODES {name}, given",
            partial(Cvodes, options=options),
            partial(_settings, 5, 13),
            packages=("casadi",),
        )
        for name, options in (("Adams", _ADAMS), ("BDF", {}))
    ),
)
