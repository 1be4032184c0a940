"""The search for all equilibria of a model with contacts: one search in each mode."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations

import numpy as np

from lagcli.analysis.equilibria.search import fold, search_steady_states
from lagcli.analysis.local.active_set import ActiveSet, ModeChange, distributed
from lagcli.analysis.local.contact_mode import ModeEquations, Modes, SwitchedModel
from lagcli.analysis.local.contact_status import Acting
from lagcli.analysis.local.steady import SteadyProblem
from lagcli.analysis.local.steady_states import SteadyState, completed
from lagcli.engine.constraints.initial import NoStart
from lagcli.errors import NumericalError, UsageError

#: Contacts up to which all sets of closed ones are tried.
_MOST = 8
#: Of the coordinates' lengths: states nearer than this are one.
_SAME = 1e-6


def search_in_all_modes(
    switched: SwitchedModel, held: Mapping[str, float], starts: int
) -> list[SteadyState]:
    """Return the states found in all sets of closed contacts that satisfy 0 ≤ φ ⊥ λ ≥ 0.

    Friction sticks, or slides where the velocities that are held demand it; where it would exceed
    its limit, states at the limit are looked for.

    Parameters
    ----------
    switched : SwitchedModel
    held : mapping of str to float
        Velocities that are held, by coordinate.
    starts : int
        Points in each mode.

    Raises
    ------
    UsageError
        The constraints determine a velocity that is held, or there are too many contacts.
    NumericalError
        None was found.
    """
    active = ActiveSet(switched, held)
    start = active.start
    waiting = [active.sliding(start, modes) for modes in _closed_sets(switched)]
    seen, found = set[Modes](), list[SteadyState]()
    for modes in waiting:  # it grows
        if modes in seen:
            continue
        seen.add(modes)
        local = switched.local(modes, start)
        try:
            states = search_steady_states(SteadyProblem(local, held), starts)
        except (NumericalError, NoStart):
            continue
        for state in states:
            root = distributed(local, SteadyProblem(local, held), state.found)
            if root is not state.found:
                state = fold(completed(SteadyProblem(local, held), root), local.angles)
            point = state.operating_point.point
            changes = active.contradictions(local, point)
            if not changes:
                _keep(state, found)
            for k, mode in changes:
                if mode.at_limit:
                    waiting.append(active.changed(modes, ModeChange(k, mode, point.q)))
    if not found:
        what = "steady motion" if held else "equilibrium"
        raise NumericalError(
            f"no {what} of {switched.model.name} was found in {len(seen)} modes of its contacts;"
            " give initial values nearer to one (--set-initial), or more starts (--starts)"
        )
    return found


def _closed_sets(switched: SwitchedModel) -> Iterator[Modes]:
    """Yield the modes in which some contacts are closed, few first; friction sticks there."""
    rows = switched.rows
    contacts = [k for k, row in enumerate(rows) if row.sign and row.active]
    if len(contacts) > _MOST:
        raise UsageError(
            f"--all tries all sets of closed contacts, at most {_MOST} contacts;"
            f" {switched.model.name} has {len(contacts)}: leave out --all, and choose initial"
            " values"
        )
    for size in range(len(contacts) + 1):
        for closed in combinations(contacts, size):
            modes = [
                Acting.HOLDS if (k in closed or not row.sign) and row.active else Acting.OPEN
                for k, row in enumerate(rows)
            ]
            yield switched.with_friction(tuple(modes))


def _keep(state: SteadyState, found: list[SteadyState]) -> None:
    """Add a state, unless another mode has it too: where a contact touches without a force."""
    local, q = state.local, state.operating_point.point.q
    assert isinstance(local, ModeEquations)
    for other in found:
        far = q - other.operating_point.point.q
        turns = np.where(local.angles, np.round(far / (2 * np.pi)), 0.0)
        if (np.abs(far - 2 * np.pi * turns) <= _SAME * local.lengths).all():
            return
    found.append(state)
