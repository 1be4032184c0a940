"""The machines on the page on bodies and joints load and run as the page says."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.model.loader import expand_text
from lagcli.model.machines.forces import FORCES
from lagcli.model.machines.registry import KINDS, OF_COORDINATE

PAGE = (Path(__file__).parents[2] / "docs" / "machines.md").read_text()
MODELS = [
    block for block in re.findall(r"```yaml\n(.*?)```", PAGE, re.S) if "\nbodies:" in f"\n{block}"
]


def test_the_press_has_the_coordinates_and_constraints_that_the_page_counts() -> None:
    model = lagcli.load_text(MODELS[0])
    assert model.coordinate_names[:3] == ("crank.x", "crank.y", "crank.phi")
    assert (len(model.coordinates), len(model.constraints)) == (15, 15)
    run = lagcli.simulate(model, t_end=0.5, samples=3)
    assert "motor" in run.constraints
    # at 60 rpm the crank turns by half a turn
    turned = run.q[-1, run.coordinates.index("crank.phi")] - run.q[0, 2]
    assert turned == pytest.approx(np.pi, abs=1e-9)


@pytest.mark.parametrize("text", MODELS)
def test_every_machine_runs_and_is_that_of_its_expanded_file(text: str) -> None:
    one, two = (
        lagcli.simulate(lagcli.load_text(x), t_end=0.1, samples=3)
        for x in (text, expand_text(text))
    )
    np.testing.assert_array_equal(one.q, two.q)
    np.testing.assert_array_equal(one.multipliers, two.multipliers)


def test_the_shorter_crank_of_the_page() -> None:
    (name, value) = re.findall(r"--set '([\w.]+)=([^']+)'", PAGE)[0]
    assert lagcli.load_text(MODELS[0], set={name: value}).parameters["crank.length"].value == 0.15


def test_the_page_has_every_kind_and_key() -> None:
    words = set(re.findall(r"[\w]+", PAGE))
    kinds = [kind for of_dimension in KINDS.values() for kind in of_dimension.values()]
    wanted = {*FORCES, *OF_COORDINATE, *(kind.name for kind in kinds)}
    wanted |= {key for kind in (*kinds, *FORCES.values()) for key in kind.keys}
    assert wanted <= words, wanted - words
