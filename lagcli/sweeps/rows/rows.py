"""Execution of rows by number, on any machine."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from functools import partial

import numpy as np

from lagcli.arrays import Indices
from lagcli.engine.contract import Outcome
from lagcli.errors import LagcliError
from lagcli.model.expression.units import si_notation, to_si
from lagcli.simulations.threads import one_thread
from lagcli.simulations.variants import Variants
from lagcli.sweeps.plan.plan import Spec
from lagcli.sweeps.row_results import (
    COMPLETED,
    ERROR,
    FAILED,
    MISSING,
    WARNING,
    Numbers,
    Results,
)
from lagcli.sweeps.rows.group import FinishedRuns, RowGroup
from lagcli.trajectory.samples import ENDED

_MOST_GROUPS = 16  # largest number of derived structures in the cache
_MOST_SPECS = 2


def run_rows(
    spec: Spec, numbers: Numbers, check_cancelled: Callable[[], None] | None = None
) -> Results:
    """Run some rows of a sweep.

    A pure function that can be sent to any process; the model is loaded and derived there once, and
    cached. The result of a row does not depend on the other rows.

    Parameters
    ----------
    spec : Spec
    numbers : (n,) array of int
        Preferably a few dozen rows or more, so that they are run in batches.
    check_cancelled : callable, optional
        Called several times per 0.1 s. An exception, such as `Interrupted`, ends the call.

    Returns
    -------
    Results
        In the order of ``numbers``. A failed row has a status and a message.
    """
    return _runner(spec).run(np.asarray(numbers, dtype=np.int64), check_cancelled or (lambda: None))


class Runner:
    """Runs rows of a sweep; derives its structures on demand.

    Parameters
    ----------
    spec : Spec
    """

    def __init__(self, spec: Spec):
        self.spec = spec
        self.model = spec.load()
        variants = Variants(self.model, spec.settings)
        columns = spec.plan.columns
        #: columns whose values each require a new derivation
        self.structural = [i for i, name in enumerate(columns) if not variants.together([name])]
        self.numeric = [i for i in range(len(columns)) if i not in self.structural]
        self._groups: OrderedDict[tuple[float, ...], RowGroup | LagcliError] = OrderedDict()

    def group(self, values: tuple[float, ...]) -> RowGroup:
        """Return the group of rows with these structural values.

        Raises
        ------
        LagcliError
            The values are invalid for the model, or a measure is.
        """
        group = self._groups.get(values)
        if group is None:
            try:
                group = self._derive(values)
            except LagcliError as error:
                group = error
            self._groups[values] = group
            if len(self._groups) > _MOST_GROUPS:
                self._groups.popitem(last=False)
        self._groups.move_to_end(values)
        if isinstance(group, LagcliError):
            raise group
        return group

    def base(self) -> RowGroup:
        """Return the group of the model's own values, to validate the sweep.

        Raises
        ------
        LagcliError
            The sweep is invalid.
        """
        return self._derive(None)

    def _derive(self, values: tuple[float, ...] | None) -> RowGroup:
        spec, columns = self.spec, self.spec.plan.columns
        given = dict(zip([columns[i] for i in self.structural], values or (), strict=False))
        model = spec.load({name: self._text(name, x) for name, x in given.items()})
        numeric = [columns[i] for i in self.numeric]
        kept = spec.keep == "trajectories"
        return RowGroup(Variants(model, spec.settings), numeric, spec.measures, kept)

    def _text(self, name: str, value: float) -> str:
        """Return a parameter's value in SI in the syntax of --set."""
        unit = self.model.parameters[name].unit
        text = repr(int(value) if value.is_integer() else value)
        return text if unit is None or to_si(unit) == 1 else f"{text} {si_notation(unit)}"

    def run(self, numbers: Numbers, check_cancelled: Callable[[], None]) -> Results:
        """Run rows; see `run_rows`."""
        table = self.spec.plan.rows(numbers)
        collected = _Collected(numbers, len(self.spec.measures), self.spec.strict)
        different, which = np.unique(table[:, self.structural], axis=0, return_inverse=True)
        for i, values in enumerate(different):
            places = np.flatnonzero(which.reshape(-1) == i)
            try:
                group = self.group(tuple(values.tolist()))
            except LagcliError as error:
                collected.refuse(places, error)
                continue
            collected.expect(group)
            with one_thread():
                group.run(
                    table[places][:, self.numeric],
                    partial(collected.enter, group, places),
                    check_cancelled,
                )
        return collected.results()


class _Collected:
    """The results of some rows during their execution."""

    def __init__(self, numbers: Numbers, measures: int, strict: bool):
        n, self.strict = len(numbers), strict
        self.numbers, self.messages = numbers, [""] * n
        self.status = np.full(n, MISSING, dtype=np.int8)
        self.counts = np.zeros((n, 3), dtype=np.int64)
        self.measures = np.full((n, measures), np.nan)
        self.kept = np.empty((n, 0, 0))

    def refuse(self, places: Indices, error: LagcliError) -> None:
        """Record an error of a whole structure for its rows."""
        for place in places:
            self.status[place], self.messages[place] = ERROR, str(error)

    def expect(self, group: RowGroup) -> None:
        """Allocate memory for the samples of a group."""
        if group.kept_names:
            shape = len(self.numbers), len(group.grid.times), len(group.kept_names)
            self.kept = np.full(shape, np.nan)

    def enter(self, group: RowGroup, places: Indices, ended: FinishedRuns) -> None:
        """Record completed rows of a group; ``places`` are the indices of all of its rows."""
        rows = places[ended.places]
        for row, run in zip(rows, ended.runs, strict=True):
            self.status[row], self.messages[row] = _outcome(run)
            if isinstance(run, Outcome):
                self.counts[row] = run.steps, run.rejected, run.evaluations
        if not ended.samples.shape[1]:
            return
        if self.strict:
            self._distrust(group, rows, ended)
        measures, kept, undefined = group.measured(ended)
        for i, warning in undefined.items():
            if self.status[rows[i]] == COMPLETED:
                self.messages[rows[i]] = warning if self.strict else WARNING + warning
                self.status[rows[i]] = FAILED if self.strict else COMPLETED
        completed = self.status[rows] == COMPLETED
        self.measures[rows[completed]] = measures[completed]
        if group.kept_names:
            self.kept[rows, : kept.shape[1]] = kept

    def _distrust(self, group: RowGroup, rows: Indices, ended: FinishedRuns) -> None:
        """Mark completed rows with warnings as failed."""
        for i in np.flatnonzero(self.status[rows] == COMPLETED).tolist():
            warnings = group.warnings(ended, i)
            if warnings:
                self.status[rows[i]], self.messages[rows[i]] = FAILED, "; ".join(warnings)

    def results(self) -> Results:
        """Return the results."""
        return Results(
            self.numbers, self.status, self.messages, self.counts, self.measures, self.kept
        )


def _outcome(run: Outcome | LagcliError) -> tuple[int, str]:
    if isinstance(run, Outcome):
        return (COMPLETED if run.status in ENDED else FAILED), run.message
    return (FAILED if run.exit_status == 3 else ERROR), str(run)


_runners: OrderedDict[str, Runner] = OrderedDict()


def _runner(spec: Spec) -> Runner:
    """Return a cached runner of a sweep in this process."""
    runner = _runners.get(spec.sha256)
    if runner is None:
        runner = _runners[spec.sha256] = Runner(spec)
        if len(_runners) > _MOST_SPECS:
            _runners.popitem(last=False)
    return runner
