"""What a raster draws, pixel by pixel."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("matplotlib")
from lagcli.pictures.scene.raster import Raster


@pytest.fixture
def raster() -> Raster:
    raster = Raster(40, 20, 1.0, "#ffffff")
    raster.clear()
    return raster


def test_y_points_up_and_areas_are_filled(raster: Raster) -> None:
    raster.area(np.array([(10.0, 0.0), (20.0, 0.0), (20.0, 5.0), (10.0, 5.0)]), "#ff0000")
    image = raster.image()
    assert image.shape == (20, 40, 3)
    red = (image == (255, 0, 0)).all(axis=2)
    rows, columns = np.nonzero(red)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (15, 19, 10, 19)
    assert (image[~red] == 255).all()


def test_widths_are_in_units() -> None:
    for unit in (1.0, 2.0):
        raster = Raster(40, 20, unit, "#ffffff")
        raster.clear()
        raster.line([(0.0, 10.0), (40.0, 10.0)], "#000000", 4)
        dark = 255.0 - raster.image()[:, 20, 0]
        assert dark.sum() / 255 == pytest.approx(4 * unit, rel=0.02)


def test_text_is_as_wide_as_it_says_and_aligned(raster: Raster) -> None:
    width = raster.text("ll", (20.0, 10.0), "#000000", align="center")
    columns = np.nonzero((raster.image()[:, :, 0] < 128).any(axis=0))[0]
    assert 20 - width / 2 <= columns.min() < columns.max() <= 20 + width / 2
    assert raster.text(" ", (20.0, 10.0), "#000000") > 0
    assert raster.text("", (20.0, 10.0), "#000000") == 0


def test_a_still_picture_is_copied(raster: Raster) -> None:
    still = np.zeros((20, 40, 4), dtype=np.uint8)
    still[..., 2] = 200
    raster.clear(still)
    assert (raster.image() == (0, 0, 200)).all()
