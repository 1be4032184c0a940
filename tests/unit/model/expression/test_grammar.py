"""Text → tree: what the grammar accepts, how it binds, what it says to the rest."""

from __future__ import annotations

from fractions import Fraction

import pytest

from lagcli.model.expression.grammar import (
    MAX_DIGITS,
    MAX_NESTING,
    parse,
    parse_equation,
    read_number,
)
from lagcli.model.expression.tokens import ExpressionError, is_name, tokenize
from lagcli.model.expression.trees import (
    CallExpr,
    Comparison,
    LogicalExpr,
    Name,
    NumberExpr,
    PowerExpr,
    ProductExpr,
    SumExpr,
    Tree,
    VectorExpr,
    walk,
)


def written(tree: Tree) -> str:
    """Return a tree with all its parentheses."""
    match tree:
        case NumberExpr():
            return str(tree.value)
        case Name():
            return tree.text + "'" * tree.primes
        case CallExpr():
            return f"{tree.function}({', '.join(map(written, tree.arguments))})"
        case SumExpr():
            return "(" + " ".join(f"{'+-'[s < 0]} {written(t)}" for s, t in tree.terms) + ")"
        case ProductExpr():
            return "(" + " ".join(f"{'*/'[e < 0]} {written(f)}" for e, f in tree.factors) + ")"
        case PowerExpr():
            return f"({written(tree.base)} ^ {written(tree.exponent)})"
        case VectorExpr():
            return f"[{', '.join(map(written, tree.items))}]"
        case Comparison():
            parts = [written(o) for o in tree.operands]
            rest = [f"{o} {p}" for o, p in zip(tree.operators, parts[1:], strict=True)]
            return f"({' '.join([parts[0], *rest])})"
        case LogicalExpr():
            return f"{tree.operator}({', '.join(map(written, tree.operands))})"
    raise AssertionError(tree)


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("1", "1"),
        ("0.1", "1/10"),
        ("1e-3", "1/1000"),
        (".5", "1/2"),
        ("5.", "5"),
        ("1.5E2", "150"),
        ("-x^2", "(- (x ^ 2))"),
        ("(-x)^2", "((- x) ^ 2)"),
        ("x^-2", "(x ^ (- 2))"),
        ("2^3^2", "(2 ^ (3 ^ 2))"),
        ("2**3", "(2 ^ 3)"),
        ("a - b - c", "(+ a - b - c)"),
        ("a/b*c", "(* a / b * c)"),
        ("a*-b", "(* a * (- b))"),
        ("-a*b", "(- (* a * b))"),
        ("--a", "a"),
        ("a - -b", "(+ a + b)"),
        ("x''", "x''"),
        ("x'^2", "(x' ^ 2)"),
        ("x_dot*y", "(* x_dot * y)"),
        ("sin(x)^2", "(sin(x) ^ 2)"),
        ("atan2(y, x)", "atan2(y, x)"),
        ("lambda.guide/2", "(* lambda.guide / 2)"),
        ("[x, [1, 2]]", "[x, [1, 2]]"),
        ("if(x > 0 and not y < 1, a, b)", "if(and((x > 0), not((y < 1))), a, b)"),
        ("if(0 <= x < 1 or b == c, 1, 2)", "if(or((0 <= x < 1), (b == c)), 1, 2)"),
        ("größe*高さ", "(* größe * 高さ)"),
        ("gamma + S + N + E + I + Q + beta", "(+ gamma + S + N + E + I + Q + beta)"),
        ("\n x\t+\n y ", "(+ x + y)"),
    ],
)
def test_meaning(text: str, meaning: str) -> None:
    assert written(parse(text)) == meaning


def test_numbers_are_exact() -> None:
    tree = parse("0.1")
    assert isinstance(tree, NumberExpr)
    assert tree.value == Fraction(1, 10)


def test_trees_have_their_place() -> None:
    text = "a + sin(b_1)*c'^2"
    found = {written(t): text[t.start : t.end] for t in walk(parse(text))}
    assert found["sin(b_1)"] == "sin(b_1)"
    assert found["(c' ^ 2)"] == "c'^2"
    assert found["b_1"] == "b_1"


def test_equations() -> None:
    left, right = parse_equation("x^2 = l")
    assert written(left) == "(x ^ 2)"
    assert right is not None
    assert written(right) == "l"
    assert parse_equation("x")[1] is None


@pytest.mark.parametrize(
    ("text", "underlined", "words"),
    [
        ("", "", "missing"),
        ("x +", "", "ends too early"),
        ("x + * y", "*", "both sides"),
        ("(x + y", "(", "is not closed"),
        ("x + y)", ")", "no opening bracket"),
        ("[x, y)", ")", "write `]`"),
        ("2x", "2x", "`2*x`"),
        ("m v", "m v", "`m*v`"),
        ("sin x", "sin x", "`sin(x)`"),
        ("sin^2(x)", "sin", "`sin(…)^2`"),
        ("2 3", "2 3", "two numbers"),
        ("1,5", "1,5", "`1.5`"),
        ("f, g", ",", "comma"),
        ("0.5.3", "0.5.3", "two decimal points"),
        ("0x10", "0x10", "decimal"),
        ("1_000", "1_000", "1000"),
        ("2020-01-01", "01", "starts with 0"),
        (".inf", ".inf", "finite"),
        ("1e999", "1e999", "double"),
        ("9" * 401, "9" * 401, "double"),
        ("12:30", ":", "seconds"),
        ("x — y", "—", "hyphen"),
        ("√x", "√", "sqrt"),
        ("|x|", "|", "abs(x)"),
        ("x\u200by", "\u200b", "invisible character U+200B"),
        ("٣", "٣", "unexpected"),
        ("(a*b)'", "'", "definitions"),
        ("x = 1", "=", "equation"),
        ("x [1]", "[", "must directly follow a name"),
        ("x[]", "]", "missing index"),
        ("x[1..2]", "..", "a range is not allowed here"),
        ("x[1, 2, 3]", ",", "at most two indices"),
        ("sum(x[i])", "sum", "an index and its range"),
        ("sum(x[i], i = 1)", ")", "missing range"),
        ("sum(x[i], i = 1..2, j = 1..2)", ",", "one range"),
        ("1..2", "..", "a range is not allowed here"),
        ("and", "and", "keyword"),
        ("if", "if", "if(condition, a, b)"),
        ("_x", "_", "letter"),
        ("x @ y", "@", "unexpected"),
    ],
)
def test_errors_stand_in_their_place(text: str, underlined: str, words: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse(text)
    error = caught.value
    assert text[error.start : error.end] == underlined
    assert words in f"{error.message}; {error.help}"


def test_a_second_equals_sign() -> None:
    with pytest.raises(ExpressionError, match="second `=`"):
        parse_equation("x = y = z")


@pytest.mark.parametrize("opening", ["(", "sin(", "[", "x^", "not ", "-(", "x^("])
def test_nesting_is_bounded(opening: str) -> None:
    closing = {"(": ")", "[": "]"}.get(opening[-1], "")
    deep = opening * 20_000 + "x" + closing * 20_000
    with pytest.raises(ExpressionError, match=f"deeper than {MAX_NESTING}"):
        parse(deep)


def test_long_flat_expressions_are_no_problem() -> None:
    assert len(parse("+".join(["x"] * 20_000)).parts) == 20_000
    assert written(parse("-" * 10_001 + "x")) == "(- x)"


def test_names() -> None:
    assert all(map(is_name, ["x", "x_1", "Größe", "高", "lambda", "e1"]))
    assert not any(map(is_name, ["", "1x", "_x", "x²", "x-1", "x y", "½", "x.y", "x٣", "x'"]))


def number(text: str) -> Fraction:
    """Return the number that a text begins with."""
    first, second = tokenize(text)[:2]
    return read_number(first, second).value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.1", Fraction(1, 10)),
        ("2e-3", Fraction(1, 500)),
        ("1.5E2", Fraction(150)),
        (".25", Fraction(1, 4)),
        ("0", Fraction(0)),
        ("0.0625", Fraction(1, 16)),
        ("1e308", Fraction(10) ** 308),
    ],
)
def test_tokens_of_numbers_are_exact(text: str, value: Fraction) -> None:
    assert number(text) == value


@pytest.mark.parametrize("text", ["1e309", "1e-341", "1" * (MAX_DIGITS + 1), "1e9999999999"])
def test_numbers_beyond_doubles(text: str) -> None:
    with pytest.raises(ExpressionError, match="beyond what a double can hold") as found:
        number(text)
    assert found.value.kind == "bad-number"
    assert (found.value.start, found.value.end) == (0, len(text))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("007", "starts with 0"),
        ("1.2.3", "two decimal points"),
        ("0x1F", "`0x1F` is not a number"),
        ("0b10", "`0b10` is not a number"),
    ],
)
def test_numbers_that_are_not_decimal(text: str, message: str) -> None:
    with pytest.raises(ExpressionError, match=message):
        number(text)
