"""Options that say about which point a model is linearized."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated

import typer

from lagcli.cli.options import assignments

if TYPE_CHECKING:
    from lagcli.model.model import Model

At = Annotated[
    float | None, typer.Option("--at", metavar="T", help="At the state of a run at this time, s.")
]
Equilibrium = Annotated[
    bool, typer.Option("--equilibrium", help="At the equilibrium next to the initial values.")
]
Steady = Annotated[
    list[str] | None,
    typer.Option(
        "--steady",
        metavar="VELOCITY=VALUE",
        help='At the steady motion with this velocity, e.g. "phi\'=10". Repeatable.',
    ),
]


def load_steady(
    model: str,
    set: Iterable[str] | None,
    set_initial: Iterable[str] | None,
    steady: Iterable[str] | None,
) -> tuple[Model, dict[str, float]]:
    """Load a model, and read the velocities that are held, in SI.

    Their values are read as initial values: with units, and with parameters.

    Raises
    ------
    ModelError, UsageError, FileError
        As `lagcli.load`; or a name is no velocity of the model.
    """
    from lagcli.analysis.local.steady_states import velocity_coordinate
    from lagcli.model.loader import load, load_text

    parameters, initial = assignments("--set", set), assignments("--set-initial", set_initial)
    loaded = load(model, parameters, initial)
    held = assignments("--steady", steady)
    if not held:
        return loaded, {}
    names = {text: velocity_coordinate(loaded.coordinate_names, text) for text in held}
    velocities = {f"{names[text]}'": value for text, value in held.items()}
    given = {name: value for name, value in initial.items() if f"{name}'" not in velocities}
    again = load_text(loaded.text, loaded.path, parameters, {**given, **velocities})
    return again, {f"{name}'": again.initial_velocities[name].value for name in names.values()}
