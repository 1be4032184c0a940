"""A picture of a model's mechanism as the icon of an FMU."""

from __future__ import annotations

from lagcli.pictures.scene.automatic_view import with_view
from lagcli.pictures.scene.still import still_picture
from lagcli.pictures.scene.view_evaluator import ViewEvaluator
from lagcli.simulations.simulation import Simulation
from lagcli.trajectory.samples import Samples
from lagcli.trajectory.trajectory import joined

#: Pixels: so many that the names in the picture do not touch.
SIZE = (640, 480)


def icon(simulation: Simulation) -> bytes | None:
    """Return a PNG file with the mechanism in its own run.

    None if the model has no view and none can be found, or without matplotlib, which draws it.
    """
    model = with_view(simulation.model)
    if model.view is None:
        return None
    blocks: list[Samples] = []
    simulation.run(blocks.append)
    samples = joined(blocks)
    scene = ViewEvaluator(model).scene(vars(samples), samples.terms, model.parameter_values)
    return still_picture(scene, SIZE, "")
