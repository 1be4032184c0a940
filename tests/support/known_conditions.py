"""Functions of one variable z in (0, 1) with known roots: text for model files and for NumPy."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from lagcli.arrays import Array

T = TypeVar("T")


class Random:
    """Random numbers as Python's floats, whose `repr` model files can read.

    Parameters
    ----------
    *seed : int
    """

    def __init__(self, *seed: int):
        self._random = np.random.default_rng(seed)

    def random(self) -> float:
        """Return a number in [0, 1)."""
        return float(self._random.random())

    def uniform(self, low: float, high: float) -> float:
        """Return a number in [low, high)."""
        return float(self._random.uniform(low, high))

    def array(self, low: float, high: float, shape: int | tuple[int, ...]) -> Array:
        """Return an array of such numbers."""
        return self._random.uniform(low, high, shape)

    def integer(self, count: int) -> int:
        """Return a whole number below ``count``."""
        return int(self._random.integers(0, count))

    def choice(self, values: Sequence[T]) -> T:
        """Return one of the values."""
        return values[self.integer(len(values))]


#: How NumPy reads what model files call by other names.
_NAMES = {
    **{
        n: getattr(np, n)
        for n in ("sin", "cos", "tan", "exp", "log", "sqrt", "floor", "sign", "abs")
    },
    "pi": math.pi,
    "min": np.minimum,
    "max": np.maximum,
}
#: Rounding of the values of a function, relative to its largest terms.
_NOISE = 4e-15


class Function(NamedTuple):
    """A function of z with its sign changes.

    Parameters
    ----------
    text : str
        With ``{z}`` for the variable.
    roots : array
        Where its sign changes, or jumps, increasing.
    size : float
        Size of its largest terms, whose rounding moves the roots.
    slope : array, optional
        Its derivative at the roots, where difference quotients do not give it.
    """

    text: str
    roots: Array
    size: float = 1.0
    slope: Array | None = None

    def value(self, z: Array) -> Array:
        """Return its values."""
        found = eval(self.text.format(z="z"), dict(_NAMES), {"z": z})
        return np.asarray(found, dtype=float)

    def signs(self) -> Array:
        """Return the signs of the function between its roots, from left to right."""
        edges = np.concatenate([[0.0], self.roots, [1.0]])
        return np.asarray(np.sign(self.value((edges[1:] + edges[:-1]) / 2)))

    def slack(self) -> Array:
        """Return how much rounding may move each root."""
        slope = self.slope
        if slope is None:
            gaps = np.diff(np.concatenate([[-1.0], self.roots, [2.0]]))
            h = np.minimum(1e-6, np.minimum(gaps[1:], gaps[:-1]) / 10)
            ahead, behind = self.value(self.roots + h), self.value(self.roots - h)
            slope = (ahead - behind) / (2 * h)
        return _NOISE * self.size / np.maximum(np.abs(slope), 1e-300) + 1e-15


class Unsuitable(Exception):
    """A random function whose roots are too close to each other or to the ends: try another."""


def apart(roots: Array, gap: float, edge: float = 1e-6) -> Array:
    """Return the roots within (0, 1), in order, if they are apart and not at the ends."""
    roots = np.sort(roots[(roots > -edge) & (roots < 1 + edge)])
    if len(roots) and (roots[0] < edge or roots[-1] > 1 - edge):
        raise Unsuitable
    if len(roots) > 1 and np.diff(roots).min() < gap:
        raise Unsuitable
    return roots


def level_roots(w: float, phase: float, level: float) -> Array:
    """Return the z in (−0.1, 1.1) with sin(w z + phase) = level, for abs(level) < 1."""
    a = math.asin(level)
    k = np.arange(math.floor(phase / math.tau) - 2, math.ceil((phase + 1.1 * w) / math.tau) + 2)
    roots = np.concatenate([a + math.tau * k - phase, math.pi - a + math.tau * k - phase]) / w
    return np.sort(roots[(roots > -0.1) & (roots < 1.1)])


def frequency(random: Random, most: float = 200.0) -> float:
    """Return the angular frequency of 1 to 200 periods."""
    return float(math.tau * np.exp(random.uniform(0, math.log(most))))


def number(value: float) -> str:
    """Return a number as text that keeps all digits."""
    return f"{float(value)!r}" if value >= 0 else f"({float(value)!r})"


def cubic(random: Random, _fine: bool) -> Function:
    """Three random roots, sometimes two of them close, factored or expanded."""
    roots = random.array(0.01, 0.99, 3)
    factored = random.random() < 0.4
    if random.random() < 0.5:
        low = -9 if factored else -5
        roots[1] = roots[0] + 10 ** random.uniform(low, -1)
    roots = apart(roots, 1e-10)
    if len(roots) < 3:
        raise Unsuitable
    scale = random.choice([-1, 1]) * 10 ** random.uniform(-3, 3)
    a, b, c = (float(x) for x in roots)
    slope = scale * np.array([(a - b) * (a - c), (b - a) * (b - c), (c - a) * (c - b)])
    if factored:
        text = "*".join(f"({{z}} - {number(x)})" for x in (a, b, c))
        # each difference is exact but for the rounding of z itself
        return Function(f"{number(scale)}*{text}", roots, 1e-3 * abs(scale), slope)
    c2, c1, c0 = -(a + b + c), a * b + b * c + a * c, -a * b * c
    if random.random() < 0.5:
        text = f"((({{z}} + {number(c2)})*{{z}} + {number(c1)})*{{z}} + {number(c0)})"
    else:
        text = f"({{z}}*{{z}}*{{z}} + {number(c2)}*{{z}}*{{z}} + {number(c1)}*{{z}} + {number(c0)})"
    return Function(f"{number(scale)}*{text}", roots, 3 * abs(scale), slope)


def chebyshev(random: Random, _fine: bool) -> Function:
    """T_n(2 z − 1), by its recurrence."""
    n = 3 + random.integer(6)
    u = "(2*{z} - 1)"
    before, last = "1", u
    for _ in range(n - 1):
        before, last = (
            last,
            f"(2*{u}*{last} - {before})" if before != "1" else f"(2*{u}*{last} - 1)",
        )
    roots = (np.cos((np.arange(n) + 0.5) / n * math.pi) + 1) / 2
    return Function(last, np.sort(roots), 10.0)


def sine(random: Random, _fine: bool) -> Function:
    """A sine that crosses a level."""
    w, phase, level = frequency(random), random.uniform(0, 6), random.uniform(-0.99, 0.99)
    roots = apart(level_roots(w, phase, level), 1e-5 / w)
    return Function(f"sin({number(w)}*{{z}} + {number(phase)}) - {number(level)}", roots, 1 + w / 6)


def near_touch(random: Random, fine: bool) -> Function:
    """A sine whose peaks cross a level by 1e-3 to 1e-6, or to 1e-9."""
    w, phase = frequency(random), random.uniform(0, 6)
    level = (1 - 10 ** random.uniform(-9 if fine else -6, -3)) * random.choice([-1, 1])
    roots = apart(level_roots(w, phase, level), 1e-9)
    return Function(f"sin({number(w)}*{{z}} + {number(phase)}) - {number(level)}", roots, 1 + w / 6)


def product(random: Random, _fine: bool) -> Function:
    """Two sines."""
    w, v = frequency(random), frequency(random)
    p, q = random.array(0, 6, 2)
    roots = apart(np.concatenate([level_roots(w, p, 0), level_roots(v, q, 0)]), 1e-7)
    first, second = (f"sin({number(f)}*{{z}} + {number(a)})" for f, a in ((w, p), (v, q)))
    return Function(f"{first}*{second}", roots, 1 + (w + v) / 6)


def beat(random: Random, _fine: bool) -> Function:
    """The sum of two sines of nearly the same frequency."""
    w = frequency(random)
    v = w * (1 + 10 ** random.uniform(-3, -1))
    p, q = random.array(0, 6, 2)
    fast = level_roots((w + v) / 2, (p + q) / 2, 0)
    slow = level_roots((v - w) / 2, (q - p) / 2 + math.pi / 2, 0)
    roots = apart(np.concatenate([fast, slow]), 1e-5)
    first, second = (f"sin({number(f)}*{{z}} + {number(a)})" for f, a in ((w, p), (v, q)))
    return Function(f"{first} + {second}", roots, 1 + w / 6)


def absolute(random: Random, _fine: bool) -> Function:
    """The absolute value of a sine."""
    w, phase, level = frequency(random), random.uniform(0, 6), random.uniform(0.01, 0.99)
    found = np.concatenate([level_roots(w, phase, level), level_roots(w, phase, -level)])
    text = f"abs(sin({number(w)}*{{z}} + {number(phase)})) - {number(level)}"
    return Function(text, apart(found, 1e-6 / w), 1 + w / 6)


def square(random: Random, _fine: bool) -> Function:
    """A square wave."""
    w, phase, level = frequency(random), random.uniform(0, 6), random.choice([-0.5, 0.5])
    roots = apart(level_roots(w, phase, 0), 1e-5 / w)
    text = f"sign(sin({number(w)}*{{z}} + {number(phase)})) - {number(level)}"
    return Function(text, roots, w / 6, np.full(len(roots), w))


def sawtooth(random: Random, _fine: bool) -> Function:
    """Pulses of a duty cycle down to 0.1 %, by `floor`."""
    n, phase = float(np.exp(random.uniform(0, math.log(200)))), random.uniform(0.05, 0.95)
    duty = float(10 ** random.uniform(-3, -0.05))
    k = np.arange(int(n) + 3)
    roots = apart(np.concatenate([k - phase, k + duty - phase]) / n, 1e-7)
    y = f"({number(n)}*{{z}} + {number(phase)})"
    return Function(f"{y} - floor({y}) - {number(duty)}", roots, n + 1, np.full(len(roots), n))


def touch(random: Random, _fine: bool) -> Function:
    """A factor that touches zero without a change of sign, times one that changes it once."""
    c = float(random.uniform(0.05, 0.95))
    if random.random() < 0.5:
        w, phase = frequency(random), random.uniform(0, 6)
        text = f"(1 - sin({number(w)}*{{z}} + {number(phase)}))*({{z}} - {number(c)})"
        away = abs((w * c + phase - math.pi / 2) % math.tau - math.pi)
        if away > math.pi - 0.1:
            raise Unsuitable
    else:
        a = float(random.uniform(0.05, 0.95))
        if abs(a - c) < 0.01:
            raise Unsuitable
        text = f"({{z}} - {number(a)})*({{z}} - {number(a)})*({{z}} - {number(c)})"
    return Function(text, np.array([c]), 1e-3)


def only_touches(random: Random, _fine: bool) -> Function:
    """A function that touches zero, exactly or to rounding, and never changes its sign."""
    sign = "" if random.random() < 0.5 else "-"
    kind = random.integer(3)
    w, a = frequency(random), float(random.uniform(0.05, 0.95))
    if kind == 0:
        return Function(f"{sign}(sin({number(w)}*{{z}} + 1) - 1)", np.empty(0))
    if kind == 1:
        return Function(
            f"{sign}({{z}}*{{z}} - {number(2 * a)}*{{z}} + {number(a * a)})", np.empty(0)
        )
    return Function(f"{sign}abs(sin({number(w)}*{{z}} + {number(a)}))", np.empty(0))


def never(random: Random, _fine: bool) -> Function:
    """A function that stays close to zero."""
    w, gap = frequency(random), 10 ** random.uniform(-6, -1)
    sign = random.choice([-1, 1])
    text = f"sin({number(w)}*{{z}} + 1) - {number(sign * (1 + gap))}"
    return Function(text, np.empty(0))


def rational(random: Random, _fine: bool) -> Function:
    """Square roots, logarithms, exponentials and quotients of a sine."""
    w, phase, level = frequency(random, 50), random.uniform(0, 6), random.uniform(-0.9, 0.9)
    y = f"sin({number(w)}*{{z}} + {number(phase)})"
    forms = {
        f"sqrt(2 + {y}) - {number(math.sqrt(2 + level))}": 2.0,
        f"log(1.5 + {y}) - {number(math.log(1.5 + level))}": 2.0,
        f"exp({y}) - {number(math.exp(level))}": 3.0,
        f"1/(2 + {y}) - {number(1 / (2 + level))}": 2.0,
        f"({y} - {number(level)})/(1.1 + cos(7*{{z}}))": 1.0,
    }
    text = random.choice(list(forms))
    roots = apart(level_roots(w, phase, level), 1e-5 / w)
    return Function(text, roots, forms[text] * (1 + w / 6))


def positive_factor(random: Random, _fine: bool) -> Function:
    """A sine times a sum of twenty positive terms."""
    w, phase = frequency(random), random.uniform(0, 6)
    terms = [
        f"{random.uniform(0.5, 1)!r}*(1.5 + cos({v * w!r}*{{z}} + {random.uniform(0, 6)!r}))"
        for v in random.array(0.1, 2, 20).tolist()
    ]
    roots = apart(level_roots(w, phase, 0), 1e-5 / w)
    text = f"sin({number(w)}*{{z}} + {number(phase)})*({' + '.join(terms)})"
    return Function(text, roots, 40 * (1 + w / 6))


def tangent(random: Random, _fine: bool) -> Function:
    """A tangent, which changes its sign at poles, too."""
    w, phase = frequency(random, 50), random.uniform(0.1, 1.4)
    roots = apart(level_roots(2 * w, 2 * phase, 0), 1e-5 / w)
    return Function(
        f"tan({number(w)}*{{z}} + {number(phase)})", roots, w / 6, np.full(len(roots), w)
    )


#: Kinds of functions by name.
FUNCTIONS: dict[str, Callable[[Random, bool], Function]] = {
    f.__name__: f
    for f in (
        *(cubic, chebyshev, sine, near_touch, product, beat, absolute, square, sawtooth, touch),
        *(only_touches, never, rational, positive_factor, tangent),
    )
}


def random_function(name: str, random: Random, fine: bool) -> Function:
    """Return a function of a kind.

    Parameters
    ----------
    name : str
    random : Generator
    fine : bool
        Whether z is known to rounding, so that near touches may be nearer.
    """
    for _ in range(1000):
        try:
            return FUNCTIONS[name](random, fine)
        except Unsuitable:
            pass
    raise AssertionError(name)
