"""Samples of a run, and the record of everything needed to reproduce it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.columns import Columns
from lagcli.errors import UsageError
from lagcli.prose import counted

if TYPE_CHECKING:
    from lagcli.trajectory.event_log import EventLog

#: Version of the layout of result files.
SCHEMA_VERSION = "3"

#: The sign convention of lambda, written to every file (textbook equation 8.85).
SIGN_CONVENTION = (
    "d/dt dT/dq' - dT/dq + dV/dq = Q + sum_beta lambda_beta b_beta, "
    "b_beta = dphi_beta/dq (holonomic) or dpsi_beta/dq' (nonholonomic); "
    "for lhs = rhs, phi = lhs - rhs"
)

#: Values of ``Record.status``.
STATUSES = ("completed", "stopped-by-event", "failed", "interrupted")
#: Statuses of runs that ended as intended.
ENDED = STATUSES[:2]


class Terms(NamedTuple):
    """The nonzero pattern of B: which constraint acts on which coordinate.

    n terms, ordered by constraint and then by coordinate: the rows and columns of a sparse matrix
    with the values of one sample.

    Parameters
    ----------
    constraint, coordinate : (n,) arrays of int
        Indices of the constraints and of the coordinates.
    shape : (int, int)
        Numbers of constraints and coordinates, nc and nq.
    """

    constraint: Indices
    coordinate: Indices
    shape: tuple[int, int]

    @classmethod
    def of(cls, pairs: Iterable[tuple[int, int]], shape: tuple[int, int]) -> Terms:
        """Return the terms of ordered pairs of constraint and coordinate."""
        both = np.array(list(pairs), dtype=np.intp).reshape(-1, 2)
        return cls(both[:, 0].copy(), both[:, 1].copy(), shape)

    def check(self) -> None:
        """Raise ValueError unless the terms are ordered and within the constraints and
        coordinates."""
        nc, nq = self.shape
        if self.constraint.ndim != 1 or self.constraint.shape != self.coordinate.shape:
            raise ValueError("the parts of the terms differ in length")
        for places, most in ((self.constraint, nc), (self.coordinate, nq)):
            if len(places) and not 0 <= places.min() <= places.max() < most:
                raise ValueError("terms refer to constraints or coordinates that do not exist")
        if (np.diff(self.constraint * nq + self.coordinate) <= 0).any():
            raise ValueError("terms are not in order")

    def names(
        self, coordinates: Sequence[str], constraints: Sequence[str]
    ) -> list[tuple[str, str]]:
        """Return the names of the constraint and of the coordinate of each term."""
        pairs = zip(self.constraint.tolist(), self.coordinate.tolist(), strict=True)
        return [(constraints[i], coordinates[j]) for i, j in pairs]

    def total(self, values: Array) -> Array:
        """Return the sum over the constraints.

        Parameters
        ----------
        values : (nt, n) array
            ``constraint_force_by``.

        Returns
        -------
        (nt, nq) array
            The terms of each coordinate are summed in the order of the constraints.
        """
        total = np.zeros((len(values), self.shape[1]))
        order = np.argsort(self.coordinate, kind="stable")
        coordinate = self.coordinate[order]
        first = np.searchsorted(coordinate, coordinate)
        place = np.arange(len(order)) - first  # index of a term among those of its coordinate
        for turn in range(int(place.max(initial=-1)) + 1):
            mine = order[place == turn]
            total[:, self.coordinate[mine]] += values[:, mine]
        return total

    def dense(self, values: Array, constraint: int) -> Array:
        """Return the forces of one constraint on all coordinates, (nt, nq)."""
        first, end = np.searchsorted(self.constraint, (constraint, constraint + 1))
        forces = np.zeros((len(values), self.shape[1]))
        forces[:, self.coordinate[first:end]] = values[:, first:end]
        return forces

    def acting(self, constraint: int) -> dict[int, int]:
        """Return the coordinates that a constraint acts on, with the indices of the terms."""
        first, end = np.searchsorted(self.constraint, (constraint, constraint + 1))
        return {int(self.coordinate[k]): k for k in range(first, end)}

    def column(self, values: Array, constraint: int, coordinate: int) -> Array:
        """Return the force of one constraint on one coordinate, (nt,); zeros without a term."""
        first, end = np.searchsorted(self.constraint, (constraint, constraint + 1))
        place = first + int(np.searchsorted(self.coordinate[first:end], coordinate))
        if place < end and self.coordinate[place] == coordinate:
            return np.array(values[:, place])
        return np.zeros(len(values))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Samples(Columns):
    """Consecutive samples of a run: its columns, see `Columns`, and the names along their axes.

    Parameters
    ----------
    coordinates, constraints : tuple of str
        Names, in the model's order.
    terms : Terms
        Nonzero constraint forces: the order of ``constraint_force_by``.
        `constraint_force_of` gives the forces of one constraint.
    outputs : mapping of str to (nt,) array
        The model's own columns.
    conserved_names : tuple of str
        Names of the conserved quantities.
    sensitivity : tuple of n str
        Parameters and initial values with respect to which the motion is differentiated; usually
        none.
    dq, dv : (nt, nq, n) arrays or None
        Derivatives of q and v; None without derivatives.
    dmultipliers : (nt, nc, n) array or None
        Derivatives of λ; NaN if λ is not unique.
    """

    coordinates: tuple[str, ...]
    constraints: tuple[str, ...]
    terms: Terms
    conserved_names: tuple[str, ...] = ()
    outputs: Mapping[str, Array] = field(default_factory=dict)
    sensitivity: tuple[str, ...] = ()
    dq: Array | None = None
    dv: Array | None = None
    dmultipliers: Array | None = None

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.extent}>"

    @property
    def extent(self) -> str:
        """The number of samples and their times, as text: 601 samples from 0 s to 10 s."""
        number = counted(len(self.time), "sample")
        return (
            f"{number} from {self.time[0]:g} s to {self.time[-1]:g} s" if len(self.time) else number
        )

    @property
    def nbytes(self) -> int:
        """Size of the arrays, bytes."""
        arrays = (x for x in vars(self).values() if isinstance(x, np.ndarray))
        return sum(x.nbytes for x in arrays) + len(self.outputs) * self.time.nbytes

    @property
    def constraint_force(self) -> Array:
        """Σ_β λ_β b_β, the generalized constraint force, (nt, nq)."""
        return self.terms.total(self.constraint_force_by)

    def constraint_force_of(self, constraint: str) -> Array:
        """Return λ_β b_β, the generalized forces of one constraint, by its name.

        Parameters
        ----------
        constraint : str
            One of ``constraints``.

        Returns
        -------
        (nt, nq) array
            Zero for coordinates that the constraint does not act on.

        Raises
        ------
        UsageError
            There is no constraint of this name.
        """
        if constraint not in self.constraints:
            raise UsageError(
                f"there is no constraint {constraint!r}; the constraints are"
                f" {', '.join(self.constraints[:20]) or 'none'}"
            )
        return self.terms.dense(self.constraint_force_by, self.constraints.index(constraint))


class InputTable(NamedTuple):
    """The table of an input, a known function of time, in a record.

    Parameters
    ----------
    times, values : (n,) arrays
        Increasing times and values, in SI units.
    unit : str
        Unit of the values in the file; empty if none is given.
    file, sha256 : str
        CSV file and its SHA-256; empty if the table is in the model.
    """

    times: Array
    values: Array
    unit: str = ""
    file: str = ""
    sha256: str = ""

    def check(self, name: str) -> None:
        """Raise ValueError unless there are as many values as increasing times, all finite."""
        times, values = self.times, self.values
        if times.ndim != 1 or times.shape != values.shape or len(times) < 2:
            raise ValueError(f"the table of {name} has shapes {times.shape} and {values.shape}")
        finite = np.isfinite(times).all() and np.isfinite(values).all()
        if not finite or not (np.diff(times) > 0).all():
            raise ValueError(f"the table of {name} has no increasing times and finite values")


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """Metadata of a run; some of it is only known at the end.

    Parameters
    ----------
    scale_position, scale_velocity : (nc,) arrays
        Scales of the constraints' residuals: the largest sum of the magnitudes of their terms along
        the run, or the scale of `lagcli.engine.scales` if it is larger.
    units : mapping of str to str
        Unit, in SI, of a coordinate, a parameter or an output, by name, if the model gives it.
    status, message : str
        One of ``STATUSES``, and a message of one sentence.
    model : str
        The text of the model file, verbatim.
    parameters : mapping of str to float
        Values of the parameters.
    options : mapping
        Options of the run.
    counts : mapping of str to int
        steps, rejected, evaluations.
    seconds : mapping of str to float
        Time spent by phase.
    initial_correction : mapping of str to (float, float)
        Adjustments by consistent initialization: name → (value before, value after).
    tolerances : mapping of str to float
        The absolute tolerance of each coordinate and velocity (``phi'``) at the end of the run.
    warnings : tuple of str
        Warnings: reasons to distrust the result, one sentence each.
    freedom : mapping
        The degrees of freedom at the initial state: ``coordinates``, ``constraints``, ``rank`` of
        B, ``degrees_of_freedom``, and ``redundant``: sets of dependent ``constraints``, and the
        number of redundant ones in each (``surplus``). Empty if not recorded.
    conserved_formulas : mapping of str to str
        The conserved quantities in terms of the momenta ``p_q`` of the coordinates and Jacobi's
        integral ``h``, such as ``x*p_y - y*p_x``.
    display : mapping
        What pictures need of the model: ``latex``, the declared LaTeX of coordinates;
        ``definitions``, names of definitions and inputs, which the names of coordinates must not
        look like; ``jumping``, outputs that jump at events; ``given``, parameters in units other
        than SI as they were given, such as ``1500 rpm``; ``given_units``, the ``unit`` of those and
        of initial values, and its ``factor`` to SI. Empty if unknown.
    lagcli_version : str
        Version of the program that made the run; empty if unknown.
    inputs : mapping of str to InputTable
        The tables of the model's inputs, by name.
    events : EventLog or None
        The event log; None for a model without switching.
    """

    scale_position: Array
    scale_velocity: Array
    units: Mapping[str, str] = field(default_factory=dict)
    status: str = "completed"
    message: str = ""
    model: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    counts: Mapping[str, int] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    initial_correction: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    tolerances: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    freedom: Mapping[str, Any] = field(default_factory=dict)
    conserved_formulas: Mapping[str, str] = field(default_factory=dict)
    display: Mapping[str, Any] = field(default_factory=dict)
    lagcli_version: str = ""
    inputs: Mapping[str, InputTable] = field(default_factory=dict)
    events: EventLog | None = None

    @property
    def model_sha256(self) -> str:
        """The SHA-256 of the model's text; empty without one."""
        import hashlib  # OpenSSL, which a run that writes no file does not need

        return hashlib.sha256(self.model.encode()).hexdigest() if self.model else ""
