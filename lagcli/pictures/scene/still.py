"""A still picture of a scene for pages that are read without JavaScript."""

from __future__ import annotations

import io
from importlib.util import find_spec

import numpy as np

from lagcli.pictures.scene.drawing import SceneDrawing
from lagcli.pictures.scene.scene import Scene
from lagcli.pictures.scene.vector import VectorPicture

_SIZE = (640, 480)
#: The part of the motion after which the picture is taken.
_MOMENT = 0.45


def still(image: str) -> str:
    """Return HTML that shows an image where there is no JavaScript, and says so."""
    return (
        f'<noscript><figure class="still">{image}<figcaption>The picture moves'
        " with JavaScript, which is switched off here.</figcaption></figure></noscript>"
    )


def still_image(scene: Scene, label: str) -> str:
    """Return an image element with a scene.

    Parameters
    ----------
    scene : Scene
    label : str
        What is shown, in words.
    """
    return still_drawing(scene).element(label, of_model=True)


def still_drawing(scene: Scene) -> VectorPicture:
    """Return a picture of a scene."""
    drawing = SceneDrawing(scene, *_SIZE, picture=VectorPicture)
    drawing.draw(_moment(scene), f"t = {_moment(scene):.4g} s")
    assert isinstance(drawing.raster, VectorPicture)
    return drawing.raster


def still_picture(scene: Scene, size: tuple[int, int]) -> bytes | None:
    """Return a PNG file with a scene; None without matplotlib, which draws it.

    Parameters
    ----------
    scene : Scene
    size : (width, height)
        Pixels.
    """
    if find_spec("matplotlib") is None or find_spec("PIL") is None:
        return None
    from PIL import Image

    held, frame = io.BytesIO(), SceneDrawing(scene, *size).frame(_moment(scene))
    # few colours: text and lines on paper
    Image.fromarray(frame).quantize(32).save(held, "png", optimize=True)
    return held.getvalue()


def _moment(scene: Scene) -> float:
    """Return the time of the picture: that of a sample, whose values are known."""
    time = scene.time
    wanted = time[0] + _MOMENT * (time[-1] - time[0])
    return float(time[np.abs(time - wanted).argmin()])
