"""Analyses of one operating point: shared options, loading, printing."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lagcli.cli.options import assignments
from lagcli.cli.quantities import NumberIn
from lagcli.cli.streams import tell, text_width
from lagcli.cli.styles import print_listing
from lagcli.errors import UsageError
from lagcli.files import refuse_same_file

if TYPE_CHECKING:
    from lagcli.model.model import Model

At = Annotated[
    float | None,
    typer.Option(
        "--at", metavar="T", parser=NumberIn("s"), help="At the state of a run at this time, s."
    ),
]
Equilibrium = Annotated[
    bool, typer.Option("--equilibrium", help="At the equilibrium near the initial values.")
]
Steady = Annotated[
    list[str] | None,
    typer.Option(
        "--steady",
        metavar="NAME=VALUE",
        help='At the steady motion with this velocity, e.g. "phi\'=10", rate of a symmetry or'
        " expression; see lagcli equilibrium. Repeatable.",
    ),
]


def check_target(model: str, target: str | None, suffixes: tuple[str, ...], force: bool) -> None:
    """Raise an error if the result of an analysis could not be written; see
    `check_analysis_target`."""
    from lagcli.analysis.output.files import check_analysis_target

    refuse_same_file(model, target)
    if target is not None:
        check_analysis_target(target, suffixes, force)


def load_steady(
    model: str,
    set: Iterable[str] | None,
    set_initial: Iterable[str] | None,
    steady: Iterable[str] | None,
    preset: str | None = None,
) -> tuple[Model, dict[str, float | None]]:
    """Load a model, and parse the velocities and quantities of a steady motion, in SI.

    Values are parsed as initial values: with units and parameters. A name without a value is an
    unknown speed.

    Raises
    ------
    ModelError, UsageError, FileError
        As `lagcli.load`; or a name is not a velocity of the model.
    """
    from lagcli.analysis.local.steady import velocity_coordinate
    from lagcli.analysis.local.steady_terms import is_velocity, steady_unit
    from lagcli.model.loader import load, load_text
    from lagcli.model.values import given_value

    parameters: dict[str, object] = {**assignments("--set", set)}
    initial: dict[str, object] = {**assignments("--set-initial", set_initial)}
    loaded = load(model, parameters, initial, preset=preset)
    parameters, initial = dict(loaded.set), dict(loaded.set_initial)
    items = list(steady or ())
    unknown = [item.strip() for item in items if "=" not in item and item.strip()]
    held = assignments("--steady", [item for item in items if item.strip() not in unknown])
    names = {
        text: velocity_coordinate(loaded.coordinate_names, text)
        for text in held
        if is_velocity(loaded.coordinate_names, text)
    }
    for text, name in names.items():
        form = f'after the value, as in --steady "{text}={held[text]} UNIT"'
        _check_unit(loaded, "--steady", f"{name}'", held[text], form)
    target_values: dict[str, float | None] = {
        text: given_value(loaded, "--steady", text, value, steady_unit)
        for text, value in held.items()
        if text not in names
    }
    again = loaded
    if names:
        # as guesses: the analysis reports constraints that determine them
        velocities = {f"{name}'": f"{{guess: {held[text]}}}" for text, name in names.items()}
        given = {name: value for name, value in initial.items() if f"{name}'" not in velocities}
        initial = {**given, **velocities}
        again = load_text(loaded.text, loaded.path, parameters, initial, loaded.data)
    values = {f"{name}'": again.initial_velocities[name].value for name in names.values()}
    return again, {**values, **target_values, **dict.fromkeys(unknown)}


def _check_unit(model: Model, option: str, name: str, text: str, form: str) -> None:
    """Raise an error for a number without a unit if the file gives it in another unit than SI."""
    from lagcli.model.expression.tokens import is_number
    from lagcli.sweeps.plan.vary import si_factor

    if is_number(text):
        try:
            si_factor(model, name, None, form)
        except UsageError as error:
            raise UsageError(f"{option}: {error}") from None


def print_analysis(
    content: Mapping[str, Any],
    format: Callable[[], str],
    written: str | None,
    json: bool,
    quiet: bool,
) -> None:
    """Print the result of an analysis, as JSON or text, and the name of its file."""
    from lagcli.cli.summary import to_json

    if json:
        print(to_json(content))
    elif written is None:
        print_listing(formatted(format))
    elif not quiet:
        tell(f"{formatted(format)}\n  written  {written}")


def formatted(format: Callable[[], str]) -> str:
    """Return the text of an analysis, laid out for a terminal where it is printed on one."""
    from lagcli.analysis.output.text import laid_out

    if not sys.stdout.isatty():
        return format()
    with laid_out(text_width()):
        return format()


def load_along(model: Model, along: str) -> tuple[Model, str, float, float]:
    """Parse NAME=START:END, and load the model with the parameter at its start.

    Both ends are parsed as values of the parameter, or as initial velocities: with units, which may
    follow the last only.

    Returns
    -------
    model : Model
    name : str
        The parameter, a velocity (``phi'``), or another value of a steady motion.
    start, end : float
        The ends, SI.

    Raises
    ------
    ModelError, UsageError
        The text does not have this form, or there is no such parameter or velocity.
    """
    from lagcli.analysis.local.steady import velocity_coordinate
    from lagcli.analysis.local.steady_terms import is_velocity, steady_unit
    from lagcli.model.expression.tokens import is_number
    from lagcli.model.expression.units import WITH_UNIT
    from lagcli.model.loader import load_text
    from lagcli.model.spelling import did_you_mean, nearest
    from lagcli.model.values import given_value

    name, equals, span = along.partition("=")
    first, colon, last = span.partition(":")
    name, ends = name.strip(), (first.strip(), last.strip())
    if (unit := WITH_UNIT.fullmatch(ends[1])) and is_number(ends[0]):
        ends = f"{ends[0]} {unit[2]}", ends[1]  # the unit after the last is that of both
    if not (equals and colon and name and all(ends)) or ":" in last:
        raise UsageError(f"--along {along!r} is not of the form NAME=START:END, as in P=0:3")
    unknown = name.isidentifier() and not name.endswith("_dot")
    momentum = re.fullmatch(r"J_\d+|p_.*", name)
    held = name in model.coordinate_names or momentum or not name.isidentifier()
    if name not in model.parameters and unknown and not held:
        known = list(model.parameters)
        listed = f"its parameters are {', '.join(known[:20])}" if known else "it has none"
        raise UsageError(
            f"--along: the model has no parameter `{name}`;"
            f" {did_you_mean(nearest(name, known)) or listed}"
        )
    form = f'after the last value, as in --along "{name}={ends[0]}:{ends[1]} UNIT"'
    if name in model.parameters:
        _check_unit(model, "--along", name, ends[0], form)
        models = [
            load_text(
                model.text, model.path, {**model.set, name: end}, model.set_initial, model.data
            )
            for end in ends
        ]
        start, end = (m.parameters[name].value for m in models)
        return models[0], name, start, end
    if not is_velocity(model.coordinate_names, name):
        values = [given_value(model, "--along", name, end, steady_unit) for end in ends]
        return model, name, values[0], values[1]
    coordinate = velocity_coordinate(model.coordinate_names, name)
    _check_unit(model, "--along", f"{coordinate}'", ends[0], form)
    given = {k: x for k, x in model.set_initial.items() if k not in (name, f"{coordinate}'")}
    models = [
        load_text(
            model.text,
            model.path,
            model.set,
            {**given, f"{coordinate}'": f"{{guess: {end}}}"},
            model.data,
        )
        for end in ends
    ]
    start, end = (m.initial_velocities[coordinate].value for m in models)
    return models[0], f"{coordinate}'", start, end
