"""Random models, and what they mean by a second way: mpmath and difference quotients.

A model is made as trees of tuples. `Writer` prints them in the language of model files, with as few
parentheses as its precedence allows; `Meaning` evaluates the trees themselves, with 70 digits. All
derivatives are central differences of values: nothing is differentiated by rule, and nothing here
uses the package.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import mpmath
from mpmath import mp, mpf

Tree = tuple[Any, ...]

mp.dps = 70
STEP = mpf(10) ** -15  # the error of a central difference is some STEP², that of rounding 10⁻⁴⁰

# ways to write a function of any argument within its domain, and how many arguments it takes
_SAFE = {
    "sin": "sin({0})",
    "cos": "cos({0})",
    "tan": "tan(0.7*sin({0}))",
    "asin": "asin(0.9*sin({0}))",
    "acos": "acos(0.8*cos({0}))",
    "atan": "atan({0})",
    "sinh": "sinh(sin({0}))",
    "cosh": "cosh(cos({0}))",
    "tanh": "tanh({0})",
    "asinh": "asinh({0})",
    "acosh": "acosh(1.5 + {0}^2)",
    "atanh": "atanh(0.9*sin({0}))",
    "exp": "exp(sin({0}))",
    "exp2": "exp2(cos({0}))",
    "expm1": "expm1(sin({0}))",
    "log": "log(1.2 + {0}^2)",
    "log10": "log10(0.3 + {0}^2)",
    "log2": "log2(0.7 + {0}^2)",
    "log1p": "log1p({0}^2)",
    "sqrt": "sqrt(0.4 + {0}^2)",
    "cbrt": "cbrt({0})",
    "abs": "abs({0})",
    "fabs": "fabs({0})",
    "sign": "sign({0})",
    "step": "step({0})",
    "floor": "floor({0})",
    "ceil": "ceil({0})",
    "erf": "erf({0})",
    "erfc": "erfc({0})",
    "degrees": "degrees(0.01*{0})",
    "radians": "radians(20*{0})",
    "atan2": "atan2({0}, {1})",
    "pow": "pow(1.1 + {0}^2, {1})",
    "hypot": "hypot({0}, {1}, 0.6)",
    "min": "min({0}, {1}, 0.2)",
    "max": "max({0}, {1})",
}
FUNCTIONS = frozenset(_SAFE)


def applied(function: str, *arguments: Tree) -> Tree:
    """Return the tree of a function of any arguments, by one of the patterns above."""
    return _parsed(_SAFE[function], list(arguments))


def _parsed(pattern: str, arguments: list[Tree]) -> Tree:
    import ast

    names = [f"_{i}" for i in range(len(arguments))]
    code = pattern.format(*names).replace("^", "**")

    def tree(node: ast.expr) -> Tree:
        match node:
            case ast.Constant():
                return ("number", str(node.value))
            case ast.Name():
                return arguments[names.index(node.id)]
            case ast.Call(func=ast.Name(id=function)):
                return ("call", function, *map(tree, node.args))
            case ast.BinOp():
                sign = {"Add": "+", "Mult": "*", "Pow": "^"}[type(node.op).__name__]
                return (sign, tree(node.left), tree(node.right))
        raise AssertionError(ast.dump(node))

    return tree(ast.parse(code, mode="eval").body)


class RandomModel:
    """A model whose parts are trees."""

    def __init__(self, seed: int):
        self.random = random.Random(seed)
        self.used: set[str] = set()
        self.sums = 0  # how many there are around what is being made
        chance = self.random
        count = chance.choice([1, 2, 2, 2, 3])
        self.family = chance.random() < 0.25
        names = ["x", "y", "phi", "E", "gamma", "N", "Q2", "s_1"]
        chance.shuffle(names)
        self.coordinates = [f"u[{i + 1}]" for i in range(count)] if self.family else names[:count]
        self.parameters = {n: f"{chance.uniform(0.3, 2):.3g}" for n in ["m", "a", "b"]}
        self.definitions: dict[str, Tree] = {}
        self.shapes: dict[str, str] = {}
        for i in range(chance.randrange(4)):
            shape = chance.choice(["scalar", "scalar", "plane", "space", "rotation"])
            make = {"scalar": self.still, "plane": self.plane, "space": self.space}
            self.definitions[f"d{i}"] = make.get(shape, self.rotation)(2)
            self.shapes[f"d{i}"] = shape
        self.kinetic = self.kinetic_energy()
        self.potential = self.affine(2) if chance.random() < 0.4 else self.still(3)
        self.dissipation = self.moving(2) if chance.random() < 0.4 else None
        self.forces = self.generalized_forces()
        self.constraints: dict[str, tuple[str, Tree, Tree]] = {}
        for i in range(chance.choice([0, 1, 1, 2])):
            if chance.random() < 0.5:
                self.constraints[f"c{i}"] = ("holonomic", self.with_motion(), self.still(2))
            else:
                velocity = ("velocity", chance.choice(self.coordinates))
                left = ("+", ("*", self.coefficient(), velocity), self.affine(2))
                self.constraints[f"c{i}"] = ("nonholonomic", left, self.affine(1))
        self.outputs = {f"o{i}": self.output() for i in range(2)}

    # parts of a model

    def kinetic_energy(self) -> Tree:
        half: Tree = ("/", ("name", "m"), ("number", "2"))
        terms = [("*", half, ("^", ("velocity", q), ("number", "2"))) for q in self.coordinates]
        for _ in range(self.random.randrange(4)):
            terms.append(self.energy_term())
        return _sum(*terms)

    def energy_term(self) -> Tree:
        kind = self.random.randrange(6)
        primed = [d for d, shape in self.shapes.items() if shape != "rotation"]
        turned = [d for d, shape in self.shapes.items() if shape == "rotation"]
        if kind == 0 and primed:
            rate = ("rate", self.random.choice(primed), 1)
            if self.shapes[rate[1]] == "scalar":
                return ("*", self.still(1), ("^", rate, ("number", "2")))
            return ("*", ("name", "m"), ("dot", rate, rate))
        if kind == 1 and turned:
            name = ("name", self.random.choice(turned))
            rotation = ("*", name, self.rotation(1)) if self.random.random() < 0.5 else name
            omega = ("omega", rotation)
            return ("*", ("name", "a"), ("dot", omega, omega))
        if kind == 2:
            return self.moving(2)
        if kind == 3:
            return ("*", self.still(2), ("^", self.affine(2), ("number", "2")))
        return ("*", self.still(2), ("*", self.affine(1), self.affine(2)))

    def generalized_forces(self) -> dict[str, Tree]:
        found = {q: self.moving(2) for q in self.coordinates if self.random.random() < 0.4}
        for name, shape in self.shapes.items():
            if shape != "rotation" and self.random.random() < 0.5:
                size = {"scalar": 1, "plane": 2, "space": 3}[shape]
                force = [self.moving(1) for _ in range(size)]
                found[name] = force[0] if size == 1 else ("vector", *force)
        return found

    def output(self) -> Tree:
        chance = self.random
        extra: Tree = ("acceleration", chance.choice(self.coordinates))
        scalars = [d for d, shape in self.shapes.items() if shape == "scalar"]
        if self.constraints and chance.random() < 0.6:
            c, q = chance.choice(list(self.constraints)), chance.choice(self.coordinates)
            extra = chance.choice([("multiplier", c), ("reaction", q), ("reaction", q, c)])
        elif scalars and chance.random() < 0.5:
            extra = ("rate", chance.choice(scalars), 2)
        return ("+", self.moving(2), ("*", self.moving(1), extra))

    # expressions

    def number(self) -> Tree:
        chance = self.random
        text = chance.choice(["1", "2", "3", "0.5", "1e-1", f"{chance.uniform(0.1, 3):.3g}", ".7"])
        return ("number", text)

    def leaf(self, velocities: bool) -> Tree:
        chance = self.random
        kind = chance.randrange(8 if velocities else 6)
        if kind == 0:
            return self.number()
        if kind == 1:
            return ("name", chance.choice(list(self.parameters)))
        if kind == 2:
            return ("time",) if chance.random() < 0.7 else ("pi",)
        scalars = [d for d, shape in self.shapes.items() if shape == "scalar"]
        if kind == 3 and scalars:
            if velocities and chance.random() < 0.5:
                return ("rate", chance.choice(scalars), 1)
            return ("name", chance.choice(scalars))
        q = chance.choice(self.coordinates)
        return ("velocity", q) if kind > 5 else ("coordinate", q)

    def expression(self, depth: int, velocities: bool) -> Tree:
        chance = self.random
        if depth == 0 or chance.random() < 0.1:
            return self.leaf(velocities)

        def inner() -> Tree:
            return self.expression(depth - 1, velocities)

        kind = chance.randrange(10)
        if kind < 3:
            return (chance.choice("+-*"), inner(), inner())
        if kind == 3:
            return ("/", inner(), ("+", ("number", "1.3"), ("^", inner(), ("number", "2"))))
        if kind == 4:
            exponents = ["2", "3", "2", "1"]
            return ("^", inner(), ("number", chance.choice(exponents)))
        if kind == 5:
            return ("negative", inner())
        if kind == 6:
            return ("if", self.condition(depth - 1, velocities), inner(), inner())
        if kind == 7 and any(shape != "rotation" for shape in self.shapes.values()):
            return self.scalar_of_vectors(velocities)
        if kind == 8 and chance.random() < 0.3:
            index = "ijkl"[self.sums]
            self.sums += 1
            term = ("*", inner(), ("^", ("index", index), ("number", "2")))
            self.sums -= 1
            return ("sum", term, index, 1, chance.choice([1, 2, 3]))
        name = chance.choice(list(_SAFE))
        self.used.add(name)
        return applied(name, inner(), inner())

    def condition(self, depth: int, velocities: bool) -> Tree:
        chance = self.random
        sign = chance.choice(["<", "<=", ">", ">="])
        parts = (self.expression(depth, velocities), self.expression(depth, velocities))
        compared = ("compare", sign, *parts)
        if chance.random() < 0.3:
            return (chance.choice(["and", "or"]), compared, self.condition(0, velocities))
        return ("not", compared) if chance.random() < 0.15 else compared

    def scalar_of_vectors(self, velocities: bool) -> Tree:
        chance = self.random
        name = chance.choice([d for d, shape in self.shapes.items() if shape != "rotation"])
        if self.shapes[name] == "scalar":
            return ("name", name)
        vector: Tree = ("name", name)
        if self.shapes[name] == "plane":
            other: Tree = ("vector", self.leaf(velocities), self.leaf(velocities))
        else:
            other = ("vector", *[self.leaf(velocities) for _ in range(3)])
            if chance.random() < 0.5:
                other = ("cross", other, vector)
            turns = [d for d, shape in self.shapes.items() if shape == "rotation"]
            if turns and chance.random() < 0.5:
                turn: Tree = ("name", chance.choice(turns))
                other = ("*", ("transpose", turn) if chance.random() < 0.5 else turn, other)
        if chance.random() < 0.3:
            return ("norm", ("+", other, vector))
        return ("dot", other, vector)

    def still(self, depth: int) -> Tree:
        return self.expression(depth, velocities=False)

    def moving(self, depth: int) -> Tree:
        return self.expression(depth, velocities=True)

    def with_motion(self) -> Tree:
        """Return an expression in which a coordinate certainly occurs."""
        return ("+", ("coordinate", self.random.choice(self.coordinates)), self.still(2))

    def coefficient(self) -> Tree:
        return ("+", ("number", "3.7"), ("call", "sin", self.still(2)))

    def affine(self, depth: int) -> Tree:
        """Return an expression affine in the velocities, written in one of many ways."""
        chance = self.random
        if depth == 0:
            velocity = ("velocity", chance.choice(self.coordinates))
            return chance.choice([velocity, velocity, self.leaf(False)])

        def inner() -> Tree:
            return self.affine(depth - 1)

        match chance.randrange(9):
            case 0 | 1:
                return (chance.choice("+-"), inner(), inner())
            case 2 | 3:
                return ("*", self.still(2), inner())
            case 4:
                return ("/", inner(), ("+", ("number", "1.3"), ("call", "abs", self.still(1))))
            case 5:
                return ("if", self.condition(1, False), inner(), inner())
            case 6:
                one, two = inner(), self.still(1)
                square = ("^", ("+", one, two), ("number", "2"))
                return ("-", square, ("^", one, ("number", "2")))  # 2·one·two + two²
            case 7:
                return ("negative", inner())
        return ("+", inner(), self.still(2))

    def plane(self, depth: int) -> Tree:
        return ("vector", self.still(depth), self.still(depth))

    def space(self, depth: int) -> Tree:
        return ("vector", *[self.still(depth - 1) for _ in range(3)])

    def rotation(self, depth: int) -> Tree:
        chance = self.random
        turns = [d for d, shape in self.shapes.items() if shape == "rotation"]
        parts: list[Tree] = []
        for _ in range(chance.choice([1, 2, 3])):
            kind, angle = chance.randrange(6), self.still(depth - 1)
            if kind == 0 and turns:
                parts.append(("name", chance.choice(turns)))
            elif kind == 1:
                axis = ("vector", ("number", "1"), ("number", "2"), ("number", "2"))
                parts.append(("rot", axis, angle))
            elif kind == 2:
                parts.append(_by_hand(angle))
            else:
                parts.append((chance.choice(["rot_x", "rot_y", "rot_z"]), angle))
        product = parts[0]
        for part in parts[1:]:
            product = ("*", product, part)
        return ("transpose", product) if chance.random() < 0.2 else product

    # the text of the model

    def text(self) -> str:
        """Return the model file."""
        write = Writer(random.Random(self.random.random()), self.family).write
        names = f"u[1..{len(self.coordinates)}]" if self.family else ", ".join(self.coordinates)
        values = ", ".join(f"{name}: {x}" for name, x in self.parameters.items())
        lines = [f"coordinates: [{names}]", f"parameters: {{{values}}}"]
        if self.definitions:
            lines.append("definitions:")
            lines += [f'  {n}: "{write(x)}"' for n, x in self.definitions.items()]
        if self.random.random() < 0.2:
            lines.append(f'L: "{write(("-", self.kinetic, self.potential))}"')
        else:
            lines += [f'T: "{write(self.kinetic)}"', f'V: "{write(self.potential)}"']
        if self.dissipation is not None:
            lines.append(f'D: "{write(self.dissipation)}"')
        if self.forces:
            lines += ["Q:", *(f'  {n}: "{write(x)}"' for n, x in self.forces.items())]
        if self.constraints:
            lines.append("constraints:")
            lines += [
                f'  {n}: "{write(left)} = {write(right)}"'
                for n, (_, left, right) in self.constraints.items()
            ]
        lines.append("initial:")
        lines += [f"  {q}{prime}: {{guess: 0.5}}" for q in self.coordinates for prime in ("", "'")]
        lines += ["outputs:", *(f'  {n}: "{write(x)}"' for n, x in self.outputs.items())]
        return "\n".join(lines) + "\n"


class EveryKey(RandomModel):
    """A model that has one function in every key: of coordinates, of velocities and of t."""

    def __init__(self, function: str):
        def f(*arguments: Tree) -> Tree:
            return applied(function, *arguments)

        self.random = random.Random(function)
        self.family = False
        self.coordinates = ["x", "y"]
        self.parameters = {"m": "1.3"}
        x, y, t = ("coordinate", "x"), ("coordinate", "y"), ("time",)
        vx, vy = ("velocity", "x"), ("velocity", "y")
        moved = ("+", x, t)
        self.definitions = {"d": f(moved, y), "r": ("vector", f(y, t), ("*", x, y))}
        self.shapes = {"d": "scalar", "r": "plane"}
        d, rate = ("name", "d"), ("rate", "d", 1)
        square = ("^", vx, ("number", "2"))
        self.kinetic = _sum(
            ("*", ("name", "m"), ("+", square, ("^", vy, ("number", "2")))),
            ("*", f(("*", x, t), y), square),
            ("*", f(vy, vx), f(x, y)),
            ("*", d, ("*", rate, vy)),
        )
        self.potential = _sum(f(("-", x, t), y), ("*", f(("*", t, y), x), vy), d)
        self.dissipation = ("*", f(vx, y), ("^", vy, ("number", "2")))
        self.forces = {
            "x": f(("*", vx, t), y),
            "d": f(rate, x),
            "r": ("vector", f(t, vx), f(vy, y)),
        }
        holonomic = ("+", x, f(("*", y, t), x))
        nonholonomic = _sum(("*", f(moved, t), vx), ("*", ("number", "5"), vy))
        other = ("+", f(y, t), ("*", f(t, x), vy))
        self.constraints = {
            "c0": ("holonomic", holonomic, f(t, y)),
            "c1": ("nonholonomic", nonholonomic, other),
        }
        self.outputs = {
            "o0": f(("acceleration", "x"), ("multiplier", "c0")),
            "o1": ("*", f(("reaction", "y"), t), ("rate", "d", 2)),
        }


def _sum(*terms: Tree) -> Tree:
    total = terms[0]
    for term in terms[1:]:
        total = ("+", total, term)
    return total


def _by_hand(angle: Tree) -> Tree:
    """Return a rotation about z, written as a matrix."""
    s, c, zero, one = (
        ("call", "sin", angle),
        ("call", "cos", angle),
        ("number", "0"),
        ("number", "1"),
    )
    rows = [
        ("vector", c, ("negative", s), zero),
        ("vector", s, c, zero),
        ("vector", zero, zero, one),
    ]
    return ("vector", *rows)


class Writer:
    """Prints trees in the language of model files."""

    def __init__(self, chance: random.Random, family: bool):
        self.random, self.family = chance, family

    def write(self, tree: Tree, level: int = 0) -> str:
        """Return the text of a tree, in parentheses where its place binds tighter than it does.

        Levels: 0 conditions and sums, 1 terms after a sign, 2 factors, 3 bases of powers.
        """
        binding, text = self.shown(tree)
        return text if binding >= level else f"({text})"

    def shown(self, tree: Tree) -> tuple[int, str]:
        kind, *parts = tree
        write, space = self.write, self.random.choice(["", " "])
        match kind:
            case "number" | "index":
                return 4, parts[0]
            case "name" | "coordinate":
                return 4, self.member(parts[0])
            case "pi":
                return 4, "pi"
            case "time":
                return 4, "t"
            case "velocity":
                return 4, self.primed(parts[0], 1)
            case "acceleration":
                return 4, self.primed(parts[0], 2)
            case "rate":
                return 4, self.primed(parts[0], parts[1])
            case "multiplier":
                return 4, f"lambda.{parts[0]}"
            case "reaction":
                return 4, ".".join(["Qc", *parts[1:], parts[0]])
            case "+" | "-":
                return 0, f"{write(parts[0])}{space}{kind}{space}{write(parts[1], 1)}"
            case "*" | "/":
                return 1, f"{write(parts[0], 1)}{space}{kind}{space}{write(parts[1], 2)}"
            case "^":
                sign = self.random.choice(["^", "**"])
                return 2, f"{write(parts[0], 3)}{sign}{write(parts[1], 2)}"
            case "negative":
                # -a*b is -(a*b), and a*-b needs no parentheses
                return 2 if self.random.random() < 0.5 else 0, f"-{write(parts[0], 2)}"
            case "if":
                return 4, f"if({', '.join(map(write, parts))})"
            case "compare":
                return -1, f"{write(parts[1])} {parts[0]} {write(parts[2])}"
            case "and" | "or":
                return -2, f"{self.operand(parts[0])} {kind} {self.operand(parts[1])}"
            case "not":
                return -1, f"not ({write(parts[0], -9)})"
            case "call":
                return 4, f"{parts[0]}({f',{space}'.join(map(write, parts[1:]))})"
            case "sum":
                term, index, first, last = parts
                return 4, f"sum({write(term)}, {index} = {first}..{last})"
            case "vector":
                return 4, f"[{', '.join(map(write, parts))}]"
        return 4, f"{kind}({', '.join(map(write, parts))})"  # dot, cross, omega, rot_x, …

    def operand(self, tree: Tree) -> str:
        return self.write(tree, -9) if tree[0] == "compare" else f"({self.write(tree, -9)})"

    def member(self, name: str) -> str:
        return name

    def primed(self, name: str, primes: int) -> str:
        if self.random.random() < 0.3:
            suffix = "_dot" if primes == 1 else "_ddot"
            base, bracket, index = name.partition("[")
            return base + suffix + bracket + index if self.random.random() < 0.5 else name + suffix
        return name + "'" * primes


# meaning


class NoValue(Exception):
    """An expression has no real value at a state, or is close to a place where it has none."""


def _real(x: Any) -> mpf:
    if isinstance(x, mpmath.mpc) or not mpmath.isfinite(x):
        raise NoValue
    return x


def _apart(x: mpf, jump: mpf) -> None:
    """Reject a value so close to a jump that doubles may lie on its other side."""
    if x != jump and abs(x - jump) < 1e-12:
        raise NoValue


def _cbrt(x: mpf) -> mpf:
    return mpmath.sign(x) * mpmath.cbrt(abs(x))


_CALLS: dict[str, Callable[..., Any]] = {
    **{
        n: getattr(mpmath, n) for n in ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh")
    },
    **{n: getattr(mpmath, n) for n in ("tanh", "asinh", "acosh", "atanh", "exp", "expm1", "sqrt")},
    **{n: getattr(mpmath, n) for n in ("erf", "erfc", "log1p", "atan2", "log10", "floor", "ceil")},
    **{n: getattr(mpmath, n) for n in ("degrees", "radians", "sign", "log")},
    "exp2": lambda x: mpf(2) ** x,
    "log2": lambda x: mpmath.log(x) / mpmath.log(2),
    "cbrt": _cbrt,
    "abs": abs,
    "fabs": abs,
    "step": lambda x: mpf(x >= 0),
    "pow": lambda x, y: x**y,
    "hypot": lambda *xs: mpmath.sqrt(sum(x * x for x in xs)),
    "min": min,
    "max": max,
}

_COMPARE: dict[str, Callable[[mpf, mpf], bool]] = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
}


class State:
    """Values of t, q, v, a and λ."""

    def __init__(self, t: Any, q: Any, v: Any, a: Any = None, multipliers: Any = None):
        self.t, self.q, self.v = mpf(t), [mpf(x) for x in q], [mpf(x) for x in v]
        self.a = [mpf(x) for x in a] if a is not None else [mpf(0)] * len(self.q)
        self.multipliers = [mpf(x) for x in multipliers] if multipliers is not None else []

    def moved(self, s: mpf, accelerated: bool = True) -> State:
        """Return the state a time s later, along the motion."""
        pairs = zip(self.q, self.v, self.a, strict=True)
        q = [x + s * v + (s * s * a / 2 if accelerated else 0) for x, v, a in pairs]
        return State(self.t + s, q, self.v, self.a, self.multipliers)

    def shifted(self, kind: str, i: int, s: mpf) -> State:
        """Return the state with one q or v, or t, changed."""
        q, v, t = list(self.q), list(self.v), self.t
        if kind == "t":
            t += s
        else:
            (q if kind == "q" else v)[i] += s
        return State(t, q, v, self.a, self.multipliers)


class Meaning:
    """What a random model means, in numbers."""

    def __init__(self, model: RandomModel):
        self.model = model
        self.places = {q: i for i, q in enumerate(model.coordinates)}
        self.parameters = {n: mpf(x) for n, x in model.parameters.items()}
        self.indices: dict[str, int] = {}

    def value(self, tree: Tree, at: State) -> Any:
        kind, *parts = tree
        match kind:
            case "number":
                return mpf(parts[0])
            case "index":
                return mpf(self.indices[parts[0]])
            case "name":
                if parts[0] in self.parameters:
                    return self.parameters[parts[0]]
                return self.value(self.model.definitions[parts[0]], at)
            case "coordinate":
                return at.q[self.places[parts[0]]]
            case "velocity":
                return at.v[self.places[parts[0]]]
            case "acceleration":
                return at.a[self.places[parts[0]]]
            case "time":
                return at.t
            case "pi":
                return +mpmath.pi
            case "rate":
                return self.rate(self.model.definitions[parts[0]], parts[1], at)
            case "multiplier":
                return at.multipliers[list(self.model.constraints).index(parts[0])]
            case "reaction":
                return self.reaction(at, *parts)
            case "if":
                return self.value(parts[1] if self.holds(parts[0], at) else parts[2], at)
            case "sum":
                term, index, first, last = parts
                total, outside = mpf(0), self.indices
                for k in range(first, last + 1):
                    self.indices = {**outside, index: k}
                    total += self.value(term, at)
                self.indices = outside
                return total
        values = [self.value(p, at) for p in parts if not isinstance(p, str)]
        match kind:
            case "+":
                return _combined(values[0], values[1], 1)
            case "-":
                return _combined(values[0], values[1], -1)
            case "*":
                return _product(*values)
            case "/":
                return _real(values[0] / values[1])
            case "^":
                return _real(values[0] ** values[1])
            case "negative":
                return -values[0]
            case "call":
                if parts[0] in ("floor", "ceil", "sign", "step"):
                    _apart(values[0], mpmath.nint(values[0]))
                try:
                    return _real(_CALLS[parts[0]](*values))
                except (ValueError, ZeroDivisionError, OverflowError):
                    raise NoValue from None
            case "vector":
                return values
            case "dot":
                return _dot(*values)
            case "norm":
                return mpmath.sqrt(_dot(values[0], values[0]))
            case "cross":
                (a, b, c), (x, y, z) = values
                return [b * z - c * y, c * x - a * z, a * y - b * x]
            case "transpose":
                return _transposed(values[0])
            case "rot":
                return _turn(*values)
            case "rot_x" | "rot_y" | "rot_z":
                return _turn([mpf(kind == f"rot_{x}") for x in "xyz"], values[0])
            case "omega":
                r, rate = values[0], self.rate(parts[0], 1, at)
                spin = _product(_transposed(r), rate)
                return [spin[2][1], spin[0][2], spin[1][0]]
        raise AssertionError(tree)

    def holds(self, tree: Tree, at: State) -> bool:
        kind, *parts = tree
        if kind == "compare":
            left, right = self.value(parts[1], at), self.value(parts[2], at)
            _apart(left, right)
            return _COMPARE[parts[0]](left, right)
        if kind == "not":
            return not self.holds(parts[0], at)
        both = [self.holds(p, at) for p in parts]
        return all(both) if kind == "and" else any(both)

    def rate(self, tree: Tree, order: int, at: State) -> Any:
        """Return the first or second total time derivative."""
        after, before = (self.value(tree, at.moved(s)) for s in (STEP, -STEP))
        if order == 1:
            return _scaled(_combined(after, before, -1), 1 / (2 * STEP))
        middle = self.value(tree, at)
        return (after - 2 * middle + before) / STEP**2

    def slope(self, f: Callable[[State], Any], at: State, kind: str, i: int = 0) -> Any:
        """Return a partial derivative with respect to q_i, v_i or t."""
        after, before = (f(at.shifted(kind, i, s)) for s in (STEP, -STEP))
        return _scaled(_combined(after, before, -1), 1 / (2 * STEP))

    def reaction(self, at: State, coordinate: str, constraint: str | None = None) -> mpf:
        rows, j = self.jacobian(at), self.places[coordinate]
        chosen = [
            at.multipliers[i] * rows[i][j]
            for i, name in enumerate(self.model.constraints)
            if constraint in (None, name)
        ]
        return sum(chosen, mpf(0))

    # the equations

    def lagrangian(self, at: State) -> mpf:
        return self.value(self.model.kinetic, at) - self.value(self.model.potential, at)

    def momentum(self, at: State, i: int) -> mpf:
        return self.slope(self.lagrangian, at, "v", i)

    def mass_matrix(self, at: State) -> list[list[mpf]]:
        k = len(at.q)
        return [
            [self.slope(lambda s, i=i: self.momentum(s, i), at, "v", j) for j in range(k)]
            for i in range(k)
        ]

    def applied(self, at: State) -> list[mpf]:
        """Return Q, that of the dissipation function included."""
        model, k = self.model, len(at.q)
        found = [mpf(0)] * k
        for name, force in model.forces.items():
            value = self.value(force, at)
            if name in self.places:
                found[self.places[name]] += value
                continue
            place = ("name", name)
            for i in range(k):
                along = self.slope(lambda s: self.value(place, s), at, "q", i)  # noqa: B023
                found[i] += _dot(value, along) if isinstance(value, list) else value * along
        dissipation = model.dissipation
        if dissipation is not None:
            for i in range(k):
                found[i] -= self.slope(lambda s: self.value(dissipation, s), at, "v", i)
        return found

    def forcing(self, at: State) -> list[mpf]:
        found = []
        for i, force in enumerate(self.applied(at)):
            later, sooner = (self.momentum(at.moved(s, False), i) for s in (STEP, -STEP))
            rate = (later - sooner) / (2 * STEP)
            found.append(self.slope(self.lagrangian, at, "q", i) - rate + force)
        return found

    def residual(self, name: str, at: State) -> mpf:
        _, left, right = self.model.constraints[name]
        return self.value(left, at) - self.value(right, at)

    def jacobian(self, at: State) -> list[list[mpf]]:
        rows = []
        for name, (kind, *_) in self.model.constraints.items():
            by = "q" if kind == "holonomic" else "v"
            rows.append(
                [
                    self.slope(lambda s, n=name: self.residual(n, s), at, by, j)
                    for j in range(len(at.q))
                ]
            )
        return rows

    def constraint_rates(self, at: State) -> tuple[list[mpf], list[mpf]]:
        """Return ψ and γ."""
        velocities, rhs = [], []
        for name, (kind, *_) in self.model.constraints.items():
            here = self.residual(name, at)
            later, sooner = (self.residual(name, at.moved(s, False)) for s in (STEP, -STEP))
            if kind == "holonomic":
                velocities.append((later - sooner) / (2 * STEP))
                rhs.append(-(later - 2 * here + sooner) / STEP**2)
            else:
                velocities.append(here)
                rhs.append(-(later - sooner) / (2 * STEP))
        return velocities, rhs

    def energy(self, at: State) -> mpf:
        """Return v·p − L."""
        momenta = [self.momentum(at, i) for i in range(len(at.q))]
        return _dot(at.v, momenta) - self.lagrangian(at)


def _dot(a: list[mpf], b: list[mpf]) -> mpf:
    return sum((x * y for x, y in zip(a, b, strict=True)), mpf(0))


def _combined(a: Any, b: Any, sign: int) -> Any:
    if isinstance(a, list):
        return [_combined(x, y, sign) for x, y in zip(a, b, strict=True)]
    return a + sign * b


def _scaled(a: Any, factor: mpf) -> Any:
    return [_scaled(x, factor) for x in a] if isinstance(a, list) else a * factor


def _transposed(a: list[list[mpf]]) -> list[list[mpf]]:
    return [list(column) for column in zip(*a, strict=True)]


def _product(a: Any, b: Any) -> Any:
    if not isinstance(a, list):
        return _scaled(b, a)
    if not isinstance(b[0], list):
        return [_dot(row, b) for row in a]
    return [[_dot(row, column) for column in _transposed(b)] for row in a]


def _turn(axis: list[mpf], angle: mpf) -> list[list[mpf]]:
    """Return a rotation: each unit vector turned by Rodrigues' formula."""
    length = mpmath.sqrt(_dot(axis, axis))
    n = [x / length for x in axis]
    s, c = mpmath.sin(angle), mpmath.cos(angle)
    columns = []
    for i in range(3):
        e = [mpf(i == j) for j in range(3)]
        turned = [n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0]]
        columns.append([c * e[j] + s * turned[j] + (1 - c) * n[i] * n[j] for j in range(3)])
    return _transposed(columns)
