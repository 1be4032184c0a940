"""Synthetic trajectories: random numbers in the shapes of a run."""

from __future__ import annotations

import dataclasses
import math
import os
import sys
from typing import Any

import numpy as np
from hypothesis import strategies as st

from lagcli.columns import QUANTITIES
from lagcli.sparse_table import SparseTable, changes_of
from lagcli.trajectory.event_log import EventLog, EventRecords
from lagcli.trajectory.samples import Terms
from lagcli.trajectory.trajectory import Trajectory

MODEL = """\
name: slider-crank  # after the textbook
coordinates: [phi, psi]
description: Kurbel OA — „Stange“ AB
"""

#: The fields that a round trip of arrays must keep bit for bit.
ARRAYS = tuple(quantity.name for quantity in QUANTITIES if quantity.name != "constraint_force")


def make(
    nt: int = 5,
    coordinates: tuple[str, ...] = ("phi", "psi"),
    constraints: tuple[str, ...] = ("guide",),
    outputs: tuple[str, ...] = ("rod_force", "a_first"),
    conserved_names: tuple[str, ...] = ("p_phi",),
    seed: int = 0,
    **changes: Any,
) -> Trajectory:
    """Return a trajectory of random numbers; ``changes`` replace its fields."""
    random = np.random.default_rng(seed)
    terms = changes.pop("terms", None) or all_terms(len(constraints), len(coordinates))
    length = {"time": nt, "coordinate": len(coordinates), "constraint": len(constraints)}
    length |= {"term": len(terms.constraint), "conserved_quantity": len(conserved_names)}
    arrays = {}
    for quantity in QUANTITIES:
        if quantity.name in ARRAYS:
            numbers = random.normal(size=[length[axis] for axis in quantity.axes])
            arrays[quantity.name] = numbers * 10.0 ** random.integers(-9, 9)
    arrays["time"] = np.arange(nt) * 0.1
    arrays |= {name: np.abs(arrays[name]) for name in ("scale_position", "scale_velocity")}
    fields: dict[str, Any] = {
        "outputs": {name: random.normal(size=nt) for name in outputs},
        "units": {"phi": "rad", "psi": "rad", "m": "kg", "rod_force": "N"},
        "status": "completed",
        "message": "reached t_end",
        "model": MODEL,
        "parameters": {"m": 1.0, "r": 0.1, "tau": -0.0},
        "options": {"rtol": 1e-9, "method": "dop853", "times": [0.5, 1.0], "events": None},
        "counts": {"steps": 120, "rejected": 3, "evaluations": 1443},
        "seconds": {"derive": 0.014, "integrate": 0.002},
        "conserved_formulas": dict.fromkeys(conserved_names, "p_phi"),
        "initial_correction": {"psi": (0.1, 0.16057), "psi_dot": (0.0, 2.9)},
        "lagcli_version": "0.1.0",
    }
    names = {"coordinates": coordinates, "constraints": constraints, "terms": terms}
    names["conserved_names"] = conserved_names
    return Trajectory(**{**names, **arrays, **fields, **changes})


def all_terms(constraints: int, coordinates: int) -> Terms:
    """Return the terms of constraints that act on every coordinate."""
    return Terms.of(np.ndindex(constraints, coordinates), (constraints, coordinates))


def make_for_csv(nt: int = 5, **changes: Any) -> Trajectory:
    """Return a trajectory whose arrays CSV can hold without a sidecar."""
    run = make(nt, **changes)
    unknown = np.full(len(run.constraints), np.nan)
    return dataclasses.replace(run, scale_position=unknown, scale_velocity=unknown)


def assert_same_arrays(one: Trajectory, other: Trajectory) -> None:
    """Compare every number by its bits (so that NaN equals itself and 0 is not -0)."""
    assert (one.coordinates, one.constraints) == (other.coordinates, other.constraints)
    assert list(one.outputs) == list(other.outputs)
    assert repr(one.terms) == repr(other.terms)
    pairs = {name: (getattr(one, name), getattr(other, name)) for name in ARRAYS}
    pairs |= {f"outputs/{n}": (one.outputs[n], other.outputs[n]) for n in one.outputs}
    for name, (a, b) in pairs.items():
        assert a.shape == b.shape, name
        assert b.dtype == np.float64, name
        np.testing.assert_array_equal(a.view(np.uint64), b.view(np.uint64), err_msg=name)


def assert_same(one: Trajectory, other: Trajectory) -> None:
    """Compare every field; NaN equals NaN in the mappings too."""
    assert_same_arrays(one, other)
    for field in dataclasses.fields(Trajectory):
        if field.name not in (*ARRAYS, "outputs", "terms"):
            a, b = getattr(one, field.name), getattr(other, field.name)
            assert repr(a) == repr(b), field.name


def environment() -> dict[str, str]:
    """Return an environment in which a new Python finds what this one finds, and buffers."""
    others = {k: v for k, v in os.environ.items() if k != "PYTHONUNBUFFERED"}
    return {**others, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def random_trajectories(
    numbers: st.SearchStrategy[float],
) -> st.SearchStrategy[Trajectory]:
    """Return runs of any size with these numbers and any names and texts that a model can have."""
    names = st.lists(
        st.one_of(
            st.from_regex(r"[^\W\d_]\w{0,8}(\[[0-9]{1,2}(,[0-9])?\])?", fullmatch=True),
            st.sampled_from(["t", "time", "q", "energy_kinetic", "coordinate", "Qc", "name"]),
        ),
        max_size=3,
        unique=True,
    ).map(tuple)
    # HDF5 ends a text at NUL, and YAML has none.
    texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"))

    @st.composite
    def build(draw: st.DrawFn) -> Trajectory:
        nt = draw(st.integers(0, 4))
        coordinates, constraints, outputs = draw(names), draw(names), draw(names)
        conserved_names = draw(names)
        length = {"time": nt, "coordinate": len(coordinates), "constraint": len(constraints)}
        pairs = list(np.ndindex(len(constraints), len(coordinates)))
        acting = sorted(draw(st.sets(st.sampled_from(pairs)))) if pairs else []
        terms = Terms.of(acting, (len(constraints), len(coordinates)))
        length |= {"term": len(acting), "conserved_quantity": len(conserved_names)}

        def array(axes: tuple[str, ...]) -> np.ndarray:
            shape = tuple(length[axis] for axis in axes)
            size = math.prod(shape)
            return np.array(draw(st.lists(numbers, min_size=size, max_size=size))).reshape(shape)

        return make(
            nt,
            coordinates,
            constraints,
            terms=terms,
            conserved_names=conserved_names,
            **{q.name: array(q.axes) for q in QUANTITIES if q.name in ARRAYS[1:]},
            outputs={name: array(("time",)) for name in outputs},
            units=draw(st.dictionaries(st.sampled_from([*coordinates, *outputs, "m"]), texts)),
            message=draw(texts),
            model=draw(texts),
            parameters=draw(st.dictionaries(texts, numbers, max_size=3)),
            initial_correction=draw(
                st.dictionaries(texts, st.tuples(numbers, numbers), max_size=2)
            ),
        )

    return build()


def make_log(
    coordinates: tuple[str, ...] = ("phi", "psi"),
    constraints: tuple[str, ...] = ("guide", "floor", "floor.slip"),
    entries: tuple[tuple[float, str, str], ...] = (
        (0.11, "floor", "impact"),
        (0.11, "floor.slip", "impact"),
        (0.2, "floor", "impact"),
        (0.25, "floor", "rest"),
        (0.3, "floor.slip", "slips"),
        (0.4, "kick", "event"),
    ),
    seed: int = 0,
) -> EventLog:
    """Return a log of random numbers."""
    random = np.random.default_rng(seed)
    count, rows = len(entries), ("floor", "floor.slip")
    start = np.zeros(len(rows), dtype=np.intp)
    time, names, kinds = zip(*entries, strict=True) if entries else ((), (), ())
    recording = [i for i, kind in enumerate(kinds) if kind == "event"]
    columns = ("y_dot", "lambda.guide") if recording else ()
    sides = random.normal(size=(2, len(recording), len(columns)))
    sides[:, 1:, :1] = np.nan  # another event records fewer columns
    return EventLog(
        rows=rows,
        start=start,
        time=np.array(time, dtype=float),
        names=names,
        kinds=kinds,
        q=random.normal(size=(count, len(coordinates))),
        before=random.normal(size=(count, len(coordinates))),
        after=random.normal(size=(count, len(coordinates))),
        nonzero_impulses=SparseTable.of(
            random.normal(size=(count, len(constraints)))
            * random.integers(0, 2, size=(count, len(constraints)))
        ),
        loss=np.abs(random.normal(size=count)),
        supplied=random.normal(size=count),
        work=random.normal(size=count),
        mode_changes=changes_of(start, random.integers(0, 4, size=(count, len(rows)))),
        records=EventRecords(
            columns=columns,
            entry=np.array(recording, dtype=np.intp),
            before=sides[0],
            after=sides[1],
        ),
    )


def make_with_log(**changes: Any) -> Trajectory:
    """Return a trajectory of a model with contacts."""
    return make(constraints=("guide", "floor", "floor.slip"), events=make_log(), **changes)


def assert_same_logs(one: EventLog | None, other: EventLog | None) -> None:
    """Compare every field, numbers by their bits."""
    assert one is not None
    assert other is not None
    both = ((getattr(one, f.name), getattr(other, f.name), f) for f in dataclasses.fields(EventLog))
    parts = (
        (getattr(one.records, f.name), getattr(other.records, f.name), f)
        for f in dataclasses.fields(EventRecords)
    )
    for a, b, field in (*both, *parts):
        if isinstance(a, EventRecords):
            continue
        if isinstance(a, SparseTable):
            assert isinstance(b, SparseTable)
            assert a.shape == b.shape
            for x, y in zip(a[1:], b[1:], strict=True):
                assert x.dtype == y.dtype, field.name
                np.testing.assert_array_equal(x, y, err_msg=field.name)
        elif isinstance(a, np.ndarray):
            assert a.dtype == b.dtype, field.name
            np.testing.assert_array_equal(a, b, err_msg=field.name)
        else:
            assert a == b, field.name
