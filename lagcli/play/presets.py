"""Presets of a model for the page: the values that its controls get."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from lagcli.model.loader import load_text
from lagcli.model.model import InitialValue, Model, Parameter
from lagcli.model.sections.presets import not_replaced
from lagcli.play.controls import Control


def presets(
    model: Model, controls: Mapping[str, Control], settable: Collection[str] | None = None
) -> list[dict[str, Any]]:
    """Return the presets of a model as JSON values: those that fit its number of members.

    Parameters
    ----------
    model : Model
    controls : mapping of str to Control
    settable : collection of str, optional
        Names of the controls that the page can set; by default all.

    Returns
    -------
    list of dict
        ``name``, ``description``, ``state`` as the page has it, [name, {text, free}] of each value,
        and ``locked``, the names of those that the page cannot set.
    """
    described = []
    for preset in model.presets:
        if preset.errors:
            continue
        own = (model.set, model.set_initial)
        kept = not_replaced(model, own, (preset.set, preset.set_initial))
        changed = load_text(model.text, model.path, *kept, model.data, preset=preset.name)
        values: dict[str, Parameter | InitialValue] = {**changed.parameters, **changed.initial}
        names = [*preset.set, *_components(changed, preset.set_initial)]
        described.append(
            {
                "name": preset.name,
                "description": preset.description or "",
                "state": [[name, _value(controls[name], values[name])] for name in names],
                "locked": [x for x in names if settable is not None and x not in settable],
            }
        )
    return described


def _value(control: Control, value: Parameter | InitialValue) -> dict[str, Any]:
    """Return a value in the unit of its control, and whether it is a guess."""
    free = isinstance(value, InitialValue) and not value.fixed
    return {"text": repr(control.shown(value.value)).removesuffix(".0"), "free": free}


def _components(model: Model, names: Mapping[str, str]) -> Iterator[str]:
    """Yield names of coordinates and velocities: of a vector, those of its components."""
    for name in names:
        if name in model.initial:
            yield name
            continue
        base = name.rstrip("'")
        primes = name[len(base) :]
        for coordinate in model.coordinate_names:
            if coordinate.rpartition(".")[0] == base:
                yield coordinate + primes
