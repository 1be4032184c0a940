"""Models that switch are refused on the SciPy engine, with a remedy."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.errors import UsageError
from lagcli.settings import resolve
from lagcli.simulations.switching import switching_engine

PARTICLE = """
coordinates: [x]
parameters: {c: 1}
T: x'^2/2
initial: {x: 1, x': 0}
"""
SWITCHING = {
    "constraints: {wall: x >= 0}": "`wall` does not always hold",
    "constraints: {brake: {expr: x' = 0, limit: 2}}": "`brake` does not always hold",
    "events: {late: {when: t >= 1, stop: true}}": "`late` is an event",
    'Q: {x: "if(x > 0, -1, 1)"}': "its forces have branches",
}


@pytest.mark.parametrize(("rest", "words"), SWITCHING.items())
def test_a_model_that_switches_names_what_does(rest: str, words: str) -> None:
    model = lagcli.load_text(PARTICLE + rest)
    for options in ({}, {"sensitivity": ("c",)}):
        with pytest.raises(UsageError) as error:
            lagcli.simulate(model, engine="scipy", method="DOP853", **options)
        assert f"only the compiled engine runs models that switch, and {words}" in str(error.value)
        assert "leave out `engine: scipy`" in str(error.value)


def test_the_remedy_is_that_of_the_request(monkeypatch: pytest.MonkeyPatch) -> None:
    model = lagcli.load_text(PARTICLE + next(iter(SWITCHING)))
    with pytest.raises(UsageError, match="leave out the method BDF"):
        lagcli.simulate(model, method="BDF")
    with pytest.raises(UsageError, match="give --method DOP853, or --formulation projection"):
        lagcli.simulate(model, method="Radau", formulation="baumgarte")
    for module in (resolve, switching_engine):
        monkeypatch.setattr(module, "compiled_available", lambda: False)
    with pytest.raises(UsageError, match="install a C compiler, and lagcli again"):
        lagcli.simulate(model)


def test_smooth_models_run_on_either_engine() -> None:
    model = lagcli.load_text(PARTICLE + "V: c*x^2/2\n")
    one, other = (
        lagcli.simulate(model, engine=engine, t_end=1, samples=3)
        for engine in ("compiled", "scipy")
    )
    assert other.q == pytest.approx(one.q, abs=1e-8)
