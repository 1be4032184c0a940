"""Runs of the core whose constraints switch; engine/switching/switching.py."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import byref, c_double, c_int, c_int64, c_void_p
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.core.contact_problem import ContactLaw, ContactProblem, ContactSolution
from lagcli.engine.core.library import Functions, check
from lagcli.engine.core.program import Program, assemble
from lagcli.engine.core.run import CoreModel, Integrator
from lagcli.engine.core.status import Status
from lagcli.engine.core.structures import (
    Arguments,
    Doubles,
    Integers,
    Structure,
    address,
    copied,
    each,
    lag_model,
    lag_program,
    listed,
)
from lagcli.engine.event_entries import EntryCounts, entry_layout
from lagcli.engine.tape.tape import Tape

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from lagcli.engine.switching.kinks import FrozenSystem
    from lagcli.engine.switching.splitting import SplitSystem
    from lagcli.engine.tape.ticks import Ticks


class DirectionalPrograms(NamedTuple):
    """Programs with which the core differentiates a motion: ``lag_directions`` in core/lagcore.h.

    Parameters
    ----------
    parameters : (n, np) array
        Derivatives of the System's parameters, including branches, which do not change.
    decides : tuple of bool
        For each condition, whether an event with actions depends on it.
    dynamics, constraint, functions, limits, impact, forces, signs, conditions, force_conditions,
    kinks, kink_rates : Program
    """

    parameters: Array
    decides: tuple[bool, ...]
    dynamics: Program
    constraint: Program
    functions: Program
    limits: Program
    impact: Program
    forces: Program
    signs: Program
    conditions: Program
    force_conditions: Program
    kinks: Program
    kink_rates: Program


class lag_instant_report(Structure):
    """An instant at which something switches."""

    _fields_ = (
        ("t", c_double),
        ("y", Doubles),
        *each(Integers, "mode active"),
        *each(Doubles, "gap speed force"),
        ("gained", c_double),
        *each(c_int, "with_friction equal_restitution"),
        ("takes_part", Integers),
        *each(c_int, "motions begun"),
        ("first_mode", Integers),
        *each(Doubles, "before a multipliers"),
        *each(c_int64, "crossed slid"),
        ("kinks", Integers),
        ("branches", Doubles),
        *each(c_int, "undetermined which"),
    )


class lag_contact_report(Structure):
    """A contact problem and its solutions."""

    _fields_ = (
        ("n", c_int),
        *each(Integers, "row law"),
        *each(Doubles, "matrix offset static_limit static_slope kinetic_limit kinetic_slope"),
        *each(Doubles * 2, "force motion"),
        ("mode", Integers * 2),
    )


class lag_directions(Structure):
    """Derivatives of a motion that switches."""

    _fields_ = (
        ("parameters", c_int),
        ("p", Doubles),
        ("decides", Integers),
        *each(lag_program, "dynamics constraint functions limits impact forces signs"),
        *each(lag_program, "conditions force_conditions kinks kink_rates"),
    )


class lag_loss_report(Structure):
    """Why a direction has no derivatives."""

    _fields_ = (
        *each(c_int, "lost reason count"),
        ("t", c_double),
        *each(Integers, "what which"),
    )


core = Functions(
    {
        "lag_instant_of": (lag_instant_report, c_void_p),
        "lag_contacts_of": (lag_contact_report, c_void_p),
        "lag_condition_happened": (c_int, c_void_p, c_int),
        "lag_condition_holds": (c_int, c_void_p, c_int),
        "lag_clock_ticks": (c_int, c_void_p, c_int),
        "lag_next_tick": (c_double, c_void_p),
        "lag_gap_of_none": (c_double, c_void_p, c_int),
        "lag_place": (None, c_void_p, c_void_p),
        "lag_activate": (None, c_void_p, c_int, c_int),
        "lag_set_parameters": (None, c_void_p, c_void_p),
        "lag_push": (c_int, c_void_p, c_void_p, c_void_p, c_void_p),
        "lag_take_log": (c_int64, c_void_p),
        "lag_use_directions": (c_int, c_void_p, c_void_p),
        "lag_loss_of": (lag_loss_report, c_void_p, c_int),
        "lag_read_changes": (c_int, c_void_p, c_void_p, c_void_p, c_void_p),
        "lag_change_of_time": (Doubles, c_void_p, c_int),
        "lag_set_changes": (None, c_void_p, c_void_p, c_void_p),
        "lag_sample_here": (c_int, c_void_p, c_void_p),
    }
)

#: Changes of a row at which a run may stop, in the order of lag_switching_rules.reported.
CHANGES = ("closes", "opens", "slips", "sticks", "impacts")


@lru_cache(maxsize=16)
def _nothing(inputs: int, held: int) -> Program:
    """Return a program without outputs."""
    return assemble(Tape(inputs, (), (), (), held))


def clock_fields(clocks: Sequence[tuple[Ticks, int]]) -> dict[str, Any]:
    """Return the clocks of a run, of `lag_switching_rules`.

    Parameters
    ----------
    clocks : sequence of (Ticks, int)
        Clocks of events, and the largest number of their ticks, 0 without a limit.
    """
    return {
        "clocks": len(clocks),
        "ticks": [x for ticks, _ in clocks for x in ticks],
        "most": [most for _, most in clocks],
    }


def rules_fields(split: SplitSystem, frozen: FrozenSystem | None) -> dict[str, Any]:
    """Return what switches, `lag_switching_rules` without clocks and a log.

    Parameters
    ----------
    split : SplitSystem
    frozen : FrozenSystem or None
        Where the System has kinks: what ``split`` is of.
    """
    system, switching, pattern = split.system, split.switching, split.pattern
    state, held = system.dynamics.inputs, system.dynamics.parameters
    forces = state + len(system.coordinates) + len(system.constraints)

    def program(tape: Tape | None, wanted: Any = True, inputs: int = state) -> Program:
        return split.program(tape) if tape and wanted else _nothing(inputs, held)

    rows, extra = switching.rows, len(split.rows) - len(switching.rows)
    place = {constraint: i for i, constraint in enumerate(split.rows)}
    laws = [
        ContactLaw.UNILATERAL
        if row.sign
        else ContactLaw.FREE
        if row.limit is None
        else ContactLaw.LIMITED
        for row in rows
    ]
    contacts = {i: n for n, i in enumerate(i for i, x in enumerate(rows) if x.sign)}
    limited = {i: n for n, i in enumerate(i for i, x in enumerate(rows) if x.limit is not None)}
    holonomic = sum(i >= 0 for i in split.places)
    signed, limit_pattern = split.laws, switching.limit_pattern
    signs, limits = signed.signs, signed.limits
    conditions, force_conditions = system.events, signed.force_conditions
    counts = [len(x.outputs) if x else 0 for x in (conditions, force_conditions)]
    either = {rule.condition for rule in switching.events if rule.either}
    times = [*switching.condition_times, *[0] * sum(counts)]
    reported = np.zeros((len(split.rows), len(CHANGES)), dtype=np.int32)
    for rule in switching.events:
        if rule.change is not None:
            reported[place[rule.change[0]], CHANGES.index(rule.change[1])] = 1
    kinks = frozen.kinks if frozen else ()
    return {
        "rows": len(split.rows),
        "exported": len(rows),
        "nc": len(system.constraints),
        "constraint": split.rows,
        "base": split.base,
        "law": [*laws, *[ContactLaw.FREE] * extra],
        "limit": [*(-1 if x.limit is None else x.limit for x in rows), *[-1] * extra],
        "normal": [*(-1 if x.normal is None else place[x.normal] for x in rows), *[-1] * extra],
        "place": split.places,
        "sign": [*(x.sign or 1 for x in rows), *[1.0] * extra],
        "active": [*(x.active for x in rows), *[1] * extra],
        "friction": [
            len(contacts) + limited[i] if i in limited else -1 for i in range(len(split.rows))
        ],
        "restitution": [contacts.get(i, -1) for i in range(len(split.rows))],
        "nb": len(pattern),
        "nh": holonomic,
        "row": [i for i, _ in pattern],
        "column": [j for _, j in pattern],
        "functions": program(split.functions, split.rows),
        "gaps": program(split.gaps, holonomic),
        "signs": signs,
        "sign_functions": program(signed.functions, signs, forces + signs),
        "limits": program(limits, limits.outputs, forces + signs),
        "nl": (len(limits.outputs) - 2 * len(limit_pattern)) // 2,
        "pattern_count": len(limit_pattern),
        "pattern_limit": [i for i, _ in limit_pattern],
        "pattern_row": [place[j] for _, j in limit_pattern],
        "impact": program(switching.impact, switching.impact.outputs),
        "nf": len(switching.force_coordinates),
        "force_count": len(switching.force_pattern),
        "force_coordinate": switching.force_coordinates,
        "force_row": [i for i, _ in switching.force_pattern],
        "force_constraint": [j for _, j in switching.force_pattern],
        "forces": program(signed.forces, inputs=forces + signs),
        "conditions": counts[0],
        "force_conditions": counts[1],
        "condition_functions": program(conditions),
        "force_condition_functions": program(force_conditions, inputs=forces + signs),
        "either": [i in either for i in range(sum(counts))],
        "time": times[: sum(counts)],
        **clock_fields(()),
        "reported": reported,
        "kinks": len(kinks),
        "first_branch": len(system.parameters) - len(kinks),
        "whole": [x.whole for x in kinks],
        "of_time": [x.timed for x in kinks],
        "kink_functions": program(frozen.functions if frozen else None),
        "log": None,
        "log_rows": 0,
    }


class SwitchingIntegrator(Integrator):
    """Steps with projection on a System whose rows switch.

    Parameters
    ----------
    split : SplitSystem
    model, problem, breaks
        As for `Integrator`, of ``split.fixed``, with the rows of ``split`` as extra numbers.
    clocks : sequence of (Ticks, int)
        Clocks of events, and the largest number of their ticks, 0 without a limit.
    log_rows : int
        Entries of the log that are kept before they are passed on.
    """

    def __init__(
        self,
        split: SplitSystem,
        model: CoreModel,
        problem: dict[str, Any],
        breaks: Array,
        *,
        clocks: Sequence[tuple[Ticks, int]],
        log_rows: int,
    ):
        rules, self._directions = model.record.rules, problem["directions"]
        self._split, self._ticks, self._log_rows = split, clocks, log_rows
        self._rows: int = rules.rows
        self._clocks = len(clocks)
        self._conditions: int = rules.conditions + rules.force_conditions
        #: The constraints that always hold, apart from those that limit friction.
        self.base = split.base
        self._kinks: int = rules.kinks
        self._first_branch: int = rules.first_branch
        self.entry_counts = EntryCounts(
            model.record.equations.nq, rules.nc, rules.exported, self._directions
        )
        super().__init__(model, problem, breaks)

    def _record(self, problem: dict[str, Any], breaks: Array) -> lag_model:
        """Return the model with the problem, the clocks and the log."""
        record, given = super()._record(problem, breaks), self._given
        width = entry_layout(self.entry_counts).size
        # lag_log_has_room asks for space for one round of all rows; a log of many rows is passed on
        # as early as one of few, so that most of it is not touched
        self._log = np.empty((self._log_rows + 4 * self._rows + 1, width))
        clocks = clock_fields(self._ticks)
        record.rules.clocks = clocks["clocks"]
        record.rules.ticks = given.doubles(clocks["ticks"])
        record.rules.most = given.integers(clocks["most"])
        record.rules.log, record.rules.log_rows = address(self._log), len(self._log)
        return record

    def take_log(self) -> Array:
        """Return the rows of the log since the last call, valid until the run continues:
        `EntryLayout`."""
        return self._log[: core.lag_take_log(self._run)]

    def happened(self) -> list[int]:
        """Return the conditions that have happened at this instant and were not asked for yet."""
        return [i for i in range(self._conditions) if core.lag_condition_happened(self._run, i)]

    def ticked(self) -> list[int]:
        """Return the clocks that tick at this instant and were not asked for yet."""
        return [i for i in range(self._clocks) if core.lag_clock_ticks(self._run, i)]

    @property
    def next_tick(self) -> float:
        """Time of the next tick of a clock; infinity without one."""
        t: float = core.lag_next_tick(self._run)
        return t

    def holding(self) -> list[int]:
        """Return the conditions that hold."""
        return [i for i in range(self._conditions) if core.lag_condition_holds(self._run, i)]

    @property
    def _instant(self) -> Any:
        return core.lag_instant_of(self._run)

    @property
    def modes(self) -> list[int]:
        """Modes of the rows, `RowMode`."""
        return listed(self._instant.mode, self._rows)

    @property
    def contacts(self) -> Array:
        """φ, ψ and the forces of the rows at the last contact problem, by their signs: (3, n)."""
        report = self._instant
        return np.array([copied(x, self._rows) for x in (report.gap, report.speed, report.force)])

    @property
    def gain(self) -> tuple[float, bool, bool]:
        """Energy gained by the last impact, J; whether it had friction, and equal restitution."""
        report = self._instant
        return report.gained, bool(report.with_friction), bool(report.equal_restitution)

    @property
    def unresolved(self) -> tuple[str, int]:
        """Function whose sign is not determined: "row", "kink" or "condition", and its index."""
        report = self._instant
        return ("row", "kink", "condition")[report.undetermined], report.which

    @property
    def struck(self) -> list[int]:
        """The rows that take part in the last impact."""
        takes_part = listed(self._instant.takes_part, self._rows)
        return [i for i in range(self._rows) if takes_part[i]]

    @property
    def problem(self) -> tuple[list[int], ContactProblem, list[ContactSolution]]:
        """The last contact problem of accelerations: its rows, and its motions."""
        r = core.lag_contacts_of(self._run)
        n: int = r.n

        def square(pointer: Any) -> Array:
            return copied(pointer, n * n).reshape(n, n)

        problem = ContactProblem(
            square(r.matrix),
            copied(r.offset, n),
            np.array(listed(r.law, n)),
            copied(r.static_limit, n),
            copied(r.kinetic_limit, n),
            square(r.static_slope),
            square(r.kinetic_slope),
        )
        motions = [
            ContactSolution(
                copied(r.force[k], n), copied(r.motion[k], n), np.array(listed(r.mode[k], n))
            )
            for k in range(self._instant.motions)
        ]
        return listed(r.row, n), problem, motions

    def place(self, y: ArrayLike) -> None:
        """Set the state at an instant."""
        given = Arguments()
        core.lag_place(self._run, given.doubles(y))

    def activate(self, row: int, active: bool) -> None:
        """Let a row take part, or leave."""
        core.lag_activate(self._run, row, active)

    def no_gap(self, row: int) -> float:
        """Return the gap of a row that counts as none."""
        gap: float = core.lag_gap_of_none(self._run, row)
        return gap

    def set_parameters(self, p: Sequence[float]) -> None:
        """Set the values of all parameters, without the branches of kinks."""
        given, first = Arguments(), self._first_branch
        values = given.doubles([*p[:first], *self.branches, *p[first:]])
        core.lag_set_parameters(self._run, values)

    @property
    def branches(self) -> list[float]:
        """Values of the branches."""
        branches: list[float] = copied(self._instant.branches, self._kinks).tolist()
        return branches

    @property
    def course(self) -> tuple[list[int], int, int]:
        """Modes of the rows at the start, how often a branch has changed, and how often sliding on
        a surface has begun."""
        report = self._instant
        return listed(report.first_mode, self._rows), report.crossed, report.slid

    @property
    def surfaces(self) -> list[int]:
        """The kinks whose functions vanish at the instant."""
        kinks = listed(self._instant.kinks, self._kinks)
        return [i for i in range(self._kinks) if kinks[i]]

    def push(self, impulse: ArrayLike, changes: ArrayLike | None = None) -> Array | None:
        """Apply a generalized impulse, whose derivatives are ``changes``, (n, nq).

        Returns
        -------
        (nb,) array or None
            The impulses of the constraints that always hold, of least norm; None if they are
            undefined.
        """
        given, reaction = Arguments(), np.zeros(len(self.base))
        of_changes = None if changes is None else given.doubles(changes)
        status = core.lag_push(self._run, given.doubles(impulse), of_changes, address(reaction))
        return reaction if status == Status.RUNNING else None

    def use_directions(self, directions: DirectionalPrograms) -> None:
        """Differentiate the motion.

        Parameters
        ----------
        directions : DirectionalPrograms
        """
        given = Arguments()
        record = given.filled(
            lag_directions,
            parameters=directions.parameters.shape[1],
            p=directions.parameters,
            decides=directions.decides,
            dynamics=directions.dynamics,
            constraint=directions.constraint,
            functions=directions.functions,
            limits=directions.limits,
            impact=directions.impact,
            forces=directions.forces,
            signs=directions.signs,
            conditions=directions.conditions,
            force_conditions=directions.force_conditions,
            kinks=directions.kinks,
            kink_rates=directions.kink_rates,
        )
        check(core.lag_use_directions(self._run, byref(record)))

    def changes(self, parameters: int) -> tuple[Array, Array, Array]:
        """Return derivatives at an instant: of the state, of the parameters, and of a and λ."""
        constraints = len(self._split.system.constraints)
        state = np.empty((self._directions, 2 * self._nq))
        forces = np.empty((self._directions, self._nq + constraints))
        p = np.empty((self._directions, max(parameters, 1)))
        core.lag_read_changes(self._run, address(state), address(p), address(forces))
        return state, p[:, :parameters], forces

    def set_changes(self, state: ArrayLike, parameters: ArrayLike) -> None:
        """Set derivatives where an action has changed the state or the parameters."""
        given = Arguments()
        core.lag_set_changes(self._run, given.doubles(state), given.doubles(parameters))

    def change_of_time(self, condition: int | None = None) -> Array:
        """Return the derivatives of the time of the instant, or of that of a condition."""
        which = -1 if condition is None else condition
        return copied(core.lag_change_of_time(self._run, which), self._directions)

    @property
    def losses(self) -> list[tuple[int, float, int, list[tuple[int, int]]]]:
        """Number, time, reason and causes of each direction that has lost its derivatives."""
        losses = []
        for k in range(self._directions):
            r = core.lag_loss_of(self._run, k)
            if r.lost:
                culprits = list(zip(listed(r.what, r.count), listed(r.which, r.count), strict=True))
                losses.append((k, r.t, r.reason, culprits))
        return losses

    @property
    def begun(self) -> bool:
        """Whether the modes at the start have been determined."""
        return bool(self._instant.begun)

    @property
    def motion(self) -> tuple[Array, Array, Array]:
        """The state at the beginning of the instant, and a and λ of all constraints."""
        report, constraints = self._instant, len(self._split.system.constraints)
        return (
            copied(report.before, self._n),
            copied(report.a, self._nq),
            copied(report.multipliers, constraints),
        )

    def sample_here(self) -> tuple[int, Array]:
        """Return a status, and the sample row of the present state."""
        row = np.empty(self.block.shape[1])
        return core.lag_sample_here(self._run, address(row)), row
