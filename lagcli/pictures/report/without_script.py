"""What a report shows without JavaScript: a picture of the mechanism, a plot of λ, a sentence."""

from __future__ import annotations

from collections.abc import Mapping

from lagcli.pictures.report.run_plots import Plot
from lagcli.pictures.scene.curve_picture import curve_image
from lagcli.pictures.scene.scene import Scene
from lagcli.pictures.scene.still import still_image


def without_script(
    plot: Plot | None, colors: Mapping[str, str], scene: Scene | None, title: str
) -> str:
    """Return HTML for browsers in which scripts are off.

    Parameters
    ----------
    plot : Plot, optional
        Of λ, or of the coordinates of a free system.
    colors : mapping of str to str
        The colour of each constraint.
    scene : Scene, optional
        The mechanism, if the model has a view.
    title : str
        Plain text.
    """
    images = [] if scene is None else [still_image(scene, title)]
    if plot is not None and len(plot.time) > 1:
        labels = [curve.label for curve in plot.curves]
        own = [colors.get(curve.constraint) for curve in plot.curves]
        images.append(curve_image(plot.time, plot.values, labels, plot.unit, own))
    said = "The animation, the plots and the values of terms need JavaScript, which is switched off"
    said += " here; equations, tables and the model are complete."
    return (
        f'<noscript><figure class="still">{"".join(images)}'
        f'<figcaption class="status stopped">{said}</figcaption></figure></noscript>'
    )
