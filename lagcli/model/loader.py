"""Loader: reads a model file into a Model, and reports all errors together."""

from __future__ import annotations

import copyreg
import gc
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lagcli.errors import Diagnostic, ModelError, check_values
from lagcli.files import shown_path
from lagcli.model import keys
from lagcli.model.diagnostics import Diagnostics
from lagcli.model.dimensions.deriving import derive_units
from lagcli.model.model import Input, InputData, Model, ModelEvent
from lagcli.model.names.draft import Draft
from lagcli.model.names.families import Declaration, declarations
from lagcli.model.reading import check_text, read_text
from lagcli.model.sections.constraints import declare_constraints, read_constraints
from lagcli.model.sections.contacts import dry_friction
from lagcli.model.sections.coordinates import (
    check_keys,
    constraints_of,
    declare,
    definitions_of,
    expand_coordinates,
    read_coordinates,
    report_overlaps,
)
from lagcli.model.sections.definitions import (
    check_functions,
    expand_definitions,
    read_definitions,
    read_functions,
    read_outputs,
)
from lagcli.model.sections.energies import read_energies, read_forces, read_scalar
from lagcli.model.sections.first_order import first_order_constraints, weights_of_constraints
from lagcli.model.sections.initial import read_closed, read_initial
from lagcli.model.sections.parameters import read_parameters, structural
from lagcli.model.sections.simulation import read_settings
from lagcli.model.sections.view import read_view
from lagcli.model.yaml.composing import compose
from lagcli.model.yaml.source import Source
from lagcli.settings.settings import Settings

if TYPE_CHECKING:
    from lagcli.model.sections.presets import PresetEntry

#: The keys of a model file, in the order of the documentation.
MODEL = keys.mapping(
    {
        "name": keys.described("text; by default the name of the file", keys.TEXT),
        "title": keys.described(
            "heading of derivations and pages; by default made from the name", keys.TEXT
        ),
        "description": keys.described("text", keys.TEXT),
        "dimension": keys.described(
            "of `bodies`: 2, or 3 in space; by default 3 if one of their vectors has three"
            " components",
            {"enum": [2, 3, "2", "3"]},
        ),
        "gravity": keys.described(
            "acceleration of the bodies, a vector; none by default", keys.EXPRESSION
        ),
        "bodies": keys.described(
            "name → {`mass`, `length`, `inertia`, `shape`, `com`, `points`}; `ground` has `points`"
            " only; see [machines.md](machines.md)",
            keys.one_of(keys.named(keys.one_of(keys.BODY, keys.EMPTY)), keys.EMPTY),
        ),
        "joints": keys.described(
            "name → joint of two bodies, `revolute(ground.O, crank.a)`, or {`revolute`:"
            " [`ground.O`, `crank.a`]}, with keys such as `damping`; drives and gears",
            keys.one_of(keys.named(keys.one_of(keys.TEXT, keys.CALL)), keys.EMPTY),
        ),
        "forces": keys.described(
            "name → `spring(…)`, `actuator(…)` or `wrench(…)` between points of bodies",
            keys.one_of(keys.named(keys.one_of(keys.TEXT, keys.CALL)), keys.EMPTY),
        ),
        "coordinates": keys.described(
            "a list of names or families `x[1..N]`, or a mapping name → unit, kind (`point`,"
            " `quaternion`), or {`unit`, `kind`, `description`, `latex`}",
            keys.one_of(
                keys.list_of(keys.TEXT, at_least=1),
                keys.named(keys.one_of(keys.TEXT, keys.EMPTY, keys.COORDINATE)),
            ),
        ),
        "parameters": keys.described(
            "name → number, number with a unit, expression of other parameters, or {`value`,"
            " `unit`, `min`, `max`, `description`}",
            keys.one_of(keys.named(keys.one_of(keys.EXPRESSION, keys.PARAMETER)), keys.EMPTY),
        ),
        "functions": keys.described(
            "function with its arguments, `f(x, y)` → expression; expanded where it is used",
            keys.one_of(
                {
                    "type": "object",
                    "propertyNames": {"pattern": keys.FUNCTION},
                    "additionalProperties": keys.EXPRESSION,
                },
                keys.EMPTY,
            ),
        ),
        "inputs": keys.described(
            "name → {`file`, `time`, `column`} or {`times`, `values`}, with `unit`,"
            " `interpolation` and `extend`: known functions of time (see [Inputs](#inputs))",
            keys.one_of(keys.named(keys.INPUT), keys.EMPTY),
        ),
        "definitions": keys.described(
            "name → expression, vector, matrix or rotation, or {`expr`, `description`}",
            keys.one_of(keys.named(keys.one_of(keys.EXPRESSION, keys.DEFINITION)), keys.EMPTY),
        ),
        "T": keys.described("kinetic energy", keys.SCALAR),
        "V": keys.described("potential energy; a missing `V` is 0", keys.SCALAR),
        "L": keys.described("the Lagrangian, instead of `T` and `V`", keys.SCALAR),
        "Q": keys.described(
            "nonconservative forces: by coordinate, or along a definition (see [Forces](#forces))",
            keys.one_of(keys.named(keys.EXPRESSION), keys.EMPTY),
        ),
        "D": keys.described(
            "a Rayleigh dissipation function: adds −∂D/∂q' to each equation", keys.SCALAR
        ),
        "constraints": keys.described(
            "name → `lhs = rhs`, `lhs >= rhs`, `lhs <= rhs`, or an expression (`= 0`), or {`expr`,"
            " `restitution`, `friction`, `slip`, `limit`, `active`, `description`}; see"
            " [contact.md](contact.md)",
            keys.one_of(keys.named(keys.one_of(keys.EXPRESSION, keys.CONSTRAINT)), keys.EMPTY),
        ),
        "initial": keys.described(
            "a value for every coordinate and every velocity, or {`guess`: value} (see [Initial"
            " values](#initial-values))",
            keys.one_of(keys.named(keys.one_of(keys.EXPRESSION, keys.INITIAL)), keys.EMPTY),
        ),
        "presets": keys.described(
            "name → {`parameters`, `initial`, `description`}: values for `--preset` and the pages"
            " (see [Presets](#presets))",
            keys.one_of(
                {"type": "object", "additionalProperties": keys.PRESET},
                keys.EMPTY,
            ),
        ),
        "outputs": keys.described(
            "name → expression, or {`expr`, `unit`, `description`}: additional columns of the"
            " result",
            keys.one_of(keys.named(keys.one_of(keys.SCALAR, keys.OUTPUT)), keys.EMPTY),
        ),
        "events": keys.described(
            "name → {`when` or `every`, and actions: `stop`, `record`, `set`, `impulse`, `release`,"
            " `engage`}; see [events.md](events.md)",
            keys.one_of(keys.named(keys.EVENT), keys.EMPTY),
        ),
        "simulation": keys.described(
            "defaults for the options of `lagcli simulate` with the same names", {}
        ),
        "view": keys.described(
            "a drawing of the model: points, rods, springs, discs, trails, forces; see"
            " [view.md](view.md)",
            keys.one_of(keys.VIEW, keys.EMPTY),
        ),
        "fit": keys.described(
            "measured data and quantities to fit; see [fit.md](fit.md)", keys.FIT
        ),
    },
    "coordinates",
)


def load(
    path: str | Path,
    set: Mapping[str, object] | None = None,
    set_initial: Mapping[str, object] | None = None,
    drawn: bool = True,
    preset: str | None = None,
) -> Model:
    """Load and check a model file.

    Parameters
    ----------
    path : path, name of a shipped model, or "-" for standard input
    set : mapping of parameter names to values, optional
        Parameter values that override the file's: numbers, or text in the syntax of model files
        (``"30 deg"``, ``"2*m"``).
    set_initial : mapping of coordinate or velocity names to values, optional
        Initial values that override the file's; a guess is written ``"{guess: 0.3}"``, as in the
        file.
    drawn : bool
        Whether errors in the view are errors of the model. Otherwise, a view with errors is left
        out, and `Model.view_errors` lists them.
    preset : str, optional
        Name of a preset of the file, whose values the others replace.

    Returns
    -------
    Model

    Raises
    ------
    FileError
        The file cannot be read.
    ModelError
        The file is not a valid model; contains all diagnostics.
    UsageError
        The file has no such preset, or an argument is no mapping of names to values.
    """
    text, name = read_text(path)
    return load_text(text, name, set, set_initial, drawn=drawn, preset=preset)


def load_text(
    text: str,
    path: str = "<text>",
    set: Mapping[str, object] | None = None,
    set_initial: Mapping[str, object] | None = None,
    data: Mapping[str, InputData] | None = None,
    drawn: bool = True,
    preset: str | None = None,
) -> Model:
    """Load and check the text of a model file; see `load`.

    ``data`` are tables of inputs that are already loaded: their files are not read.
    """
    check_values("set", set)
    check_values("set_initial", set_initial)
    if preset is not None:
        from lagcli.model.sections.presets import with_preset

        model = load_text(text, path, set, set_initial, data, drawn)
        given = with_preset(model, preset, model.set, model.set_initial)
        return load_text(text, path, *given, model.data, drawn)
    source = Source(text.removeprefix("\ufeff"), path)
    check_text(source)
    with _without_gc():
        root, diagnostics = compose(source)
        draft = Draft(source, root, Diagnostics(diagnostics))
        return _model(draft, set or {}, set_initial or {}, data or {}, drawn)


def expand_text(text: str, path: str = "<text>") -> str:
    """Return the text of a model file with bodies, joints and forces expanded.

    It loads as a model with the same equations and the same start.

    Raises
    ------
    ModelError
        The file is not a valid model.
    """
    from lagcli.model.machines.printing import print_model

    source = Source(text.removeprefix("\ufeff"), path)
    check_text(source)
    root, diagnostics = compose(source)
    draft = Draft(source, root, Diagnostics(diagnostics))
    _model(draft, {}, {}, {}, True)
    return print_model(draft.root)


def _pickled(model: Model) -> tuple[Any, ...]:
    """Return what determines a model: its text, its tables, and the values that replace others."""
    drawn = not model.view_errors
    return load_text, (model.text, model.path, model.set, model.set_initial, model.data, drawn)


copyreg.pickle(Model, _pickled)


@contextmanager
def _without_gc() -> Iterator[None]:
    """Context manager that disables the cyclic garbage collector.

    Loading creates many objects that stay alive; scanning them repeatedly takes longer than
    creating them.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _read_inputs(
    draft: Draft, declared: list[Declaration], data: Mapping[str, InputData]
) -> dict[str, Input]:
    if not declared:
        return {}
    from lagcli.model.sections.inputs import read_inputs

    return read_inputs(draft, declared, data)


def _model(
    draft: Draft,
    overrides: Mapping[str, object],
    initial_overrides: Mapping[str, object],
    data: Mapping[str, InputData],
    drawn: bool,
) -> Model:
    check_keys(draft, keys.keys_of(MODEL))
    machine = None
    if any(key in draft.root.entries for key in keys.MACHINE):
        from lagcli.model.machines.expansion import expand_machine

        machine = expand_machine(draft)
    functions = read_functions(draft)
    coordinate_entries = read_coordinates(draft)
    parameter_entries = _declarations(draft, "parameters", "parameter")
    definition_entries = _declarations(draft, "definitions", "definition")
    input_entries = _declarations(draft, "inputs", "input")
    constraint_entries = declarations(draft, draft.entries("constraints") or [], "constraint")
    vectors = definitions_of(entry.declaration for entry in coordinate_entries)
    draft.names.kinds = {d.family: d.kind for d in vectors}
    definition_entries = [*vectors, *definition_entries]
    constraint_entries += constraints_of(vectors)
    declare(
        draft,
        coordinate_entries,
        parameter_entries,
        definition_entries,
        functions,
        input_entries,
    )
    draft.parameters = read_parameters(draft, parameter_entries, overrides)
    inputs = _read_inputs(draft, input_entries, data)
    coordinates = expand_coordinates(
        draft, coordinate_entries, any(p.unit for p in draft.parameters.values())
    )
    defined = expand_definitions(draft, definition_entries)
    report_overlaps(draft)
    check_functions(draft, functions)
    constrained = declare_constraints(draft, constraint_entries)
    draft.definitions = read_definitions(draft, defined)
    kinetic, potential = read_energies(draft)
    dissipation = read_scalar(draft, "D")
    constraints = read_constraints(draft, constraint_entries, constrained)
    forces = read_forces(draft, draft.entries("Q") or [])
    if potential is not None:
        lagrangian = -potential if kinetic is None else kinetic - potential
        constraints += first_order_constraints(
            draft, coordinates, lagrangian, dissipation, forces, constraints
        )
    smooth = dry_friction(draft, forces, dissipation)
    constraints += smooth.rows
    draft.constraints = constraints
    closed = read_closed(draft)
    if inputs:
        from lagcli.model.sections.inputs import InputUses

        energies = [("L", [potential], 1)] if kinetic is None else []
        energies = energies or [("T", [kinetic], 1), ("V", [potential], 1)]
        used = [*energies, ("D", [smooth.dissipation], 0), ("Q", smooth.forces.values(), 0)]
        InputUses(draft, inputs).check(constraints, used)
    if machine is not None:
        machine.place(draft, initial_overrides)
    positions, velocities, spins, given = read_initial(draft, initial_overrides)
    outputs, output_units = read_outputs(draft)
    draft.outputs = smooth.of_forces(outputs)
    events: tuple[ModelEvent, ...] = ()
    if draft.get("events") is not None or not all(c.active for c in constraints):
        from lagcli.model.sections.events import read_events

        events = read_events(draft)
    settings, settings_need = read_settings(draft, coordinates)
    view_errors: tuple[Diagnostic, ...] = ()
    if drawn:
        view = read_view(draft)
    else:
        essential, draft.report = draft.report, Diagnostics([])
        view = None
        try:
            view = read_view(draft)
            draft.report.finish()
        except ModelError as error:
            view, view_errors = None, tuple(error.diagnostics)
        draft.report = essential
    presets: list[PresetEntry] = []
    if draft.get("presets") is not None:
        from lagcli.model.sections.presets import preset_entries

        presets = preset_entries(draft)
    fit = None
    if draft.get("fit") is not None:
        from lagcli.model.sections.fit import read_fit

        initial = {**positions, **{f"{name}'": x for name, x in velocities.items()}}
        fit = read_fit(draft, coordinates, initial)
    name = draft.text(draft.get("name"), "`name`") or Path(shown_path(draft.source.path)).stem
    title = draft.text(draft.get("title"), "`title`")
    description = draft.text(draft.get("description"), "`description`")
    draft.report.finish()
    assert potential is not None
    model = Model(
        name=name,
        title=title or _title(name),
        description=description,
        path=draft.source.path,
        text=draft.source.text,
        coordinates=coordinates,
        parameters=structural(draft),
        definitions=draft.definitions,
        kinetic=kinetic,
        potential=potential,
        applied_forces=smooth.forces,
        dissipation=smooth.dissipation,
        constraints=constraints,
        initial_positions=positions,
        initial_velocities=velocities,
        spins=spins,
        outputs=draft.outputs,
        output_units=output_units,
        settings=settings,
        settings_need=settings_need,
        trees=draft.trees,
        tolerances=draft.tolerances,
        names=draft.names,
        set=dict(overrides),
        set_initial=given,
        view=view,
        view_errors=view_errors,
        fit=fit,
        events=events,
        closed=closed,
        left_out=tuple(draft.left_out),
        inputs=inputs,
    )
    units = derive_units(model)
    if units.errors:
        from lagcli.model.dimensions.reporting import unit_diagnostics

        raise ModelError(unit_diagnostics(model, units._replace(findings=units.errors)))
    model = replace(model, units=units)
    weights = weights_of_constraints(model)
    if weights:
        model = replace(model, parameters={**model.parameters, **weights})
    if not presets:
        return model
    from lagcli.model.sections.presets import read_presets

    return replace(model, presets=read_presets(draft, presets, parameter_entries, model))


def _title(name: str) -> str:
    """Return a title made from a name: "Four bar" from "four_bar"."""
    if re.fullmatch(r"[a-z0-9_-]+", name):
        name = re.sub("[_-]+", " ", name).strip().capitalize() or name
    return name


def _declarations(draft: Draft, key: str, what: str) -> list[Declaration]:
    """Return the declarations of a block; an unreadable block may declare any name."""
    entries = draft.entries(key)
    if entries is None or key in draft.misspelled_keys:
        draft.names.incomplete = True
    return declarations(draft, entries or [], what)


def _has(key: str) -> keys.JsonSchema:
    return {"required": [key]}


def json_schema() -> keys.JsonSchema:
    """Return the JSON Schema of model files."""
    settings = {
        x.name: keys.described(x.help, keys.of_setting(x)) for x in Settings.DECLARED.values()
    }
    properties = dict(MODEL["properties"])
    properties["simulation"] = {
        **properties["simulation"],
        **keys.one_of(keys.mapping(settings), keys.EMPTY),
    }
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "Model file of lagcli",
        **{key: value for key, value in MODEL.items() if key != "required"},
        "properties": properties,
        "oneOf": [
            {"required": ["bodies"], "not": {"required": ["L"]}},
            {"required": ["coordinates", "T"], "not": {"anyOf": [_has("L"), _has("bodies")]}},
            {"required": ["coordinates", "L"], "not": {"anyOf": [_has("T"), _has("V")]}},
        ],
    }
