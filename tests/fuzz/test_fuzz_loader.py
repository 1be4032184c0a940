"""Whatever stands in a file: a model, or LagcliError, soon.

What the loader accepts must also be derived without a crash. SymEngine can end the process (the
floor of an infinity does); such a failure shows as a crash of the test run.
"""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from lagcli.equations.derivation.lagrange import derive
from lagcli.errors import LagcliError, ModelError
from lagcli.functions import FUNCTIONS
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.units import UnknownUnit, to_si
from lagcli.model.loader import load, load_text
from lagcli.model.names.building import TENSOR_FUNCTIONS

MODELS = Path(__file__).parents[2] / "models"
TEXTS = [p.read_text(encoding="utf-8") for p in sorted(MODELS.rglob("*.yaml"))]
SECONDS = 2.0  # for the loader

RELAXED = settings(
    deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture]
)


def check(error: ModelError, text: str) -> None:
    """Hold the diagnostics to lie in the text."""
    ends = sum(map(text.count, "\n\r\x85\u2028\u2029"))
    for d in error.diagnostics:
        assert d.message
        if d.location is not None and d.location.text:
            assert 1 <= d.location.line <= ends + 1
            assert 1 <= d.location.column <= len(d.location.text) + 1
    assert str(error)


def survive(text: str, derived: bool = True) -> None:
    """Load a text, soon; ModelError may come."""
    began = time.process_time()
    try:
        model = load_text(text, "f")
    except ModelError as error:
        check(error, text)
    else:
        if derived:
            derive(model)
    assert time.process_time() - began < SECONDS


# text

PIECES = st.sampled_from(
    [
        *(":", ": ", "\n", "  ", "\t", "- ", "[", "]", "{", "}", ",", "'", '"', "|", ">", "#"),
        *("&a ", "*a", "!!x ", "?", "%", "@", "`", "---\n", "\r", "\x00", "\ufeff", "\x85"),
        *("é", "高", "\ud800", "²", "(", ")", "^", "*", "/", "+", "-", "=", "==", "<", "x", "T"),
        *("V", "initial", "x'", "x''", "1e999", "9^9^9^9", "0x1", "1_0", ".inf", "~", "null"),
        *("lambda.rod", "if(", "guess", "deg"),
    ]
)


@st.composite
def mutated(draw: st.DrawFn) -> str:
    """A shipped model with a few pieces cut out, put in, doubled or exchanged."""
    text = draw(st.sampled_from(TEXTS))
    text = text[text.index("name:") :]
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.integers(0, 30)))
        match draw(st.sampled_from(["cut", "insert", "double", "replace", "move"])):
            case "cut":
                text = text[:start] + text[end:]
            case "insert":
                text = text[:start] + draw(PIECES) + text[start:]
            case "double":
                text = text[:end] + text[start:end] + text[end:]
            case "replace":
                text = text[:start] + draw(PIECES) + text[end:]
            case _:
                piece, rest = text[start:end], text[:start] + text[end:]
                to = draw(st.integers(0, len(rest)))
                text = rest[:to] + piece + rest[to:]
    return text


@settings(RELAXED, max_examples=60)
@given(mutated())
def test_mutated_models(text: str) -> None:
    survive(text, derived=False)


@settings(RELAXED, max_examples=60)
@given(st.lists(PIECES, max_size=40).map("".join))
@example("a: &a [*a]")
@example("{" * 1000)
@example("a: &a {b: *a}\n")
@example("- " * 1000)
@example("? " * 1000)
def test_soups_of_yaml(text: str) -> None:
    survive(text)


@settings(RELAXED, max_examples=50)
@given(st.binary(max_size=300))
@example(b"\xff\xfea\x00")
@example(b"\xef\xbb\xbf")
@example(b"a\x00")
@example(b"\xe4: 1")
def test_bytes(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "m.yaml"
    path.write_bytes(data)
    with pytest.raises(ModelError) as caught:
        load(path)
    assert str(caught.value)


# expressions

TOKENS = st.sampled_from(
    [
        *FUNCTIONS,
        *TENSOR_FUNCTIONS,
        *("if", "and", "or", "not", "x", "y", "x'", "y''", "m", "t", "pi", "(", ")", "(", ")"),
        *("[", "]", ",", "+", "-", "*", "/", "^", "**", "<", "<=", "==", "=", "'", "0", "1", "2"),
        *("-1", "1/3", "0.5", "1e308", "1e-308", "1e999", "lambda.c", "Qc.x", "q", "²"),
    ]
)

NUMBERS = st.sampled_from(["0", "1", "2", "-1", "1/2", "1/3", "1e308", "1e-308", "10", "pi", "m"])
ATOMS = st.one_of(NUMBERS, st.sampled_from(["x", "y", "x'", "t", "d", "(x - x)", "x*0"]))


def _larger(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    one = st.sampled_from([n for n, f in FUNCTIONS.items() if f.fewest == 1])
    many = st.sampled_from(["min", "max", "hypot", "atan2", "pow"])
    exponents = st.sampled_from(["2", "-1", "1/2", "-1/2", "1/3", "0", "x", "m", "20", "-3"])
    return st.one_of(
        st.builds("({} {} {})".format, inner, st.sampled_from("+-*/^"), inner),
        st.builds("({})^({})".format, inner, exponents),
        st.builds("{}({})".format, one, inner),
        st.builds("{}({}, {})".format, many, inner, inner),
        st.builds(
            "if({} {} {}, {}, {})".format,
            inner,
            st.sampled_from(["<", "<=", "==", "!="]),
            inner,
            inner,
            inner,
        ),
        st.builds("dot([{}, {}], [x, {}])".format, inner, inner, inner),
        st.builds("norm(rot_x({})*[1, {}, 0])".format, inner, inner),
    )


EXPRESSIONS = st.recursive(ATOMS, _larger, max_leaves=25)

PLACES = """\
coordinates: [x, y]
parameters: {{m: 2, w: "{0}"}}
definitions: {{d: "{1}", e: "{2}"}}
T: m/2*(x'^2 + y'^2)
V: "{3}"
Q: {{x: "{4}"}}
constraints: {{c: "{5}"}}
initial: {{x: 1, y: 0, x': 0, y': 0}}
outputs: {{o: "{6}"}}
"""
DEFAULTS = ["1", "x + 1", "d'", "y", "1", "x + y", "d"]


def placed(expression: str, place: int) -> str:
    parts = list(DEFAULTS)
    parts[place] = expression
    return PLACES.format(*parts)


@settings(RELAXED, max_examples=70)
@given(st.lists(TOKENS, max_size=15).map(" ".join))
@example("(" * 10_000)
@example("-" * 10_000)
@example("9" * 100_000)
@example("x'" + "'" * 10_000)
@example("not " * 10_000)
def test_soups_of_tokens(text: str) -> None:
    with contextlib.suppress(ExpressionError):
        parse(text)
    survive(placed(text, 3))


@settings(RELAXED, max_examples=70)
@given(EXPRESSIONS, st.integers(0, len(DEFAULTS) - 1))
@example("floor(1e308 + 1e308 + 1e308)", 0)
@example("floor(1e308*m*1e308)", 0)
@example("0^x", 3)
@example("(-1)^x", 3)
@example("log(x - x)", 5)
@example("floor(x^2)*x", 1)
@example("min(x, min(y, min(x', max(x, y))))", 1)
@example("abs(" * 30 + "x" + ")" * 30, 1)
@example("10^400", 0)
@example("if(0 == 1/3, 1/0, 2)", 0)
@example("atan2(0, 0)", 0)
def test_expressions_anywhere(expression: str, place: int) -> None:
    survive(placed(expression, place))


@settings(RELAXED, max_examples=60)
@given(st.text(st.sampled_from("kgmsN°µ*/^()²³-1 25.eqxdC_"), max_size=12))
def test_units(text: str) -> None:
    try:
        factor = to_si(text)
    except UnknownUnit:
        return
    assert 0 < float(factor) < float("inf")


@settings(RELAXED, max_examples=40)
@given(
    st.dictionaries(st.sampled_from(["m", "w", "x", "q", "", "a=b"]), st.text(max_size=8)),
    st.dictionaries(st.sampled_from(["x", "x'", "y_dot", "z", "m"]), st.text(max_size=8)),
)
def test_overrides(parameters: dict[str, str], initial: dict[str, str]) -> None:
    with contextlib.suppress(LagcliError):
        load_text(PLACES.format(*DEFAULTS), "f", parameters, initial)
