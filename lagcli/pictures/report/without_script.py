"""What a report shows without JavaScript: a picture of the mechanism, a plot of λ, a sentence."""

from __future__ import annotations

from importlib.util import find_spec

from lagcli.columns import ColumnName
from lagcli.pictures.report.report_page import picture_element
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.scene import Scene
from lagcli.pictures.scene.still import still_image

_EVERY_MULTIPLIER = str(ColumnName("multipliers", "*"))


def without_script(run: RunFile, scene: Scene | None, title: str) -> str:
    """Return HTML for browsers in which scripts are off.

    Without matplotlib, which draws the pictures, there is only the sentence.

    Parameters
    ----------
    run : RunFile
    scene : Scene or None
        The mechanism, if the model has a view.
    title : str
        Plain text.
    """
    images = []
    if find_spec("matplotlib") is not None and run.count:
        if scene is not None:
            images.append(still_image(scene, title))
        images.append(_plot(run))
    said = "The animation, the plots and the values of terms need JavaScript, which is switched off"
    said += " here; equations, tables and the model are complete."
    return (
        f'<noscript><figure class="still">{"".join(images)}'
        f'<figcaption class="status stopped">{said}</figcaption></figure></noscript>'
    )


def _plot(run: RunFile) -> str:
    """Return an image of the multipliers over time, or of the coordinates of a free system."""
    from lagcli.pictures.plots.run_plot import plot_runs

    names, shown = [*run.coordinates], "Coordinates"
    if run.constraints:
        names, shown = [_EVERY_MULTIPLIER], "Multipliers"
    return picture_element(lambda target: plot_runs([run], names, target), f"{shown} over time")
