"""Diagnostics in the order of the file, each subject once."""

from __future__ import annotations

import pytest

from lagcli.errors import ModelError, SourceLocation
from lagcli.model.diagnostics import MAX_DIAGNOSTICS, Broken, Diagnostics
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.loader import load_text
from lagcli.model.yaml.composing import compose
from lagcli.model.yaml.source import Source


def at(line: int, column: int = 1) -> SourceLocation:
    return SourceLocation("m.yaml", line, column)


def test_they_are_sorted_by_their_place() -> None:
    report = Diagnostics([])
    for place in (at(3), at(1, 5), at(1, 2), SourceLocation("--set", 0, 9)):
        report.add("k", f"{place.path}:{place.line}:{place.column}", place)
    assert [d.message for d in report.sorted()] == [
        *("--set:0:9", "m.yaml:1:2", "m.yaml:1:5", "m.yaml:3:1")
    ]


def test_errors_of_one_subject_become_one_with_the_lines_of_the_others() -> None:
    report = Diagnostics([])
    for line in (7, 2, 4, 4):
        report.add("unknown-name", f"line {line}", at(line), subject="q")
    report.add("bad-name", "another kind", at(9), subject="q")
    first, other = report.sorted()
    assert (first.message, first.notes) == ("line 2", (("also in lines 4, 7", None),))
    assert (other.message, other.notes) == ("another kind", ())


def test_after_many_errors_the_first_ones_are_raised() -> None:
    report = Diagnostics([])
    for line in range(MAX_DIAGNOSTICS, 0, -1):
        report.add("k", "m", at(line))
    with pytest.raises(ModelError) as error:
        report.add("k", "m", at(500))
    found = error.value.diagnostics
    assert [d.location.line for d in found[:2] if d.location] == [1, 2]
    assert found[-1].kind == "too-many"
    assert len(found) == MAX_DIAGNOSTICS + 1


def test_errors_of_expressions_have_their_place_in_the_file() -> None:
    root, _ = compose(Source("T: m*x\n", "m.yaml"))
    node = root.entries["T"][1]
    report = Diagnostics([])
    with report.expression(node):
        raise ExpressionError("syntax", "here", 2, 3)
    with report.expression(node):
        raise Broken  # reported elsewhere
    with pytest.raises(ModelError, match="here") as error:
        report.finish()
    (found,) = error.value.diagnostics
    assert found.location == SourceLocation("m.yaml", 1, 6, 1, "T: m*x")
    Diagnostics([]).finish()


USES = """
coordinates: {x[1..N]: m, y: m}
parameters: {N: 3, m: 2 kg, k: 4 kN/m, l[1..N]: 1 m}
definitions: {r: y + x[1]}
T: sum(m/2*x[i]'^2, i = 1..N) + m/2*y'^2
V: sum(k/2*(x[i] - l[i])^2, i = 1..N)
constraints: {floor: {expr: r >= 0, restitution: 0.5}}
outputs: {rope: k*y, size: sum(x[i], i = 1..N)}
events: {low: {when: r <= 0.1, record: [rope, size], set: {k: 2*k}}}
initial: {x[1..N]: 0 m, x[1..N]': 0 m/s, y: 1 m, y': 0 m/s}
"""


@pytest.mark.parametrize(
    ("good", "bad"),
    [
        ("N: 3", "N: 2 kgg"),
        ("m: 2 kg", "m: sin("),
        ("k: 4 kN/m", "k: 2*nosuch"),
        ("l[1..N]: 1 m", "l[1..N]: 1 kgg"),
        ("r: y + x[1]", "r: y + nosuch"),
        ("rope: k*y", "rope: k*nosuch"),
        ("size: sum(x[i]", "size: sum(nosuch[i]"),
        ("r >= 0,", "r >= nosuch,"),
    ],
)
def test_one_mistake_is_one_error_wherever_the_name_is_used(good: str, bad: str) -> None:
    load_text(USES)
    with pytest.raises(ModelError) as raised:
        load_text(USES.replace(good, bad))
    assert len(raised.value.diagnostics) == 1
