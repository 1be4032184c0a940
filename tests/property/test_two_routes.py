"""`simulate` and the core of pages and FMUs: the same start gives the same run, to the last bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from shipped import PATHS, REPRESENTATIVES
from two_routes import by_page, by_simulate, difference

import lagcli
from lagcli.engine.core.run import METHODS
from lagcli.errors import ModelError, UsageError
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare

FOUND = {
    str(path.relative_to(folder).with_suffix("")): path
    for folder in [Path(__file__).parents[1] / "found"]
    for path in sorted(folder.rglob("*.yaml"))
}
_STIFF = "`auto` goes on with an implicit method"
_END = "only `simulate` locates the singular configuration at which the motion ends"
_ANY = ("auto", *METHODS)
#: Models whose run by a page differs: what pages lack, and by which methods.
GAPS: dict[str, tuple[str, tuple[str, ...]]] = {
    "atol_block": (_STIFF, ("auto",)),
    "belt_ramp": (_STIFF, ("auto",)),
    "belt_ramp_notime": (_STIFF, ("auto",)),
    "condenser_microphone": (_STIFF, ("auto",)),
    "cranks": (_END, _ANY),
    "disc_block_2d": (_STIFF, ("auto",)),
    "disc_block_notime": (_STIFF, ("auto",)),
    "hostile/vanishing-terms": (_END, _ANY),
    "singular_start": (_END, ("auto", "DOP853", "Taylor")),
}
#: Runs of more than 8 s of processor time.
LONG = [("beam40", "Rodas5P"), ("net_rods", "Radau"), ("net_rods", "Rodas5P")]


def check(path: Path, method: str) -> None:
    simulation = prepare(lagcli.load(path), SettingsOverrides(method=method))
    run = by_simulate(simulation)
    core = "DOP853" if method == "auto" or "Taylor's method does not suit" in run.why else method
    assert difference(run, by_page(simulation, core)) == ""


@pytest.mark.bits
@pytest.mark.parametrize("method", _ANY)
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in REPRESENTATIVES else [pytest.mark.slow])
        for name in PATHS
    ],
)
def test_a_shipped_model_runs_in_a_page_as_by_simulate(name: str, method: str) -> None:
    check(PATHS[name], method)


def _found() -> list[Any]:
    found = []
    for name in FOUND:
        why, by = GAPS.get(name, ("", ()))
        for method in _ANY:
            marks = [pytest.mark.xfail(reason=why)] if method in by else []
            if (name, method) not in LONG:
                found.append(pytest.param(name, method, marks=marks))
    return found


@pytest.mark.slow
@pytest.mark.bits
@pytest.mark.parametrize(("name", "method"), _found())
def test_a_found_model_runs_in_a_page_as_by_simulate(name: str, method: str) -> None:
    try:
        lagcli.load(FOUND[name])
    except ModelError:
        pytest.skip("lagcli rejects the file")
    try:
        check(FOUND[name], method)
    except UsageError as error:
        pytest.skip(f"not by this method: {error}")
