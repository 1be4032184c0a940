"""Statuses returned by the core; `lagcli.engine.core.headers` writes them for C."""

from __future__ import annotations

from enum import IntEnum


class _Described(IntEnum):
    """Enumeration whose members are numbered from 0 and described by a sentence each."""

    sentence: str

    def __new__(cls, sentence: str) -> _Described:
        status = int.__new__(cls, len(cls.__members__))
        status._value_ = len(cls.__members__)
        status.sentence = sentence
        return status


class Status(_Described):
    """Reason for returning from the core."""

    RUNNING = "the slice of steps is over"
    DONE = "t_end is reached"
    BLOCK_FULL = "the sample block is full"
    UNDEFINED = "the equations have no finite value at (t_bad, y_bad)"
    FLOOR = "the step size fell to its minimum"
    NEAR = "the path ahead may lead to a singular configuration"
    OVER = "the last step may have crossed a singular configuration"
    OFF = "(t_bad, y_bad) cannot be projected onto the constraints"
    INACCURATE = "the static elimination is inaccurate at the end (t_bad, y_bad) of a rejected step"
    STIFF = "stability, not accuracy, limits the steps of an explicit method"
    ORDER = "an implicit method needs an order of pivots for its matrix"
    CONTRADICTED = "redundant constraints may contradict each other after the last step"
    JUMPED = "the constraints at t_bad are met only far from y_bad"
    HAPPENED = "events happened at an instant, which waits for what they do"
    RESOLVED = "an instant at which events happened is over, and its state is that after it"
    ENDLESS = "what happens at an instant does not end"
    NO_MODE = "no motion of the contacts is possible"
    TWO_MODES = "more than one motion of the contacts is possible"
    NO_IMPACT = "an impact has no solution"
    GAINS = "an impact would gain energy"
    VIOLATED = "an action at an instant has moved a contact beyond its surface"
    JAMMED = "a contact force grows without bound while its contact slides"
    SURFACES = "the motion is pushed onto more than one surface at which forces jump"
    FORKED = "more than one motion leaves a surface at which forces jump"
    NO_SIDE = "a force jumps with a multiplier, which is beyond the jump with neither of its sides"
    CORNER = "a constraint has a corner, at which the velocities jump"
    UNRESOLVED = "the sign of a watched function cannot be determined in the last step"
    CONFLICT = "the constraints cannot hold at the values that an event sets"
    NO_MEMORY = "there is no memory"


class LaneStatus(_Described):
    """Result of a run in a batch."""

    WAITING = "the run has not begun"
    UNDER_WAY = "a lane has the run"
    DONE = "t_end is reached"
    LEFT = "the run must be repeated by itself, from its start"


class StartStatus(_Described):
    """Result of a search for a consistent initial state."""

    FOUND = "a consistent state was found"
    CONTRADICTED = "no values of the free entries satisfy the constraints nearby"
    UNDEFINED = "the constraints have no finite value"
    SINGULAR = "the rank of B is not that of the data"
    UNTURNED = "a quaternion whose angular velocity is given is 0: no orientation"
    NO_MEMORY = "there is no memory"
