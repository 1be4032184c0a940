"""Degrees of freedom by the rank of B: redundant constraints are counted, named and recorded."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import lagcli
from lagcli.equations.derivation.degrees_of_freedom import DegreesOfFreedom, RedundantSet
from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.render import FORMATS, render
from lagcli.model.loader import load, load_text
from lagcli.simulations.start import degrees_of_freedom

ROOT = Path(__file__).parents[4]
FOUND = Path(__file__).parents[3] / "found"
PARALLELOGRAM = ROOT / "models" / "parallelogram.yaml"
CLOSING = ("right_x", "right_y", "middle_x", "middle_y")

HEAD = "coordinates: [x, y, z]\nT: (x'^2 + y'^2 + z'^2)/2\nV: 0\nconstraints:\n"
TAIL = "\ninitial: {x: 0, x': 0, y: 0, y': 0, z: 0, z': {guess: 0}}\n"


def freedom(constraints: str) -> DegreesOfFreedom:
    return degrees_of_freedom(derive(load_text(HEAD + constraints + TAIL)))


@pytest.mark.parametrize(
    ("constraints", "degrees", "redundant"),
    [
        ("  a: x = y", 2, ()),
        ("  a: x = y\n  b: 2*x = 2*y", 2, ((("a", "b"), 1),)),
        # their unit does not matter, nor that a third one is independent of them
        ("  a: x = y\n  b: 1e6*x = 1e6*y\n  c: z = 0", 1, ((("a", "b"), 1),)),
        ("  a: x = 0\n  b: y = 0\n  c: x + y = 0", 1, ((("a", "b", "c"), 1),)),
        ("  a: x = 0\n  b: y = 0\n  c: x + y = 0\n  d: x = y", 1, ((("a", "b", "c", "d"), 2),)),
        # two sets
        (
            "  a: x = 0\n  b: z = 0\n  c: 3*x = 0\n  d: sin(z) = 0",
            *(1, ((("a", "c"), 1), (("b", "d"), 1))),
        ),
        # holonomic and nonholonomic
        ("  a: x = y\n  b: x' = y'\n  c: z' = x*y'", 1, ((("a", "b"), 1),)),
    ],
)
def test_counts_and_sets(constraints, degrees, redundant) -> None:
    found = freedom(constraints)
    assert found.degrees == degrees
    assert found.redundant == tuple(RedundantSet(*x) for x in redundant)
    kept = json.loads(json.dumps(found.to_mapping()))
    assert DegreesOfFreedom.from_mapping(kept) == found._replace(nearby=None)


def test_parallelogram_moves_in_every_format() -> None:
    equations = derive(load(PARALLELOGRAM))
    found = degrees_of_freedom(equations)
    assert (found.rank, found.degrees, found.redundant) == (3, 1, (RedundantSet(CLOSING, 1),))
    for form in FORMATS:
        shown = render(equations, form, freedom=found)
        if form == "json":
            content = json.loads(shown)
            assert (content["rank"], content["degrees_of_freedom"]) == (3, 1)
            assert content["redundant"] == [{"constraints": list(CLOSING), "surplus": 1}]
        else:
            assert "4 − 3 = 1" in shown or "4 - 3 = 1" in shown
            assert "follows from the others" in shown
            assert "[U+" not in shown


def test_bennett_linkage_has_one_degree_of_freedom() -> None:
    # three angles, six closing equations; Bennett (1903): it moves
    assert degrees_of_freedom(derive(load(FOUND / "bennett.yaml"))).degrees == 1


def test_a_singular_start_is_not_redundant() -> None:
    # a parallelogram laid flat: the gradient of the first equation, −sin, is 0 there and not beside
    model = """coordinates: [a, b, c]
parameters: {l: 1 m, d: 2 m}
T: (a'^2 + b'^2 + c'^2)/2
V: 0
constraints:
  along: l*cos(a) + d*cos(b) = l*cos(c) + d
  across: l*sin(a) + d*sin(b) = l*sin(c)
initial: {a: 0, b: 0, c: 0, a': 2, b': 0, c': 2}
"""
    equations = derive(load_text(model))
    found = degrees_of_freedom(equations)
    assert (found.rank, found.nearby, found.redundant) == (1, 2, (RedundantSet(("along",), 1),))
    said = " ".join(render(equations, freedom=found).split())
    assert "Dependent at the start: along, which has no gradient there." in said
    assert "The rank of B is 1 at the start and 2 nearby: the start is a singular" in said
    assert "least norm" not in said


def test_redundant_members_of_a_family_are_one_range() -> None:
    model = HEAD + "  x: x = 0\n  again[i = 1..4]: i*x = 0" + TAIL
    found = degrees_of_freedom(derive(load_text(model)))
    assert found.remarks[0] == "Redundant: 4 of x, again[1..4] follow from the others."


def test_no_start_no_rank() -> None:
    found = freedom("  a: x = 1\n  b: x = 2")
    assert (found.rank, found.degrees) == (None, 1)


def test_runs_say_and_keep_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from lagcli.cli.app import run

    short = ["simulate", str(PARALLELOGRAM), "--t-end", "0.01", "--samples", "2"]
    for target in (tmp_path / "run.h5", tmp_path / "run.csv"):
        assert run([*short, "-o", str(target), "--meta", "--json"]) == 0
        summary = json.loads(capsys.readouterr().out)
        assert (summary["constraints"], summary["rank"], summary["degrees_of_freedom"]) == (4, 3, 1)
        assert summary["redundant"] == [{"constraints": list(CLOSING), "surplus": 1}]
        kept = lagcli.read(target).freedom
        assert DegreesOfFreedom.from_mapping(kept) == DegreesOfFreedom(
            4, 4, 3, (RedundantSet(CLOSING, 1),)
        )
    assert run(short) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "1 of 4 redundant (rank of B 3, 1 degree of freedom)" in said
    assert "1 of right_x, right_y, middle_x, middle_y (" in said
    assert "middle_y (lines 45 to 48 of the model) follows from the others" in said
    assert run(["info", str(tmp_path / "run.h5")]) == 0
    assert "1, rank of B 3; 1 of right_x" in " ".join(capsys.readouterr().out.split())


def test_independent_constraints_are_not_mentioned(capsys: pytest.CaptureFixture[str]) -> None:
    from lagcli.cli.app import run

    model = str(ROOT / "models" / "pendulum_cartesian.yaml")
    assert run(["simulate", model, "--t-end", "0.01", "--samples", "2"]) == 0
    assert "redundant" not in capsys.readouterr().out
