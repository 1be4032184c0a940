"""Bands: spreads of parameters and of rows, and what follows from them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.errors import UsageError
from lagcli.pictures.curves import Catalogue, read_curves
from lagcli.pictures.plots.bands import RowBands, linear_bands, read_bands, read_part
from lagcli.pictures.run_file import RunFile, with_expressions

MODEL = Path(__file__).parents[4] / "models" / "slider_crank.yaml"
RUN = lagcli.simulate(lagcli.load(MODEL), samples=5, sensitivity=["l", "phi'"])


def test_half_widths_add_by_squares() -> None:
    run = RunFile(RUN)
    spreads = read_bands(run, ["l=2%", "phi' = 0.5"])
    assert spreads == pytest.approx({"l": 0.006, "phi'": 0.5})
    curves = [c for name in ("psi", "lambda.guide") for c in Catalogue(run).find(name)]
    values = read_curves(run, curves)
    found = linear_bands(run, curves, values, spreads)
    assert RUN.dq is not None
    expected = np.hypot(RUN.dq[:, 1, 0] * 0.006, RUN.dq[:, 1, 1] * 0.5)
    low, high = found.over_time("psi") or (None, None)
    np.testing.assert_allclose(low, values["psi"] - expected)
    np.testing.assert_allclose(high, values["psi"] + expected)
    assert linear_bands(run, curves, values, {}).over_time("psi") is None


def test_rows_have_the_quantiles_of_numpy() -> None:
    rng = np.random.default_rng(1)
    rows = {"x": rng.normal(size=(40, 7)), "y": rng.normal(size=(40, 7))}
    rows["y"][3, 4:] = np.nan  # a row without values at the end
    bands = RowBands(rows, 0.9)
    for name, values in rows.items():
        low, high = bands.over_time(name)
        for k in range(7):
            known = values[:, k][np.isfinite(values[:, k])]
            expected = np.percentile(known, (5, 50, 95))
            found = low[k], bands.medians[name][k], high[k]
            np.testing.assert_allclose(found, expected, rtol=1e-14)


@pytest.mark.parametrize("stretch", [(1.0, 1.0), (1e-3, 50.0)])
def test_portraits_of_circles_lie_between_quantiles_of_their_radii(
    stretch: tuple[float, float],
) -> None:
    radii = np.random.default_rng(2).uniform(1, 2, 200)
    angle = np.linspace(0, 6, 401)
    rows = {
        "x": stretch[0] * radii[:, None] * np.cos(angle),
        "y": stretch[1] * radii[:, None] * np.sin(angle),
    }
    ends = RowBands(rows, 0.8).portrait("x", "y")
    found = sorted(np.hypot(*(end[5:-5] / stretch).T).mean() for end in ends)
    np.testing.assert_allclose(found, np.percentile(radii, (10, 90)), rtol=1e-3)


def test_portraits_to_first_order_are_envelopes_of_ellipses() -> None:
    run = RunFile(RUN)
    curves = [c for name in ("psi", "psi_dot") for c in Catalogue(run).find(name)]
    found = linear_bands(run, curves, read_curves(run, curves), {"l": 0.01, "phi'": 0.1})
    ends = found.portrait("psi", "psi_dot")
    assert ends is not None
    changes = np.stack([found.changes[name] for name in ("psi", "psi_dot")], axis=1)
    for change, low, high in zip(changes, *ends, strict=True):
        # both ends are on the ellipse of the pair: its points are change·u with |u| = 1
        u = np.linalg.lstsq(change, (high - low) / 2, rcond=None)[0]
        assert np.linalg.norm(u) == pytest.approx(1)


@pytest.mark.parametrize("text", ["90", "0%", "100%", "l=5%", "x%", "9_0%", "٩%"])
def test_parts_of_rows(text: str) -> None:
    with pytest.raises(UsageError, match="--band 90%"):
        read_part([text])
    assert read_part([" 90% "]) == 0.9


def test_derivatives_are_curves() -> None:
    (curve,) = Catalogue(RunFile(RUN)).find("dlambda.guide/dphi'")
    assert (curve.field, curve.place) == ("dmultipliers", (0, 1))


@pytest.mark.parametrize("text", ["l", "l=", "l=x", "l=-1", "l=1_0%", "m=1"])
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
    "name", ["energy_balance", "residual_position.guide", "phi:energy_balance"]
)
def test_sums_over_time_and_residuals_have_no_band(name: str, tmp_path: Path) -> None:
    notes = lagcli.plot(RUN, tmp_path / "a.svg", [name, "psi_dot"], bands=["l=2%"])
    missing = name.split(":")[-1]
    assert notes == (
        f"no bands around `{missing}`: they are drawn around functions of the state at one time",
    )
    with pytest.raises(UsageError, match="functions of the state at one time"):
        lagcli.plot(RUN, tmp_path / "b.svg", ["energy_balance"], bands=["l=2%"])


@pytest.mark.parametrize(
    "names", [["psi"], [], ["energy_total", "phi_ddot", "Qc.phi", "phi:slider"]]
)
def test_curves_with_derivatives_need_no_note(names: list[str], tmp_path: Path) -> None:
    assert lagcli.plot(RUN, tmp_path / "a.svg", names, bands=["l=2%"]) == ()


def test_bands_of_a_run_with_fewer_members_than_the_file_has(tmp_path: Path) -> None:
    text = (MODEL.parent / "chain.yaml").read_text().replace("{value: 1/N, unit: kg}", "0.1 kg")
    model = lagcli.load_text(text, set={"N": 3})
    run = RunFile(lagcli.simulate(model, t_end=0.1, samples=3, sensitivity=["l"]))
    curves = Catalogue(run).find("energy_total")
    values = read_curves(run, curves)
    bands = linear_bands(run, curves, values, {"l": 0.05})
    # released at rest, E = V is proportional to l = 1 m, and constant
    np.testing.assert_allclose(
        bands.changes["energy_total"][:, 0], 0.05 * values["energy_total"], rtol=1e-6
    )


@pytest.mark.parametrize(
    ("set", "given"),
    [
        ({"a": "2 cm"}, {"a": "2.0 cm"}),
        ({"b": "7*1"}, {"a": "1.0 cm", "b": "7.0*1"}),
        ({"N": 3, "c": "0.03*1"}, {"a": "1.0 cm", "c": "0.03*1"}),
    ],
)
def test_parameters_follow_unless_replaced(set: dict[str, object], given: dict[str, str]) -> None:
    text = """
name: members
coordinates: {"x[1..N]": }
parameters: {N: 2, a: 1 cm, b: 2*a, c: a/N}
T: sum(x[i]'^2/2, i = 1..N)
V: sum((a + b + c)*x[i]^2, i = 1..N)
initial: {"x[1..N]": 1, "x[1..N]'": 0}
"""
    run = RunFile(lagcli.simulate(lagcli.load_text(text, set=set), t_end=0.1, samples=2))
    written, values = with_expressions(run.model)
    assert values == {"N": f"{run.model.parameter_values['N']!r}*1", **given}
    again = lagcli.load_text(written.text, set=values)
    assert again.parameter_values == run.model.parameter_values
