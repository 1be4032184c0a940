"""The `fit` block: data files, observed quantities, and quantities to fit."""

from __future__ import annotations

import math
from collections.abc import Collection
from collections.abc import Mapping as ValuesOf

from symengine import Basic

from lagcli.columns import SCALARS
from lagcli.model.expression.trees import Tree
from lagcli.model.expression.units import commensurable, remedy, to_si
from lagcli.model.keys import FIT, FITTED, MEASURED, OBSERVED, keys_of
from lagcli.model.model import (
    Coordinate,
    DataFile,
    FitBlock,
    FittedQuantity,
    InitialValue,
    ObservedQuantity,
)
from lagcli.model.names.draft import Draft, QuantityValue, read_quantity, unit_of
from lagcli.model.names.namespace import Allowed
from lagcli.model.sections.initial import canonical_name, stated_unit
from lagcli.model.sections.parameters import names_used, read_unit_field
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.source import Mapping, Scalar, Sequence, YamlNode

_EXAMPLE = (
    "fit:\n  data: {file: run.csv, time: t}\n  observe:\n    phi: {column: enc, sigma: 1e-3}\n"
    "  parameters:\n    m: {min: 0}"
)


def read_fit(
    draft: Draft, coordinates: Collection[Coordinate], initial: ValuesOf[str, InitialValue]
) -> FitBlock | None:
    """Return the block; None if there is none, or if it has an error.

    Parameters
    ----------
    draft : Draft
    coordinates : collection of Coordinate
    initial : mapping of str to InitialValue
        The initial values, by coordinate and velocity (``phi'``).
    """
    node = draft.get("fit")
    if node is None:
        return None
    block = draft.mapping(node, "`fit`", _EXAMPLE)
    if block is None:
        return None
    fields = draft.fields(block, "`fit`", keys_of(FIT))
    missing = [name for name in keys_of(FIT) if name not in fields]
    if missing:
        names = " and no ".join(f"`{name}`" for name in missing)
        draft.report.add("missing-value", f"`fit` has no {names}", node.location, _EXAMPLE)
        return None
    units = {name: x.unit for name, x in draft.parameters.items()}
    units |= {name: stated_unit(name, x, coordinates) for name, x in initial.items()}
    reader = _FitReader(draft, units)
    data = reader.files(fields["data"])
    observed = reader.observed(fields["observe"])
    fitted = reader.fitted(fields["parameters"])
    if not (data and observed and fitted):
        return None
    reader.check_sigmas(observed)
    reader.check_overridden(data, fitted)
    return FitBlock(tuple(data), tuple(observed), tuple(fitted), node.location)


class _FitReader:
    """Reads the parts of the block.

    Parameters
    ----------
    draft : Draft
    units : mapping of str to str or None
        Units of parameters and initial values, where they are stated.
    """

    def __init__(self, draft: Draft, units: ValuesOf[str, str | None]):
        self.draft, self.units = draft, units

    # data files

    def files(self, node: YamlNode) -> list[DataFile]:
        files = []
        for item in node.items if isinstance(node, Sequence) else [node]:
            entry = self.draft.mapping(item, "`data`", "write `data: {file: run.csv, time: t}`")
            if entry is None:
                continue
            fields = self.draft.fields(entry, "`data`", keys_of(MEASURED))
            if "file" not in fields:
                self.draft.report.add(
                    "missing-value",
                    "`data` has no `file`",
                    item.location,
                    "write `data: {file: run.csv, time: t}`",
                )
                continue
            path = self.draft.text(fields["file"], "`file` of `data`")
            time = self.draft.text(fields.get("time"), "`time` of `data`") or "t"
            values = self.overrides(fields.get("set"), "set")
            initial = self.overrides(fields.get("initial"), "initial")
            if path:
                files.append(DataFile(path, time, values, initial, fields["file"].location))
        return files

    def overrides(self, node: YamlNode | None, name: str) -> dict[str, str]:
        """Return the values of one experiment, in the syntax of ``--set`` and ``--set-initial``."""
        if node is None:
            return {}
        entries = self.draft.mapping(node, f"`{name}` of `data`", f"write `{name}: {{m: 2 kg}}`")
        texts = {key: self.draft.text(x, f"`{key}` of `data`") for key, _, x in entries or ()}
        return {key: text for key, text in texts.items() if text is not None}

    def check_overridden(self, data: list[DataFile], fitted: list[FittedQuantity]) -> None:
        names = {x.name for x in fitted}
        for file in data:
            for name in (*file.set, *file.initial):
                plain = canonical_name(self.draft, name) or name
                if plain in names:
                    self.draft.report.add(
                        "contradiction",
                        f"`{plain}` is fitted to all data, but {file.path} fixes its value",
                        file.location,
                        "remove one of the two entries",
                    )

    # observed quantities

    def observed(self, node: YamlNode) -> list[ObservedQuantity]:
        entries = self.draft.mapping(node, "`observe`", "write `observe: {phi: {column: enc}}`")
        observed = []
        for name, key, value in entries or ():
            entry = self.observed_one(name, key, value)
            if entry is not None:
                observed.append(entry)
        return observed

    def observed_one(self, name: str, key: Scalar, node: YamlNode) -> ObservedQuantity | None:
        what = f"the observed quantity `{shorten(name)}`"
        column: str | None = name
        sigma: float | None = None
        sigma_given: str | Tree | None = None
        unit: str | None = None
        if isinstance(node, Mapping):
            fields = self.draft.fields(node, what, keys_of(OBSERVED))
            if "column" in fields:
                column = self.draft.text(fields["column"], f"`column` of {what}")
            unit, good = read_unit_field(self.draft, fields.get("unit"), what)
            if not good:
                return None
            if "sigma" in fields:
                sigma_what = f"`sigma` of {what}"
                quantity = read_quantity(self.draft, fields["sigma"], sigma_what)
                if quantity is None:
                    return None
                sigma = QuantityValue(self.draft, quantity, sigma_what).number()
                if sigma is None:
                    return None
                tree = quantity.parsed.tree
                of_parameters = not {"pi"}.issuperset(names_used(tree))
                sigma_given = quantity.unit or (tree if of_parameters else None)
                if sigma <= 0:
                    self.draft.report.add(
                        "bad-setting",
                        f"`sigma` of {what} must be greater than 0, not {sigma:g}",
                        fields["sigma"].location,
                        "give the standard deviation of a measured value",
                    )
                    return None
        elif not (isinstance(node, Scalar) and node.missing):
            column = self.draft.text(node, f"the column of {what}")
        expression = self.expression(name, key, what)
        if expression is None or column is None:
            return None
        return ObservedQuantity(name, expression, column, sigma, sigma_given, unit, key.location)

    def expression(self, name: str, key: Scalar, what: str) -> Basic | str | None:
        """Return the observed quantity: an expression, or the name of a column of every run."""
        if name in self.draft.outputs:
            return self.draft.outputs[name]
        if name in {quantity.name for quantity in SCALARS}:
            return name
        parsed = self.draft.parse(key, what)
        if parsed is None:
            return None
        return self.draft.scalar(parsed, what, Allowed.ACCELERATIONS)

    def check_sigmas(self, observed: list[ObservedQuantity]) -> None:
        without = [x for x in observed if x.sigma is None]
        if without and len(observed) > 1:
            self.draft.report.add(
                "missing-value",
                f"`{without[0].name}` has no `sigma`",
                without[0].location,
                "with several observed quantities, each needs a `sigma`, which weights its data",
            )

    # quantities to fit

    def fitted(self, node: YamlNode) -> list[FittedQuantity]:
        entries = self.draft.mapping(node, "`parameters`", "write `parameters: {m: {min: 0}}`")
        fitted: dict[str, FittedQuantity] = {}
        for name, key, value in entries or ():
            entry = self.fitted_one(name, key, value)
            if entry is None:
                continue
            if entry.name in fitted:
                self.draft.report.add(
                    "duplicate-key",
                    f"`{entry.name}` is named twice",
                    key.location,
                    "keep one of them",
                )
            fitted[entry.name] = entry
        return list(fitted.values())

    def fitted_one(self, name: str, key: Scalar, node: YamlNode) -> FittedQuantity | None:
        known = name if name in self.draft.parameters else canonical_name(self.draft, name)
        if known is None:
            names = self.draft.names
            if not names.incomplete:
                every = [
                    *self.draft.parameters,
                    *(q + x for q in names.coordinates for x in ("", "'")),
                ]
                self.draft.report.add(
                    "unknown-name",
                    f"`fit` names `{shorten(name)}`, which is not a parameter or an initial value",
                    key.location,
                    did_you_mean(nearest(name, every)) or "there are " + ", ".join(every[:12]),
                )
            return None
        bounds = {"min": -math.inf, "max": math.inf}
        what = f"`{shorten(name)}` of `fit`"
        if isinstance(node, Mapping):
            fields = self.draft.fields(node, what, keys_of(FITTED))
            unit = self.units.get(known)
            for bound, value in fields.items():
                number = self.number(value, f"`{bound}` of {what}")
                if number is None or not self.has_unit(value, unit, f"`{bound}` of {what}"):
                    return None
                bounds[bound] = number
        elif not (isinstance(node, Scalar) and node.missing):
            self.draft.mapping(node, what, f"write `{name}: {{min: 0, max: 5}}` or `{name}:`")
            return None
        if bounds["min"] >= bounds["max"]:
            self.draft.report.add(
                "bad-setting",
                f"{what}: `min` {bounds['min']:g} is not below `max` {bounds['max']:g}",
                node.location,
                "exchange them",
            )
            return None
        return FittedQuantity(known, bounds["min"], bounds["max"], key.location)

    def has_unit(self, node: YamlNode, unit: str | None, what: str) -> bool:
        """Return whether a bound can be read: outside SI, it needs a unit, and of its dimension."""
        given = unit_of(node)
        if unit is None or (given is None and to_si(unit) == 1):
            return True
        if given is not None:
            if commensurable(given, unit):
                return True
            self.draft.report.add(
                "units",
                f"{what} is in {given}, and its value in {unit}",
                node.location,
                remedy(unit, given),
            )
            return False
        self.draft.report.add(
            "missing-value",
            f"{what} has no unit, and its value is given in {unit}",
            node.location,
            f"write it as `{node.value.strip() if isinstance(node, Scalar) else 1} {unit}`",
        )
        return False

    def number(self, node: YamlNode, what: str) -> float | None:
        quantity = read_quantity(self.draft, node, what)
        return None if quantity is None else QuantityValue(self.draft, quantity, what).number()
