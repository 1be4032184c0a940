"""Spreads of parameters and the bands that follow from them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.errors import UsageError
from lagcli.pictures.curves import Catalogue
from lagcli.pictures.plots.run_plot import half_widths, read_bands
from lagcli.pictures.run_file import RunFile

MODEL = Path(__file__).parents[4] / "models" / "slider_crank.yaml"
RUN = lagcli.simulate(lagcli.load(MODEL), samples=5, sensitivity=["l", "phi'"])


def test_half_widths_add_by_squares() -> None:
    run = RunFile(RUN)
    spreads = read_bands(run, ["l=2%", "phi' = 0.5"])
    assert spreads == pytest.approx({"l": 0.006, "phi'": 0.5})
    curves = [c for name in ("psi", "lambda.guide", "slider") for c in Catalogue(run).find(name)]
    found = half_widths(run, curves, spreads)
    assert set(found) == {"psi", "lambda.guide"}
    assert RUN.dq is not None
    expected = np.hypot(RUN.dq[:, 1, 0] * 0.006, RUN.dq[:, 1, 1] * 0.5)
    np.testing.assert_allclose(found["psi"], expected)
    assert half_widths(run, curves, {}) == {}


def test_derivatives_are_curves() -> None:
    (curve,) = Catalogue(RunFile(RUN)).find("dlambda.guide/dphi'")
    assert (curve.field, curve.place) == ("dmultipliers", (0, 1))


@pytest.mark.parametrize("text", ["l", "l=", "l=x", "l=-1", "m=1"])
def test_mistakes(text: str) -> None:
    with pytest.raises(UsageError, match="--band"):
        read_bands(RunFile(RUN), [text])


def test_a_percentage_needs_the_value(tmp_path: Path) -> None:
    path = str(tmp_path / "run.csv")
    lagcli.write(RUN, path)
    run = RunFile(path)
    assert read_bands(run, ["l=0.01"]) == {"l": 0.01}
    assert read_bands(run, ["phi'=1%"]) == pytest.approx({"phi'": abs(RUN.v[0, 0]) / 100})
    with pytest.raises(UsageError, match=r"lacks the value of `l`.*--meta.*give the spread in SI"):
        read_bands(run, ["l=1%"])


@pytest.mark.parametrize(
    "name", ["energy_total", "phi_ddot", "Qc.phi", "residual_position.guide", "slider", "phi:psi"]
)
def test_curves_without_derivatives_have_no_band(name: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="around coordinates, velocities and multipliers"):
        lagcli.plot(RUN, tmp_path / "a.svg", [name], bands=["l=2%"])
    # beside one that has a band, with a note
    notes = lagcli.plot(RUN, tmp_path / "a.svg", [name, "psi_dot"], bands=["l=2%"])
    missing = sorted(name.split(":"))
    assert len(notes) == 1
    assert notes[0].startswith(f"no bands around {', '.join(f'`{x}`' for x in missing)}:")


def test_curves_with_derivatives_alone_need_no_note(tmp_path: Path) -> None:
    assert lagcli.plot(RUN, tmp_path / "a.svg", ["psi"], bands=["l=2%"]) == ()
    assert lagcli.plot(RUN, tmp_path / "a.svg", bands=["l=2%"], force=True) == ()
