"""Validation of the options of a sweep before its first row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from lagcli.arrays import Array
from lagcli.errors import UsageError
from lagcli.files import refuse_same_file
from lagcli.model.loader import load_text
from lagcli.model.measures import read_measures
from lagcli.model.model import InputData, Model
from lagcli.results.formats import format_of
from lagcli.settings.settings import SettingsOverrides
from lagcli.sweeps.columns import (
    Column,
    check_names,
    default_measures,
    kept_layout,
    measure_columns,
    varied_columns,
)
from lagcli.sweeps.plan.plan import Spec, make_plan
from lagcli.sweeps.rows.rows import Runner

#: Size of samples up to which trajectories are stored by default, bytes.
KEPT_UNASKED = 10**9


class SweepRequest(NamedTuple):
    """The options of a sweep."""

    vary: Sequence[str]
    sample: str | None
    seed: int
    zipped: bool
    measures: tuple[tuple[str, str], ...]
    keep: str | None
    strict: bool


@dataclass(frozen=True, eq=False)
class PreparedSweep:
    """A checked sweep.

    Parameters
    ----------
    spec : Spec
    model : Model
        The model with the values common to all rows.
    times : (nt,) array
        The sample times of the first structure, s.
    columns, measures : lists of Column
    row_bytes : int
        Size of a row's stored samples, bytes.
    options : dict
        The resolved settings.
    """

    spec: Spec
    model: Model
    times: Array
    columns: list[Column]
    measures: list[Column]
    row_bytes: int
    options: dict[str, Any]


def prepare_sweep(
    text: str,
    name: str,
    set: Mapping[str, object],
    set_initial: Mapping[str, object],
    settings: SettingsOverrides | None,
    request: SweepRequest,
    path: str,
    data: Mapping[str, InputData] | None,
) -> PreparedSweep:
    """Validate a sweep before its first row."""
    model = load_text(text, name, set, set_initial, data)
    for source in model.input_files:
        refuse_same_file(source, path, "a table of the model's inputs")
    taken = {**set, **_dotted(set_initial)}
    plan = make_plan(model, request.vary, request.sample, request.seed, request.zipped, taken)
    written = format_of(path)
    if not written.sweeps:
        raise UsageError(f"{path}: {written.title} files cannot store sweeps; give -o with .h5")
    table = written.sweeps == "table"
    if request.keep == "trajectories" and table:
        raise UsageError(
            f"a {written.title} file can store only measures; give -o with .h5 to keep trajectories"
        )
    read_measures(model, request.measures)
    given = settings or SettingsOverrides()
    spec = Spec(
        *(text, name, set, set_initial, given, plan, request.measures, "measures"),
        strict=request.strict,
        data=model.data,
    )
    trial = Runner(spec)
    base = trial.base()
    widths = sum(width for _, width in kept_layout(model)) + len(model.outputs)
    row_bytes = 8 * len(base.grid.times) * widths
    keep, measures = request.keep, request.measures
    if keep is None:
        small = row_bytes * plan.length <= KEPT_UNASKED and not trial.structural
        keep = "trajectories" if small and not measures and not table else "measures"
    if keep == "trajectories" and trial.structural:
        names = ", ".join(f"`{plan.columns[i]}`" for i in trial.structural)
        raise UsageError(
            f"{names} changes the structure or the sample times of the runs, which then have no"
            " common shape: give --measure, and --keep measures"
        )
    if keep == "measures" and not measures:
        if trial.structural:
            raise UsageError("runs of several structures need measures: give --measure 'max(…)'")
        measures = default_measures(model)
    spec = replace(spec, measures=measures, keep=keep)
    columns, measured = varied_columns(model, plan.columns), measure_columns(model, measures)
    check_names([*columns, *measured])
    if keep == "measures":
        row_bytes = 0
    options = base.variants.settings.as_dict()
    return PreparedSweep(spec, model, base.grid.times, columns, measured, row_bytes, options)


def _dotted(set_initial: Mapping[str, object]) -> dict[str, object]:
    """Return initial values by their canonical names (``phi'``)."""
    return {
        name.removesuffix("_dot") + "'" if name.endswith("_dot") else name: value
        for name, value in set_initial.items()
    }
