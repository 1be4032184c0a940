"""The `presets` block: values of parameters and initial values that the author names.

A preset has the effect of ``--set`` and ``--set-initial`` with its values, and is checked with them
when the file is read.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

from lagcli.errors import Diagnostic, ModelError, UsageError
from lagcli.model.diagnostics import Diagnostics
from lagcli.model.dimensions.deriving import derive_units
from lagcli.model.keys import PRESET, keys_of
from lagcli.model.model import Model, Parameter, Preset
from lagcli.model.names.draft import Draft, Entry
from lagcli.model.names.families import Declaration, members_of, read_key
from lagcli.model.names.members import family_of
from lagcli.model.sections.initial import canonical_name, changed_values
from lagcli.model.sections.parameters import read_parameters
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.source import Scalar, Sequence, YamlNode
from lagcli.prose import counted

#: Parameters and initial values that replace those of a file.
Given = tuple[Mapping[str, object], Mapping[str, object]]

_EXAMPLE = "presets:\n  heavy: {parameters: {m: 2 kg}, initial: {phi: 0.3}}"


class PresetEntry(NamedTuple):
    """An entry of the block, before its values are read."""

    name: str
    key: Scalar
    description: str | None
    parameters: list[Entry]
    initial: list[Entry]


def preset_entries(draft: Draft) -> list[PresetEntry]:
    """Return the entries of the block; report what is no preset."""
    entries = []
    for name, key, node in draft.entries("presets") or ():
        what = f"the preset `{shorten(name)}`"
        if not name.strip() or len(name.splitlines()) > 1:
            message = "the name of a preset is a text of one line"
            draft.report.add("bad-name", message, key.location, "as in\n" + _EXAMPLE)
        block = draft.mapping(node, what, _EXAMPLE)
        if block is None:
            continue
        fields = draft.fields(block, what, keys_of(PRESET))
        description = draft.text(fields.get("description"), f"`description` of {what}")
        values = {
            field: _entries(draft, fields[field], f"`{field}` of {what}") if field in fields else []
            for field in ("parameters", "initial")
        }
        if not any(values.values()):
            draft.report.add(
                "missing-value",
                f"{what} has no values",
                key.location,
                "give it `parameters`, `initial` or both, as in\n" + _EXAMPLE,
            )
        entries.append(PresetEntry(name, key, description, values["parameters"], values["initial"]))
    return entries


def _entries(draft: Draft, node: YamlNode, what: str) -> list[Entry]:
    block = draft.mapping(node, what, "write `{m: 2 kg}`, with a value for each name")
    return [] if block is None else list(block)


def read_presets(
    draft: Draft, entries: Iterable[PresetEntry], declared: list[Declaration], model: Model
) -> tuple[Preset, ...]:
    """Return the presets of a model that has no other errors.

    Parameters
    ----------
    draft : Draft
        The file.
    entries : iterable of PresetEntry
    declared : list of Declaration
        The entries of its parameters.
    model : Model
        The model, with its own values.

    Raises
    ------
    ModelError
        A preset has an error. If the number of members has been changed, members that a preset
        names may be missing: its `errors` are raised when it is taken.
    """
    presets = [_PresetReader(draft, entry, declared, model).preset() for entry in entries]
    errors = [error for preset in presets for error in preset.errors]
    if errors and not any(name in model.structural_parameters for name in model.set):
        raise ModelError(errors)
    return tuple(presets)


class _PresetReader:
    """Reads one preset on a copy of the draft, whose values it changes."""

    def __init__(self, draft: Draft, entry: PresetEntry, declared: list[Declaration], model: Model):
        names = replace(draft.names, broken=set(), suspects=set())
        self.draft = replace(draft, report=Diagnostics([]), names=names, trees={})
        self.entry, self.declared, self.model = entry, declared, model
        self.what = f"the preset `{shorten(entry.name)}`"
        self.changed = model

    def preset(self) -> Preset:
        """Return the preset, with the values that have no error."""
        nodes, given = self.parameters(), self.model.set
        # those given replace those of the preset, and its expressions use them
        parameters = read_parameters(self.draft, self.declared, {**nodes, **given})
        self.draft.parameters = parameters
        for name, node in nodes.items():
            if name in parameters and name not in given:
                self.check_range(parameters[name], node)
        values = changed_values(self.draft, self.entry.initial, self.what)
        parameters = {**self.model.parameters, **parameters}
        self.changed = replace(self.model, parameters=parameters, **values.fields)
        entry = self.entry
        texts = {name: node.value.strip() for name, node in nodes.items()}
        location = entry.key.location
        errors = tuple(self.errors())
        return Preset(entry.name, entry.description, texts, values.texts, location, errors)

    def errors(self) -> list[Diagnostic]:
        """Return the errors, each once and with the preset."""
        found = self.draft.report.sorted()
        if not found and self.model.units.stated:
            units = derive_units(self.changed)._replace(throughout=self.model.units.throughout)
            if units.errors:
                from lagcli.model.dimensions.reporting import unit_diagnostics

                found = unit_diagnostics(self.changed, units._replace(findings=units.errors))
        note = (f"with {self.what}", None)
        return [
            x if x.message.startswith(self.what) else x._replace(notes=(*x.notes, note))
            for x in dict.fromkeys(found)
        ]

    def parameters(self) -> dict[str, Scalar]:
        """Return the values of the parameters that exist, by their names."""
        values: dict[str, Scalar] = {}
        for _, key, node in self.entry.parameters:
            declaration = read_key(self.draft, key, node, "parameter")
            if declaration is None:
                continue
            if declaration.indices:
                self.draft.report.add(
                    "bad-range",
                    f"{self.what}: the value of `{declaration.title}` cannot depend on an index",
                    key.location,
                    f"name the members, `{declaration.name}[1]`, or give them one value or a list,"
                    f" `{declaration.name}[1..3]`",
                )
                continue
            for name, item in self.members(declaration):
                if self.settable(name, key) and self.scalar(name, item):
                    if name in values:
                        message = f"{self.what} gives `{name}` twice"
                        self.draft.report.add(
                            "duplicate-key", message, key.location, "keep one of them"
                        )
                    assert isinstance(item, Scalar)
                    values[name] = item
        return values

    def members(self, declaration: Declaration) -> list[tuple[str, YamlNode]]:
        """Return the names of an entry, each with its value."""
        names = [member.name for member in members_of(self.draft, declaration)]
        node = declaration.node
        if not (declaration.several and isinstance(node, Sequence)):
            return [(name, node) for name in names]
        if len(node.items) != len(names):
            self.draft.report.add(
                "wrong-length",
                f"`{declaration.title}` has {counted(len(names), 'member')}, but its list has"
                f" {counted(len(node.items), 'value')}",
                node.location,
                "give one value for each member, or one for all of them",
            )
        return list(zip(names, node.items, strict=False))

    def settable(self, name: str, key: Scalar) -> bool:
        """Whether a preset may set a parameter; report one that it may not, or that is none."""
        names, model = self.draft.names, self.model
        message, help_ = f"{self.what}: the model has no parameter `{shorten(name)}`", ""
        if name in model.parameters:
            if not model.parameters[name].structural:
                return True
            message = f"{self.what} sets `{name}`, on which the number of members depends"
            help_ = "a preset changes values, not equations: give `--set` beside it, or remove it"
        elif canonical_name(self.draft, name, vectors=True):
            message = f"{self.what}: `{name}` is an initial value, not a parameter"
            help_ = "write it under `initial`"
        elif name in names.lines:
            message = f"{self.what}: `{name}` is a {names.lines[name][0]}, not a parameter"
            help_ = "presets set parameters and initial values"
        elif any(family_of(x) == f"{name}[]" for x in model.parameters):
            message = f"{self.what}: `{name}` is a family"
            help_ = f"name its members, `{name}[1]`, or a range, `{name}[1..2]`"
        known = list(model.parameters)
        help_ = help_ or did_you_mean(nearest(name, known)) or ""
        help_ = help_ or "its parameters are " + (", ".join(known[:30]) or "none")
        self.draft.report.add("unknown-name", message, key.location, help_)
        return False

    def scalar(self, name: str, node: YamlNode) -> bool:
        """Whether a value is one text; report any other."""
        if isinstance(node, Scalar) and not node.missing:
            return True
        self.draft.report.add(
            "wrong-type",
            f"{self.what}: the value of `{name}` must be a number or an expression, not"
            f" {node.what}",
            node.location,
            "write a number with its unit, or an expression of parameters",
        )
        return False

    def check_range(self, parameter: Parameter, node: Scalar) -> None:
        """Report a value beyond the ends of the parameter's slider."""
        low, high = parameter.low, parameter.high
        for end, relation, beyond in (
            ("min", "below", low is not None and parameter.value < low),
            ("max", "above", high is not None and parameter.value > high),
        ):
            if beyond:
                self.draft.report.add(
                    "bad-setting",
                    f"{self.what}: `{parameter.name}` is {relation} its `{end}`",
                    node.location,
                    f"choose another value, or move `{end}` of `{parameter.name}`",
                )


def with_preset(
    model: Model,
    name: str,
    set: Mapping[str, object],
    set_initial: Mapping[str, object],
    without: Iterable[str] = (),
) -> Given:
    """Return values together with those of a preset, which they replace.

    Parameters
    ----------
    model : Model
    name : str
    set, set_initial : mappings of str to values
    without : iterable of str
        Names of further values that the preset does not give.

    Raises
    ------
    UsageError
        The model has no such preset.
    ModelError
        The preset does not fit the number of members that the model has.
    """
    names = [preset.name for preset in model.presets]
    if name not in names:
        known = ", ".join(f"`{x}`" for x in names)
        help_ = did_you_mean(nearest(name, names))
        help_ = help_ or (f"its presets are {known}" if known else "it has none")
        raise UsageError(f"the model has no preset `{shorten(name)}`; {help_}")
    preset = model.presets[names.index(name)]
    if preset.errors:
        raise ModelError(list(preset.errors))
    left_out = dict.fromkeys(without)
    every = combined(
        model,
        (preset.set, preset.set_initial),
        ({**left_out, **set}, {**left_out, **set_initial}),
    )
    parameters, initial = ({n: x for n, x in v.items() if x is not None} for v in every)
    return parameters, initial


def combined(model: Model, below: Given, above: Given) -> Given:
    """Return parameters and initial values of both, those ``above`` in place of those ``below``."""
    kept = not_replaced(model, below, above)
    return {**kept[0], **above[0]}, {**kept[1], **above[1]}


def not_replaced(model: Model, below: Given, above: Given) -> Given:
    """Return the parameters and initial values that others do not replace.

    A vector replaces its components.
    """
    from lagcli.model.values import draft_of

    draft = draft_of(model)

    def canonical(name: str) -> str:
        plain = "".join(name.split())
        return canonical_name(draft, plain, vectors=True) or plain

    def whole(name: str) -> str:
        base, dot, _ = name.rstrip("'").rpartition(".")
        return base + name[len(name.rstrip("'")) :] if dot else name

    set_above = {"".join(name.split()) for name in above[0]}
    initial_above = {canonical(name) for name in above[1]}
    parameters = {k: x for k, x in below[0].items() if "".join(k.split()) not in set_above}
    initial = {
        name: x
        for name, x in below[1].items()
        if not {canonical(name), whole(canonical(name))} & initial_above
    }
    return parameters, initial
