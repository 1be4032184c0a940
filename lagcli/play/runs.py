"""Runs of a model with the values of the page, and the data that the page shows."""

from __future__ import annotations

import dataclasses
import math
import os
import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import BY_NAME, PANELS, ResultQuantity
from lagcli.errors import UsageError
from lagcli.model.loader import load_text
from lagcli.model.model import Model
from lagcli.model.names.members import family_of
from lagcli.model.reading import shipped_models
from lagcli.model.rewriting import rewrite, with_releases
from lagcli.model.spelling import shorten
from lagcli.pictures.curves import Catalogue
from lagcli.pictures.jumps import Jumps, marks
from lagcli.pictures.page import unit
from lagcli.pictures.report.run_plots import ALL_FORCES
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.arms import arm_units
from lagcli.pictures.scene.automatic_view import with_view
from lagcli.pictures.scene.curve_picture import curve_picture
from lagcli.pictures.scene.drag import draggable, with_rims
from lagcli.pictures.scene.scene import with_contacts
from lagcli.pictures.scene.still import still_drawing
from lagcli.pictures.scene.timing import usual_speed
from lagcli.pictures.scene.view_evaluator import ViewEvaluator
from lagcli.pictures.selection import by_family, drawn, scale_groups
from lagcli.pictures.style import PALETTE, constraint_colors, family_colors
from lagcli.play.controls import Control, controls, family_label
from lagcli.play.drags import DragRequest, Drags
from lagcli.play.equations import PlayEquations
from lagcli.play.presets import presets
from lagcli.settings.settings import Settings, SettingsOverrides, resolve
from lagcli.simulations.cancellation import Interruption
from lagcli.simulations.sampling import sample_times
from lagcli.simulations.simulation import Simulation
from lagcli.simulations.start import determined_values
from lagcli.simulations.variants import Variants
from lagcli.trajectory.event_log import EventLog, event_sentences
from lagcli.trajectory.trajectory import Trajectory

#: Largest number of samples that a page can draw quickly; runs with more are resampled.
MOST_SAMPLES = 4001
#: Default time limit of a run, s.
TIMEOUT = 5.0
#: Largest number of members for which the page derives equations; more take seconds.
MOST_MEMBERS = 500


@dataclass(frozen=True)
class PlayRequest:
    """A request of the page.

    Parameters
    ----------
    number : int
        Identifier that associates the response.
    set, set_initial : mapping of str to str
        Values as on the command line, in addition to those that the program was started with.
    t_end : str
        End time, s; empty for the model's.
    plots : tuple of str
        Groups of curves.
    members : str
        The numbers of members for which the page has controls; see `Played.members`.
    drag : DragRequest, optional
        A drag: the response has initial values instead of a run.
    balance : bool
        Whether the response has the terms of the equations.
    cuts : mapping of str to float
        Times from which on constraints do not act, by their names, s.
    """

    number: int = 0
    set: Mapping[str, str] = field(default_factory=dict)
    set_initial: Mapping[str, str] = field(default_factory=dict)
    t_end: str = ""
    plots: tuple[str, ...] = ()
    members: str = ""
    drag: DragRequest | None = None
    balance: bool = False
    cuts: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def parsed(cls, message: Mapping[str, Any]) -> PlayRequest:
        """Return the request in a message of the page.

        Raises
        ------
        ValueError
            The message is invalid.
        """
        number, plots = message.get("number"), message.get("plots", [])
        if not isinstance(number, int) or not _texts(plots):
            raise ValueError("a request has a number and a list of plots")
        tables = [message.get(key, {}) for key in ("set", "set_initial")]
        if not all(isinstance(t, dict) and _texts([*t, *t.values()]) for t in tables):
            raise ValueError("values are texts")
        texts = [message.get(key, "") for key in ("t_end", "members")]
        if not _texts(texts):
            raise ValueError("t_end and members are texts")
        cuts = message.get("cuts", {})
        if not isinstance(cuts, dict) or not all(map(_is_time, cuts.values())):
            raise ValueError("cuts are times")
        drag = DragRequest.parsed(message.get("drag"))
        return cls(
            *(number, tables[0], tables[1], texts[0], tuple(plots), texts[1], drag),
            balance=message.get("balance") is True,
            cuts={str(name): float(time) for name, time in cuts.items()},
        )


class Played:
    """A model that is simulated interactively.

    Parameters
    ----------
    model : Model
        Model with the values of the command line.
    settings : SettingsOverrides, optional
        End time and time limit of a run: by default `TIMEOUT`.

    Attributes
    ----------
    controls : dict of str to Control
    members : str
        The numbers of members of the current controls: N=20.

    Raises
    ------
    UsageError
        A setting is out of its range.
    """

    def __init__(self, model: Model, settings: SettingsOverrides | None = None):
        self._started = model
        self._cuts: dict[str, float] = {}
        self._given = (settings or SettingsOverrides()).over(SettingsOverrides(timeout=TIMEOUT))
        self._take(model)

    def _take(self, model: Model) -> None:
        self.model = model = with_rims(with_view(model))
        self._variants = Variants(model, self._settings(""))
        self.controls: dict[str, Control] = controls(model, self._variants.settings)
        structural = (model.parameters[name] for name in model.structural_parameters)
        self.members = " ".join(f"{p.name}={p.value:g}" for p in structural)
        self._evaluator = ViewEvaluator(model) if model.view is not None else None
        self._equations = PlayEquations(self._variants.equations)
        self._drags = Drags(model, self._evaluator) if self._evaluator is not None else None

    def check(self) -> None:
        """Raise an error if the values of the command line are invalid.

        Raises
        ------
        ModelError, UsageError, NumericalError
            As `lagcli.simulations.simulation.prepare`.
        """
        self._variants.varied()

    def _settings(self, t_end: str) -> SettingsOverrides:
        return self._given.replace(t_end=_number(t_end, "t_end")) if t_end else self._given

    def run(self, request: PlayRequest, interruption: Interruption) -> dict[str, Any]:
        """Run a request.

        Returns
        -------
        dict
            Response to the page: JSON values and arrays.

        Raises
        ------
        ModelError, UsageError, NumericalError
            The values are invalid.
        """
        if request.drag is not None:
            return self._dragged(request, request.drag)
        self._adapt(request)
        request = self._fitting(request)
        simulation = self._variants.varied(request.set, request.set_initial)
        settings = resolve(self._settings(request.t_end), simulation.model.settings)
        simulation = dataclasses.replace(simulation, settings=resampled(settings))
        run = simulation.trajectory(None, interruption)
        if self._drags is not None:
            self._drags.take(run)
        answer = self._answer(request, simulation, run)
        return answer if request.members == self.members else answer | self.description()

    def still(self) -> str:
        """Return a picture of the run with the values of the command line, as the text of an SVG.

        Raises
        ------
        ModelError, UsageError, NumericalError
            As `check`, and where the run cannot start.
        """
        simulation = self._variants.varied()
        run = simulation.trajectory()
        if self._evaluator is not None:
            parameters = simulation.model.parameter_values
            return still_drawing(self._evaluator.scene(vars(run), run.terms, parameters)).svg()
        labels = [curve.label for curve in Catalogue(RunFile(run)).of("q")]
        return curve_picture(run.time, run.q, labels, "").svg()

    def _dragged(self, request: PlayRequest, drag: DragRequest) -> dict[str, Any]:
        """Process a request to move a body."""
        if self._drags is None or not self._drags.fits(drag):
            raise UsageError("the moved body does not belong to this model")
        asked = self._fitting(request)
        moved = self._drags.drag(drag, lambda: self._variants.varied(asked.set, asked.set_initial))
        values = {name: self.controls[name].shown(x) for name, x in moved["initial"].items()}
        initial = {**asked.set_initial, **self._written(values, asked.set_initial)}
        command = self.command(dataclasses.replace(asked, set_initial=initial))
        return {"number": request.number, **moved, "initial": values, "command": command}

    def _written(self, values: Mapping[str, float], given: Mapping[str, str]) -> dict[str, str]:
        """Return initial values in the syntax of the command line; guesses remain guesses."""
        written = {}
        for name, value in values.items():
            control = self.controls[name]
            text = f"{value!r}{control.suffix}"
            free = given[name].startswith("{") if name in given else control.free
            written[name] = f"{{guess: {text}}}" if free else text
        return written

    def description(self) -> dict[str, Any]:
        """Return the description of the model for the page."""
        return {
            "members": self.members,
            "controls": [c.to_json() for c in self.controls.values()],
            "presets": presets(self.model, self.controls),
            "groups": plot_groups(self.model),
            "draggable": draggable(self.model),
            "equations": self._equations.html,
            "colors": constraint_colors(self.model.constraint_names),
            "arms": arm_units(self.model),
        }

    def _adapt(self, request: PlayRequest) -> None:
        """Derive the equations again if the number of members or the cut constraints change."""
        started = self._started
        wanted = {n: x for n, x in request.set.items() if n in started.structural_parameters}
        given, cuts = {**started.set, **wanted}, dict(request.cuts)
        if given == self.model.set and cuts == self._cuts:
            return
        for name, text in wanted.items():
            self._check_members(name, _number(text, name))
        text = self._released(cuts)
        self._take(load_text(text, started.path, given, started.set_initial, started.data))
        self._cuts = cuts

    def _released(self, cuts: Mapping[str, float]) -> str:
        """Return the model file, with events that release the cut constraints."""
        settings = resolve(self._given, self._started.settings)
        # an event whose condition holds at the start does not happen then
        first = settings.t_start + 1e-9 * (settings.t_end - settings.t_start)
        times = {name: max(time, first) for name, time in cuts.items()}
        return with_releases(self._started.text, self._started.path, times)

    def _check_members(self, name: str, value: float) -> None:
        if abs(value) > max(MOST_MEMBERS, abs(self._started.parameters[name].value)):
            raise UsageError(
                f"{name} = {value:g}: this page goes as far as {MOST_MEMBERS}; lagcli simulate has"
                " no such limit"
            )

    def _fitting(self, request: PlayRequest) -> PlayRequest:
        """Remove values of members that the model, with fewer of them, does not have."""
        families = {c.family for c in self.controls.values() if c.family}

        def known(values: Mapping[str, str]) -> dict[str, str]:
            return {
                name: value
                for name, value in values.items()
                if name in self.controls or family_label(name.rstrip("'")) not in families
            }

        return dataclasses.replace(
            request, set=known(request.set), set_initial=known(request.set_initial)
        )

    def _answer(
        self, request: PlayRequest, simulation: Simulation, run: Trajectory
    ) -> dict[str, Any]:
        model, start = simulation.model, simulation.start.state
        values = {**model.parameter_values, **{n: x.value for n, x in model.initial.items()}}
        states = zip(model.coordinate_names, start.q.tolist(), start.v.tolist(), strict=True)
        first = {
            name: x for q, *state in states for name, x in zip((q, f"{q}'"), state, strict=True)
        }
        shown = {name: self.controls[name].shown for name in values}
        groups = plot_groups(self.model)
        result = RunFile(run)
        return {
            "number": request.number,
            "status": run.status,
            "message": on_page(run.message) if run.status != "completed" else "",
            "values": {name: shown[name](x) for name, x in values.items()},
            "start": {
                name: shown[name](first[name]) for name, x in model.initial.items() if not x.fixed
            },
            "determined": determined_values(model, simulation.system, simulation.start),
            "t_end": simulation.settings.t_end,
            "method": run.options["method"],
            "counts": run.counts,
            "seconds": run.seconds["integrate"],
            "command": self.command(request),
            "events": happened(run.events),
            "scene": self._scene(model, run),
            "balance": self._balance(model, run) if request.balance else None,
            "speed": usual_speed(float(np.ptp(run.time))) if len(run.time) else 1.0,
            "plots": {
                group: live_plot(self.model, result, group)
                for group in request.plots
                if group in groups
            },
        }

    def _scene(self, model: Model, run: Trajectory) -> dict[str, Any] | None:
        if self._evaluator is None or not len(run.time):
            return None
        scene = self._evaluator.scene(vars(run), run.terms, model.parameter_values)
        scene = with_contacts(scene, run.events, run.constraints)
        return scene.to_json(lambda values: values)

    def _balance(self, model: Model, run: Trajectory) -> dict[str, Any]:
        """Return the terms of the equations along a run."""
        values, balance = model.parameter_values, self._equations.balance
        return {
            "time": run.time,
            "equations": balance.to_json(vars(run), run.terms, values, run.units, lambda x: x),
        }

    # output of the page

    def command(self, request: PlayRequest) -> str:
        """Return the command line that reproduces a run, quoted for the shell."""
        started, request = self._started, self._fitting(request)
        if request.cuts:  # they are in the saved file
            words = ["lagcli", "simulate", f"{started.name}_changed.yaml", "-o", "run.h5"]
            return shlex.join(words)
        words = ["lagcli", "simulate", model_word(started.path)]
        for option, values in (
            ("--set", {**started.set, **request.set}),
            ("--set-initial", {**started.set_initial, **request.set_initial}),
        ):
            for name, value in values.items():
                words += [option, f"{name}={value}"]
        end = request.t_end or self._given.t_end
        if end:
            words += ["--t-end", str(end)]
        return shlex.join([*words, "-o", "run.h5"])

    def text(self, request: PlayRequest) -> str:
        """Return the model file with the values of a request.

        Raises
        ------
        ModelError
            As `rewrite`.
        UsageError
            The end time is not a number.
        """
        started, request = self._started, self._fitting(request)
        end = self._settings(request.t_end).t_end
        return rewrite(
            self._released(request.cuts),
            started.path,
            {n: str(x) for n, x in {**started.set, **request.set}.items()},
            {n: str(x) for n, x in {**started.set_initial, **request.set_initial}.items()},
            end,
        )


def resampled(settings: Settings) -> Settings:
    """Return settings with at most as many samples as a page draws quickly."""
    if settings.sample_count <= MOST_SAMPLES:
        return settings
    last = float(sample_times(settings)[-1])
    return settings.replace(t_end=last, samples=MOST_SAMPLES, dt=None, times=None)


def model_word(path: str) -> str:
    """Return the argument for the model on the command line: its name for a shipped one."""
    if path == "<stdin>":
        return "-"
    shipped = {str(file): name for name, file in shipped_models().items()}
    name = shipped.get(path, path)
    return path if os.path.exists(name) else name


def _texts(values: Any) -> bool:
    return isinstance(values, list) and all(isinstance(x, str) for x in values)


def _is_time(value: Any) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value)


def _number(text: str, name: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"{name} is a number on this page, not {shorten(text)!r}") from None


#: The group of the model's outputs.
_OUTPUTS = "outputs"


def plot_groups(model: Model) -> dict[str, str]:
    """Return the groups of curves that a model has, with their titles."""
    panels = [panel for panel in PANELS if _quantities(model, panel)]
    groups = [*panels, _OUTPUTS] if model.outputs else panels
    return {group: group.capitalize() for group in groups}


def _quantities(model: Model, panel: str) -> list[ResultQuantity]:
    """Return the quantities of a panel that the model has and the page shows."""

    def exists(quantity: ResultQuantity) -> bool:
        if quantity.name in ("energy_kinetic", "energy_potential"):
            return model.kinetic is not None  # not if it is given by L
        if quantity.along == "term":  # too many
            return False
        if quantity.name == "residual_position":
            return any(c.kind == "holonomic" for c in model.constraints)
        if quantity.along == "conserved_quantity":  # computed again for each run
            return False
        if quantity.name in ("multipliers", "constraint_force"):  # 0 for first-order coordinates
            return any(not c.of_coordinate for c in model.constraints)
        return bool(model.constraints) or quantity.along != "constraint"

    return list(filter(exists, PANELS.get(panel, ())))


def live_plot(model: Model, run: RunFile, group: str) -> dict[str, Any]:
    """Return a plot of a run for ``plots.js``, with arrays; its series contain their panels.

    Parameters
    ----------
    model : Model
    run : RunFile
    group : str
        One of `plot_groups`.
    """
    catalogue, quantities = Catalogue(run), _quantities(model, group)
    stated = model.units.stated or group == _OUTPUTS
    curves = [curve for q in quantities for curve in catalogue.of(q.name)]
    if group == _OUTPUTS:
        curves = catalogue.outputs()
    columns = run.columns(["time", *(c.field for c in curves)])
    values = {c.name: c.of(columns) for c in curves}
    along = {q.name for q in quantities if q.along == "constraint"}
    # without constraints that have no values
    curves = [c for c in curves if c.field not in along or not np.isnan(values[c.name]).all()]
    colors = family_colors([c.name for c in curves])
    residuals = any(q.role == "residual" for q in quantities)
    stated_units = [unit(c.unit) if stated else "" for c in curves]
    every = _families([c.name for c in curves], stated_units)
    keys = [c.field for c in curves] if residuals else stated_units
    places = _drawn(list(zip(keys, every, strict=True)))
    shown = [curves[i] for i in places]
    units, families = [stated_units[i] for i in places], [every[i] for i in places]
    time, names = columns["time"], [c.name for c in shown]
    table = np.array([values[name] for name in names]).reshape(len(shown), len(time)).T
    panels = [0] * len(shown) if residuals else _panels(units, families, table)
    time, table = Jumps(run).inserted(time, names, table)
    return {
        "title": group.capitalize(),
        "symbol": ALL_FORCES if BY_NAME["constraint_force"] in quantities else "",
        "log": residuals,
        # λ is drawn in the colour of its constraint
        "by_constraint": bool(shown) and all(c.field == "multipliers" for c in shown),
        "time": time,
        "marks": marks(run.record.events),
        "series": [
            {
                "name": c.name,
                "label": f"{c.label} [{unit_}]" if residuals and unit_ else c.label,
                "unit": unit_,
                "family": family,
                "panel": panel,
                "constraint": c.constraint,
                "values": of,
                **({"color": colors[c.name]} if c.name in colors else {}),
            }
            for c, unit_, family, panel, of in zip(
                shown, units, families, panels, table.T, strict=True
            )
        ],
        "of": len(curves),
    }


def _drawn(keys: list[tuple[str, str]]) -> list[int]:
    """Return the places of the curves that are drawn: of each key all, or some of many."""
    places: list[int] = []
    for key in dict.fromkeys(keys):
        own = [i for i, of in enumerate(keys) if of == key]
        places += [own[k] for k in drawn(len(own))]
    return sorted(places)


def _families(names: list[str], units: list[str]) -> list[str]:
    """Return the large family of each curve, which has a panel of its own; "" for other curves."""
    families = [""] * len(names)
    for symbol in dict.fromkeys(units):
        places = [i for i, stated in enumerate(units) if stated == symbol]
        for group in by_family([names[i] for i in places], len(PALETTE)):
            own = {family_of(names[places[k]]) for k in group}
            if len(own) == 1 and len(places) > len(PALETTE):
                for k in group:
                    families[places[k]] = next(iter(own))
    return families


def _panels(units: list[str], families: list[str], values: Array) -> list[int]:
    """Return the panel of each curve: curves of the same unit and similar size share one.

    A large family is not divided by size.
    """
    parts: list[list[int]] = []
    largest = np.fmax.reduce(np.abs(values), axis=0, initial=0.0).tolist()
    of = list(zip(units, families, strict=True))
    for key in dict.fromkeys(of):
        places = [i for i, own in enumerate(of) if own == key]
        sizes = scale_groups([largest[i] for i in places])
        parts += [places] if key[1] else [[places[k] for k in part] for part in sizes]
    panels = [0] * len(units)
    for number, part in enumerate(sorted(parts)):
        for i in part:
            panels[i] = number
    return panels


#: Largest number of entries on the page: of more, the first ones.
_MOST = 200


def happened(log: EventLog | None) -> dict[str, Any] | None:
    """Return the log of a run as JSON values; None for a model without contacts and events.

    ``sentences``, ``entries`` as {``time``, ``text``}, and how many ``more`` there are.
    """
    if log is None:
        return None
    listed = zip(log.time[:_MOST].tolist(), log.names, log.kinds, strict=False)
    return {
        "sentences": event_sentences(log.to_mapping()),
        "entries": [
            {"time": time, "text": name if kind == "event" else f"{name} {_WORDS.get(kind, kind)}"}
            for time, name, kind in listed
        ],
        "more": max(0, len(log) - _MOST),
    }


#: Kinds that are not verbs.
_WORDS = {"impact": "has an impact", "rest": "comes to rest"}


#: Matches a value of the page as written by the command line: in locations and in remedies.
_PLACE = re.compile(r"(?m)(^|\()--set(?:-initial)? ([\w\[\].,']+?)=(.*?)(?=: \w+\[[\w-]+\]: |\)$)")
_REMEDY = re.compile(r"""--set(?:-initial)? (['"]?)([\w\[\].,']+?)=([^`"\n]*?)\1(?=[`\s]|$)""")
_FREE = re.compile(r"\bfree ([^\n]+?), for instance `[^`\n]*`")
_SETTING = re.compile(
    r"--([a-z][a-z-]*[a-z])(?: ([-+\d][\w.+-]*|[A-Z]\w*|scipy|compiled|projection))?"
)
#: Settings that the page, or the command that starts it, provides.
_OWN = {"t_end": "t_end", "timeout": "`lagcli play --timeout`"}
_WHERE = "Settings are given under `simulation` in the model file; then start the page again."


def on_page(text: str) -> str:
    """Return a message that names fields of the page instead of options.

    Values become fields, guesses become marks, and settings belong in the model file.
    """
    message = _PLACE.sub(r"\1\2 = \3", text)
    message = _REMEDY.sub(r"\2 = \3", message)
    message = _FREE.sub(r"mark \1 as a guess", message)
    settings = []

    def setting(match: re.Match[str]) -> str:
        name, value = match[1].replace("-", "_"), match[2]
        if name not in Settings.DECLARED:
            return match[0]
        if name in _OWN:
            return _OWN[name] + (f" = {value}" if value else "")
        settings.append(name)
        return f"`{name}: {value}`" if value else f"`{name}`"

    message = _SETTING.sub(setting, message)
    return f"{message}\n{_WHERE}" if settings else message
