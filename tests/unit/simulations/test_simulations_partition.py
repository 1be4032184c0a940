"""Independent coordinates at the consistent initial state of a model."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.equations.derivation.lagrange import derive
from lagcli.errors import ModelError, UsageError
from lagcli.simulations.partition import partition, partition_of
from lagcli.simulations.start import ModelStart

CRANK = """
coordinates: [x, phi, s]
T: (x'^2 + phi'^2 + s'^2)/2
constraints:
  {guide}: x = cos(phi)
  link: s = x + sin(phi)
initial: {{x: {{guess: 1}}, phi: {phi}, s: {{guess: 1}},
  x': {{guess: 0}}, phi': 1, s': {{guess: 0}}}}
"""


def equations(guide: str = "guide", phi: str = "0.5"):
    return derive(lagcli.load_text(CRANK.format(guide=guide, phi=phi)))


def names(found) -> list[str]:
    return [found.equations.model.coordinate_names[i] for i in found.independent]


def test_coordinates_with_fixed_values_are_independent() -> None:
    assert names(partition(equations())) == ["phi"]
    start = ModelStart(equations())
    assert names(partition_of(start)) == ["phi"]
    assert names(partition_of(start, ["s"])) == ["s"]  # of the same start


def test_other_choices_must_be_possible_there() -> None:
    with pytest.raises(UsageError, match="`q`"):
        partition(equations(), ["q"])
    with pytest.raises(UsageError):
        partition(equations(), ["x", "phi"])
    # x = cos φ has no slope at φ = 0
    with pytest.raises(UsageError):
        partition(equations(phi="0"), ["x"])


def test_a_model_without_start_has_no_partition() -> None:
    text = CRANK.format(guide="guide", phi="0.5").replace("x: {guess: 1}", "x: 3")
    with pytest.raises(ModelError):
        partition(derive(lagcli.load_text(text)))


def test_constraints_that_come_and_go_have_none() -> None:
    text = CRANK.format(guide="guide", phi="0.5").replace("x = cos(phi)", "x >= cos(phi)")
    with pytest.raises(UsageError, match="independent coordinates need constraints that hold"):
        partition(derive(lagcli.load_text(text.replace("x: {guess: 1}", "x: 2"))))
