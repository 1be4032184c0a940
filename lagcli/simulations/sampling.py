"""Parts of a request from settings and units: sample times, absolute tolerances, kinds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.tape.ticks import counted, simplest
from lagcli.errors import UsageError
from lagcli.model.expression.units import si_notation
from lagcli.settings.settings import Settings

if TYPE_CHECKING:
    from lagcli.model.model import Coordinate


def sample_times(settings: Settings) -> Array:
    """Return the sample times, s, (sample_count,).

    Raises
    ------
    UsageError
        Doubles do not distinguish neighbouring times.
    """
    if settings.times is not None:
        return np.array(settings.times)
    start, end, count = settings.t_start, settings.t_end, settings.sample_count
    if count == 1:
        return np.array([start if settings.dt is not None else end])
    spacing = settings.dt or (end - start) / (count - 1)
    resolved = float(np.spacing(max(abs(start), abs(end))))
    if spacing <= resolved:
        raise UsageError(
            f"samples {spacing:.3g} s apart are not distinct times: those near {end:.9g} s are"
            f" {resolved:.2g} s apart; take fewer samples, or a later t_end"
        )
    exact = _counted(settings) if start else None
    if exact is not None:
        return np.minimum(exact, end)
    if settings.dt is not None:
        return np.minimum(start + settings.dt * np.arange(count), end)
    return np.linspace(start, end, count)


def _counted(settings: Settings) -> Array | None:
    """Return equally spaced times, each rounded once; None if they are not simple fractions.

    A sum of a start and multiples of a step would be off zero, and off rows of inputs next to
    zero, by rounding errors of the start.
    """
    first, count = simplest(settings.t_start), settings.sample_count
    if settings.dt is not None:
        step = simplest(settings.dt)
    else:
        step = (simplest(settings.t_end) - first) / (count - 1)
    ticks = counted(first, step)
    return None if ticks is None else ticks.times(np.arange(count, dtype=float))


def absolute_tolerances(
    given: float | Mapping[str, float] | None, coordinates: tuple[str, ...]
) -> float | Array:
    """Return the absolute tolerances of q, v and the work; 0 if they follow the size.

    Raises
    ------
    UsageError
        A name is not that of a coordinate or a velocity.
    """
    if not isinstance(given, Mapping):
        return given or 0.0
    names = (*coordinates, *(f"{q}'" for q in coordinates))
    for name in given:
        if name not in names:
            raise UsageError(f"atol names `{name}`, which is not a coordinate or a velocity (`x'`)")
    return np.array([*(given.get(name, 0.0) for name in names), 0.0])


def unit_kinds(coordinates: Iterable[Coordinate]) -> tuple[int, ...]:
    """Return the kind of each coordinate by its unit; see `IntegrationRequest.kinds`."""
    numbers: dict[str, int] = {}
    units = [si_notation(c.unit) if c.unit else "" for c in coordinates]
    return tuple(numbers.setdefault(unit, len(numbers)) for unit in units)


#: Parameter values from a sample on, by the index of that sample.
ParameterChanges = Sequence[tuple[int, tuple[float, ...]]]


def parts_of_constant_parameters(
    count: int, p: tuple[float, ...], changes: ParameterChanges
) -> Iterator[tuple[slice, tuple[float, ...]]]:
    """Yield ranges of samples with constant parameter values, and the values.

    Parameters
    ----------
    count : int
    p : tuple of float
        Values at the first sample.
    changes : sequence of (int, tuple of float)
        Changes, in order.
    """
    first = 0
    for sample, values in changes:
        if sample > first:
            yield slice(first, sample), p
        first, p = sample, values
    if count > first:
        yield slice(first, count), p
