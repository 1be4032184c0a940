"""What a live page knows of a model: controls, names, plots, scene, and the data of the core."""

from __future__ import annotations

import dataclasses
import os
import shlex
from functools import cached_property
from typing import Any, NamedTuple

import symengine as se

from lagcli.engine.event_entries import OCCURRENCES
from lagcli.errors import UsageError
from lagcli.live.columns import LiveColumns
from lagcli.model.expression.units import to_si
from lagcli.model.model import Model
from lagcli.model.reading import shipped_models
from lagcli.pictures.curves import Catalogue
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.arms import arm_units
from lagcli.pictures.scene.automatic_view import with_view
from lagcli.pictures.scene.curve_picture import curve_image
from lagcli.pictures.scene.drag import draggable, with_rims
from lagcli.pictures.scene.scene import (
    LEAST,
    LIFE,
    LONG,
    MARGIN,
    MOST_FLASHES,
    ROUNDED,
    WEAK,
    Scene,
)
from lagcli.pictures.scene.still import still_image
from lagcli.pictures.scene.view_evaluator import ViewEvaluator, multipliers_in
from lagcli.pictures.selection import FAMILY, RATIO, ROUNDING
from lagcli.pictures.style import PALETTE, constraint_colors
from lagcli.play.controls import Control, controls
from lagcli.play.equations import PlayEquations
from lagcli.play.presets import presets
from lagcli.play.runs import live_plot, model_word, plot_groups, resampled
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.contacts import refuse_nonlinear_impulses
from lagcli.simulations.resources import Resources, method_of, resources, settable_parameters
from lagcli.simulations.simulation import Simulation, prepare
from lagcli.simulations.start import determined_values
from lagcli.trajectory.samples import Record

#: Coordinates up to which bodies can be dragged: each step tries a change of every coordinate.
_DRAGGED = 24
#: Columns that the page computes from all samples.
_BALANCE = "energy_balance"


class LiveContent(NamedTuple):
    """The content of a live page.

    Parameters
    ----------
    model : Model
    data : dict
        JSON values: what the page shows, and where the numbers of a sample are.
    resources : Resources
        What the core needs.
    still : str
        HTML of an image of the model's own run, for browsers without JavaScript.
    """

    model: Model
    data: dict[str, Any]
    resources: Resources
    still: str


def live_content(model: Model, settings: SettingsOverrides | None = None) -> LiveContent:
    """Return the content of a live page.

    Parameters
    ----------
    model : Model
    settings : SettingsOverrides, optional
        Instead of those of the model.

    Raises
    ------
    ModelError, NumericalError
        There is no consistent initial state.
    UsageError
        The model's own run fails, or goes through a singular configuration, which needs lagcli.
    """
    return _Contents(model, settings).content()


class _Contents:
    """The content of the page of one model."""

    def __init__(self, model: Model, settings: SettingsOverrides | None):
        refuse_nonlinear_impulses(model, "a page that simulates")
        self.model = model = with_rims(with_view(model))
        self.simulation = _sampled(prepare(model, settings))
        self.run = self.simulation.trajectory()
        _check(self.run)
        self.columns = LiveColumns(self.simulation)
        self.settable = settable_parameters(model)

    def content(self) -> LiveContent:
        model, settings = self.model, self.simulation.settings
        data: dict[str, Any] = {
            "hello": self._hello(),
            "plots": self._plots(),
            "scene": self._scene(),
            "balance": self._balance(),
            "names": {
                "coordinates": [*model.coordinate_names],
                "constraints": [*model.constraint_names],
                "parameters": [*model.parameters],
                "events": [event.name for event in model.events],
            },
            "controls": {name: _set(control) for name, control in self._controls().items()},
            "determined": determined_values(model, self.simulation.system, self.simulation.start),
            "guesses": [name for name, x in model.initial.items() if not x.fixed],
            "settings": {
                "t_start": settings.t_start,
                "t_end": settings.t_end,
                "rtol": settings.rtol,
                "count": settings.sample_count,
                "dt": settings.dt,
                "times": settings.times,
            },
            "velocities": [model.initial_velocities[q].value for q in model.coordinate_names],
            "angles": [coordinate.unit == "rad" for coordinate in model.coordinates],
            "checks": self._checks(),
            "log": self._log(),
            "panels": {"ratio": RATIO, "family": FAMILY, "rounding": ROUNDING},
            "places": {"energy_total": self.columns.named["energy_total"]},
            "method": self._method,
            "command": self._command(),
            "files": {f"{model.name}.yaml": model.text, **_tables(model)},
        }
        derived = self.columns.tape()
        return LiveContent(
            model, data, resources(self.simulation, self._method, derived), self._still()
        )

    @cached_property
    def _method(self) -> str:
        return method_of(self.simulation)

    def _controls(self) -> dict[str, Control]:
        """Return the controls, without structural parameters, which give other equations."""
        structural = set(self.model.structural_parameters)
        every = controls(self.model, self.simulation.settings)
        return {name: control for name, control in every.items() if name not in structural}

    def _hello(self) -> dict[str, Any]:
        model = self.model
        known = {*self.settable, *model.initial, "t_end"}
        groups = plot_groups(model)
        return {
            "name": model.title,
            "slug": model.name,
            "description": model.description or "",
            "palette": list(PALETTE),
            "members": "",
            "controls": [
                {**control.to_json(), "suffix": "", "follows": name not in known}
                for name, control in self._controls().items()
            ],
            "presets": presets(model, self._controls(), known),
            "groups": {key: title for key, title in groups.items() if self._quantities(key)},
            "draggable": draggable(model) if len(model.coordinates) <= _DRAGGED else [],
            "equations": self._equations.html,
            "colors": constraint_colors(model.constraint_names),
            "arms": arm_units(model),
        }

    @cached_property
    def _equations(self) -> PlayEquations:
        return PlayEquations(self.simulation.equations, cuttable=False)

    # plots

    @cached_property
    def _file(self) -> RunFile:
        return RunFile(self.run)

    def _quantities(self, group: str) -> dict[str, Any] | None:
        """Return a plot with the places of its values; None if the page has none of them."""
        plot = live_plot(self.model, self._file, group)
        series = [
            {
                **{key: x for key, x in curve.items() if key not in ("values", "panel")},
                "column": column,
                "jumps": curve["name"] in self.run.display.get("jumping", ()),
            }
            for curve in plot["series"]
            if (column := self._column(curve["name"])) is not None
        ]
        if not series:
            return None
        return {**plot, "time": None, "marks": None, "series": series}

    def _column(self, name: str) -> int | None:
        return -1 if name == _BALANCE else self.columns.named.get(name)

    def _plots(self) -> dict[str, Any]:
        plots = {group: self._quantities(group) for group in plot_groups(self.model)}
        return {group: plot for group, plot in plots.items() if plot is not None}

    # the mechanism

    @cached_property
    def _nominal(self) -> Scene:
        """The scene of the model's own run."""
        evaluator, values = ViewEvaluator(self.model), self.model.parameter_values
        return evaluator.scene(vars(self.run), self.run.terms, values)

    def _still(self) -> str:
        """Return an image of the model's own run: of its coordinates, if it has no view."""
        if self.model.view is not None:
            return still_image(self._nominal, self.model.title)
        labels = [curve.label for curve in Catalogue(self._file).of("q")]
        return curve_image(self.run.time, self.run.q, labels, "")

    def _scene(self) -> dict[str, Any] | None:
        """Return the scene with places of its numbers, as `answers.js` reads it."""
        model, view = self.model, self.model.view
        if view is None:
            return None
        evaluator = ViewEvaluator(model)
        places = self.columns.evaluate(evaluator.expressions)
        nominal = self._nominal

        def at(slots: Any) -> Any:
            if isinstance(slots, list):
                return [places[i] for i in slots]
            return None if slots is None else places[slots]

        discs = {
            disc.name: {"radius": at(radius), "angle": at(angle), "normal": at(normal)}
            for disc, (radius, angle, normal) in zip(view.discs, evaluator.discs, strict=True)
        }
        shapes = [
            shape | discs[shape["name"]] if shape["kind"] == "disc" else shape
            for shape in nominal.to_json(lambda values: None)["shapes"]
            if shape["kind"] not in ("vector", "flash")
        ]
        return {
            "dimension": view.dimension,
            "unit": nominal.unit,
            "points": {name: at(slots) for name, slots in evaluator.points.items()},
            "shapes": shapes,
            "vectors": self._vectors(evaluator, places),
            "margin": MARGIN,
            "long": LONG,
            "least": LEAST,
            "rounded": ROUNDED,
            "flashes": {"life": LIFE, "weak": WEAK, "most": MOST_FLASHES},
        }

    def _vectors(self, evaluator: ViewEvaluator, places: list[int]) -> list[dict[str, Any]]:
        """Return the vectors; those of constraint forces have what determines them."""
        model, view, columns = self.model, self.model.view, self.columns
        assert view is not None
        vectors: list[dict[str, Any]] = []
        for arrow, slots, force in zip(
            view.vectors, evaluator.arrows, evaluator.forces, strict=True
        ):
            vector: dict[str, Any] = {
                "name": arrow.name,
                "quantity": arrow.quantity,
                "unit": evaluator.unit_of(arrow),
                "points": list(dict.fromkeys(arrow.points)),
            }
            if force is None:
                vector |= {
                    "constraint": None,
                    "parts": [*multipliers_in(arrow.components, model)],
                    "components": [places[i] for i in slots],
                }
            else:
                point_force, entries = force
                rows = [model.constraint_names.index(name) for name in arrow.parts]
                works = [
                    columns.total([columns.force(row, j) for row in rows])
                    for j in point_force.columns
                ]
                vector |= {
                    "constraint": arrow.constraint,
                    "parts": [*arrow.parts],
                    "entries": [places[i] for i in entries],
                    "work": columns.add(works),
                }
            vectors.append(vector)
        return vectors

    # equations and events

    def _balance(self) -> list[dict[str, Any]]:
        balance = self._equations.balance
        return balance.described(self.run.units, self.columns.evaluate(balance.expressions))

    def _log(self) -> dict[str, Any] | None:
        """Return the names in the log; None of a model without contacts and events."""
        log, switching = self.run.events, self.simulation.system.switching
        if log is None or switching is None:
            return None
        return {"kinds": [*OCCURRENCES], "rows": [*log.rows], "start": log.start.tolist()}

    def _checks(self) -> list[dict[str, Any]]:
        """Return the coefficients of contacts that parameters determine, and their ranges."""
        known = {se.Symbol(name) for name in self.model.parameters}
        coefficients: list[tuple[str, Any, float | None]] = []
        for c in self.model.constraints:
            limits = () if c.limit is None else (c.limit.static, c.limit.kinetic)
            coefficients += [(f"restitution of {c.name}", c.restitution, 1.0)]
            coefficients += [(f"limit of {c.name}", limit, None) for limit in limits]
        given = [
            (text, value, most)
            for text, value, most in coefficients
            if value is not None and value.free_symbols and value.free_symbols <= known
        ]
        places = self.columns.evaluate([value for _, value, _ in given])
        return [
            {"text": text, "column": place, "most": most}
            for (text, _, most), place in zip(given, places, strict=True)
        ]

    def _command(self) -> dict[str, Any]:
        """Return the command line of the model's own run, and the values that it has."""
        model = self.model
        word = model_word(model.path)
        if not (os.path.exists(model.path) or word in shipped_models()):
            word = f"{model.name}.yaml"  # that of a run: the page has it as a file
        return {
            "words": shlex.join(["lagcli", "simulate", word]),
            "set": {name: str(value) for name, value in model.set.items()},
            "set_initial": {name: str(value) for name, value in model.set_initial.items()},
        }


def _sampled(simulation: Simulation) -> Simulation:
    """Return a simulation as a page runs it: with at most as many samples as it draws quickly.

    And never through a singular configuration: a run that needs that fails here.
    """
    settings = simulation.settings.replace(through_singular=False)
    return dataclasses.replace(simulation, settings=resampled(settings))


def _check(record: Record) -> None:
    """Raise UsageError if the model's own run cannot be repeated in a page."""
    if record.status not in ("completed", "stopped-by-event"):
        raise UsageError(
            "a page simulates a model whose own run is completed; this one is"
            f" {record.status}: {record.message}"
        )


def _set(control: Control) -> dict[str, Any]:
    """Return how a value of a control is converted to SI, and written on the command line."""
    factor = float(to_si(control.unit)) if control.unit else 1.0
    return {
        "kind": control.kind,
        "factor": factor,
        "suffix": control.suffix,
        "unit": control.unit,
        "whole": control.whole,
    }


def _tables(model: Model) -> dict[str, str]:
    """Return the files with the tables of a model's inputs, those that can be read, by name."""
    tables = {}
    for data in model.data.values():
        path = os.path.join(os.path.dirname(model.path), data.file)
        if data.file and os.path.isfile(path):
            with open(path, encoding="utf-8") as file:
                tables[os.path.basename(data.file)] = file.read()
    return tables
