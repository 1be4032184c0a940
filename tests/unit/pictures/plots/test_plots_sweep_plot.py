"""Effects of varied quantities on a measure."""

from __future__ import annotations

import numpy as np
import pytest

from lagcli.errors import UsageError
from lagcli.pictures.plots.sweep_plot import effects


def test_means_over_all_combinations() -> None:
    a, b = (x.ravel() for x in np.meshgrid([1.0, 2.0, 3.0], [0.0, 1.0], indexing="ij"))
    found = effects({"a": a, "b": b, "same": np.ones(6)}, (a - 2) ** 2 + 10 * b)
    assert [e.label for e in found] == ["b", "a"]
    assert found[0].high - found[0].low == pytest.approx(10)
    # a has the same effect at both ends, and less between them
    assert found[1].low == found[1].high == pytest.approx(6)
    assert found[1].least == pytest.approx(5)


def test_a_linear_fit_to_sampled_values() -> None:
    a, b = np.random.default_rng(1).uniform(1, 2, (2, 40))
    measure = 3 * a - 0.5 * b
    measure[7] = np.nan
    a[9] = np.nan  # of a damaged file, too large to be drawn
    found = {e.label: e for e in effects({"a": a, "b": b}, measure)}
    good = ~np.isin(np.arange(40), [7, 9])
    assert found["a"].high - found["a"].low == pytest.approx(3 * np.ptp(a[good]))
    assert found["b"].high - found["b"].low == pytest.approx(-0.5 * np.ptp(b[good]))
    assert found["b"].least == found["b"].high


def test_too_few_rows_are_rejected() -> None:
    with pytest.raises(UsageError, match="more rows"):
        effects({"a": np.array([1.0, 2.0])}, np.array([1.0, np.nan]))
