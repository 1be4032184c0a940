"""Messages speak of the page, not of options."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lagcli.errors import LagcliError
from lagcli.model.loader import load
from lagcli.play.runs import Played, PlayRequest, on_page
from lagcli.simulations.cancellation import Interruption

MODELS = Path(__file__).parents[3] / "models"


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ("--set m=2 3: error[syntax]: two numbers", "m = 2 3: error[syntax]: two numbers"),
        ("a\n\n--set-initial phi'=a b: error[x]: b", "a\n\nphi' = a b: error[x]: b"),
        ("--set x[1,2]=3: error[x]: b", "x[1,2] = 3: error[x]: b"),
        ("   note: `m` is given here (--set m=0)", "   note: `m` is given here (m = 0)"),
        ("a constraint, for instance `--set m=1`", "a constraint, for instance `m = 1`"),
        ("write the unit: --set 'alpha=2 deg'", "write the unit: alpha = 2 deg"),
        ('give --set-initial "psi={guess: 0.1}"', "give psi = {guess: 0.1}"),
        ("as in `N: 10` or --set N=10", "as in `N: 10` or N = 10"),
        ("free phi, for instance `phi: {guess: 0.5}`", "mark phi as a guess"),
        ("free one of phi, psi, for instance `phi: {guess: 1}`", "mark one of phi, psi as a guess"),
        ("--timeout allows more", "`lagcli play --timeout` allows more"),
        ("end the run earlier: --t-end 4.5", "end the run earlier: t_end = 4.5"),
        ("no option --nonsense, a--set", "no option --nonsense, a--set"),
    ],
)
def test_values_are_those_of_the_page(said: str, shown: str) -> None:
    assert on_page(said) == shown


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        (
            "the motion; --through-singular continues through it",
            "the motion; `through_singular` continues through it",
        ),
        ("try a smaller --rtol or --max-step", "try a smaller `rtol` or `max_step`"),
        ("or --method DOP853, which", "or `method: DOP853`, which"),
        ("start the run later: --t-start 0.5", "start the run later: `t_start: 0.5`"),
        ("singular there; try --method Radau", "singular there; try `method: Radau`"),
    ],
)
def test_settings_are_those_of_the_model_file(said: str, shown: str) -> None:
    first, second = on_page(said).split("\n")
    assert first == shown
    assert "under `simulation` in the model file" in second


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("slider_crank", {"set": {"m": "0"}}),
        ("slider_crank", {"set": {"m": "2 3"}}),
        ("slider_crank", {"set": {"m": "3 s"}}),
        ("slider_crank", {"set": {"l": "0.01"}}),
        ("slider_crank", {"set": {"q": "1"}}),
        ("slider_crank", {"set_initial": {"psi": "0.3"}}),
        ("slider_crank", {"set_initial": {"m": "0.3"}}),
        ("chain", {"set": {"N": "2.5"}}),
        ("chain", {"set": {"m": "2"}}),
        ("contact/block_on_incline", {"set": {"alpha": "2"}}),
    ],
)
def test_no_error_of_the_page_names_an_option(name: str, values: dict[str, Any]) -> None:
    played = Played(load(MODELS / f"{name}.yaml"))
    with pytest.raises(LagcliError) as error:
        played.run(PlayRequest(1, **values), Interruption())
    assert "--" not in on_page(str(error.value))
