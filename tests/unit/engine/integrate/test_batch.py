"""Lanes: eight runs at once against the same runs one by one."""

from __future__ import annotations

import math
import time
from pathlib import Path

import numpy as np
import pytest
from core_parts import batch_sincos
from integration_requests import changed
from shipped import every_model
from singular_motions import losing_rank, stated_time

import lagcli
from lagcli.engine.contract import Block, Interrupted
from lagcli.engine.core.batch import BatchTable
from lagcli.engine.core.library import KERNEL, PORTABLE
from lagcli.engine.core.program import assemble
from lagcli.engine.core.status import LaneStatus
from lagcli.engine.integrate import batch
from lagcli.engine.integrate.batch import SampleTape, prepare_batch, run_batch, suits_batch
from lagcli.engine.integrate.engine import integrate
from lagcli.engine.system import State
from lagcli.engine.tape.interpreter import ScalarTape, run_arrays
from lagcli.engine.tape.operations import ARITY, Op
from lagcli.engine.tape.tape import Tape
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare
from lagcli.simulations.variants import Variants

MODELS = sorted((Path(__file__).parents[4] / "models").glob("*.yaml"))
NAMES = [path.stem for path in MODELS]
PENDULUM = """
parameters: {m: 1, l: 1, g: 9.81, c: 0}
coordinates: [x, y]
T: m/2*(x'^2 + y'^2)
V: m*g*y
Q: {x: -c*x'}
constraints: {rod: x^2 + y^2 = l^2}
initial: {x: {guess: 1}, y: {guess: -0.2}, x': 0, y': {guess: 0}}
"""


class Runs:
    """Runs of one model with several values of its parameters, from consistent starts."""

    def __init__(self, model, names=(), table=None, **options):
        variants = Variants(model, SettingsOverrides(**options))
        rows = [dict(zip(names, row, strict=True)) for row in table] if names else [{}]
        self.simulations = [variants.varied(row) for row in rows]
        first = self.simulations[0]
        self.system = first.system
        request = first.request
        self.request = request._replace(prepared=prepare_batch(self.system, request))
        values = [s.start.state.p for s in self.simulations]
        self.parameters = np.array(values).reshape(len(rows), -1)
        self.q = np.array([s.start.state.q for s in self.simulations])
        self.v = np.array([s.start.state.v for s in self.simulations])

    def at(self, *rows):
        """Return these runs alone."""
        some = object.__new__(Runs)
        some.__dict__ |= self.__dict__
        some.parameters, some.q, some.v = (x[list(rows)] for x in (self.parameters, self.q, self.v))
        return some

    def __call__(self, **changes):
        """Return the samples and the record of each run, from the lanes."""
        request = changed(self.request, **changes)
        found = {}

        def take(finished):
            for row, samples, run in zip(*finished, strict=True):
                assert row not in found
                found[int(row)] = samples, run

        run_batch(self.system, request, self.parameters, self.q, self.v, take)
        assert sorted(found) == list(range(len(self.q)))
        return [found[row] for row in range(len(self.q))]

    def single(self, row, *, kept=False, **changes):
        """Return the same for one run, from the single-run engine; with what another one kept."""
        blocks: list[Block] = []
        state = State(
            self.request.state.t, self.q[row], self.v[row], tuple(self.parameters[row].tolist())
        )
        changes |= {"state": state, "elimination": None}
        changes["prepared"] = self.request.prepared if kept else None
        request = changed(self.request, **changes)
        run = integrate(self.system, request, blocks.append)
        rows = [np.column_stack([b.time, b.q, b.v, b.a, b.multipliers, b.work]) for b in blocks]
        return np.concatenate(rows) if rows else np.empty((0, 0)), run


@pytest.fixture
def core_statuses(monkeypatch):
    """The statuses of the runs in each use of the lanes."""
    found = []
    original = batch.BatchIntegrator

    def kept(*arguments):
        lanes = original(*arguments)
        found.append(lanes)
        return lanes

    monkeypatch.setattr(batch, "BatchIntegrator", kept)
    return lambda: [int(x) for lanes in found for x in lanes.status[:-1]]


# numbers


@pytest.mark.parametrize("portable", [False, True])
def test_sine_and_cosine_are_good_to_one_unit_in_the_last_place(portable):
    random = np.random.default_rng(1)
    spread = [random.uniform(-size, size, 40_000) for size in (1e-8, 0.8, 4.0, 300.0, 1e5)]
    # next to multiples of π/2, where what is left has few digits
    near = np.arange(-63_000, 63_000, 7) * (np.pi / 2)
    x = np.concatenate([*spread, near, np.nextafter(near, np.inf), np.nextafter(near, -np.inf)])
    with np.errstate(invalid="ignore"):
        for found, exact in zip(batch_sincos(x, portable), (np.sin, np.cos), strict=True):
            expected = exact(x.astype(np.longdouble))
            unit = np.spacing(np.abs(expected.astype(float)))
            assert np.abs((found - expected) / unit).max() < 1.0


@pytest.mark.parametrize("portable", [False, True])
def test_sine_and_cosine_beyond_the_reduction_are_the_librarys(portable):
    x = np.array([1e5 + 1, -3e7, 1e22, 1e300, np.inf, -np.inf, np.nan, 0.5])
    sine, cosine = batch_sincos(x, portable)
    assert list(sine[:4]) == [math.sin(a) for a in x[:4]]
    assert list(cosine[:4]) == [math.cos(a) for a in x[:4]]
    assert np.isnan([sine[4:7], cosine[4:7]]).all()
    assert sine[7] == pytest.approx(math.sin(0.5), rel=1e-15)


@pytest.mark.parametrize("portable", [False, True])
@pytest.mark.parametrize("op", [op for op in Op if op.scalar], ids=lambda op: op.name)
def test_every_operation_is_pythons(op, portable):
    """Twenty rows of three inputs: neither a multiple of eight nor all in the same half."""
    special = [0.0, 1.0, -1.0, 0.5, 2.5, np.inf, -np.inf, np.nan]
    random = np.random.default_rng(int(op))
    rows = np.concatenate([random.choice(special, (8, 3)), random.normal(size=(12, 3))])
    if op in (Op.AND, Op.OR, Op.NOT):
        rows = (rows > 0).astype(float)  # truth is 0 or 1
    tape = Tape(
        3, (), ((int(op), 3, 0, 1 if ARITY[op] > 1 else 0, 2 if ARITY[op] > 2 else 0),), (3,)
    )
    table = BatchTable(assemble(tape), 3, 0, PORTABLE if portable else KERNEL)
    found = table(rows[None], np.empty((1, 0)))[0, 0]
    expected = np.array([ScalarTape(tape)(row.tolist())[0] for row in rows])
    if op in (Op.SIN, Op.COS):
        np.testing.assert_allclose(found, expected, rtol=3e-16)
    else:
        np.testing.assert_array_equal(found, expected)


def test_a_tape_over_samples_has_the_parameters_of_each_run():
    # sin(p x) + y, twice, for inputs x, y, (unused) z of a row, and the parameter p
    code = ((Op.MUL, 3, 0, 2, 0), (Op.SIN, 4, 3, 0, 0), (Op.ADD, 5, 4, 1, 0))
    tape = Tape(3, (), tuple((int(a), *b) for a, *b in code), (5, 1), parameters=1)
    samples = np.random.default_rng(0).normal(size=(3, 21, 4))
    found = SampleTape(tape)(samples, np.array([[1.0], [2.0], [-3.0]]))
    assert found.shape == (3, 2, 21)
    for run, p in enumerate([1.0, 2.0, -3.0]):
        expected = run_arrays(tape, [samples[run, :, 0], samples[run, :, 1], p], 21)
        np.testing.assert_allclose(found[run], expected, rtol=1e-15, atol=1e-15)
    assert SampleTape(tape)(samples[:, :0], np.zeros((3, 1))).shape == (3, 2, 0)


# runs


@pytest.mark.parametrize("name", every_model(smooth=True))
def test_equals_single_runs_on_every_shipped_model(name, core_statuses):
    model = lagcli.load(name)
    end = 0.1 * model.settings.t_end
    runs = Runs(model, t_end=end, samples=21, rtol=1e-11, atol=1e-12)
    [(found, run)] = runs()
    lanes = [] if model.inputs else [2]  # whose knots are passed one by one
    assert core_statuses() == lanes, "the run did not stay in its lane"
    expected, single = runs.single(0)
    assert (run.status, run.methods) == (single.status, ("DOP853",))
    np.testing.assert_array_equal(found[:, 0], expected[:, 0])
    nq, nc = len(runs.system.coordinates), len(runs.system.constraints)
    for first, count in ((1, nq), (1 + nq, nq), (1 + 2 * nq, nq), (1 + 3 * nq, nc)):
        one, other = found[:, first : first + count], expected[:, first : first + count]
        size = np.abs(other).max(initial=0.0)
        # 1e-11 per step, over some hundred steps, and once more in λ and a
        np.testing.assert_allclose(one, other, rtol=0, atol=3e-8 * (size + 1e-3))
    residuals = _residuals(runs, found)
    assert max(x.max(initial=0.0) for x in residuals) <= 1e-12


def _residuals(runs, rows):
    """Return φ, ψ and M a − f − Bᵀλ of samples, over the sizes of their terms."""
    from lagcli.simulations.derived import DerivedColumns

    columns = DerivedColumns(runs.system, tuple(runs.parameters[0].tolist()))
    samples = columns(Block.of_rows(rows, runs.system.sample_layout))
    return (
        np.nan_to_num(np.abs(samples.residual_position) / columns.scale_position),
        np.abs(samples.residual_velocity) / columns.scale_velocity,
        samples.residual_equation
        / (1e-3 + np.abs(samples.a).max() + np.abs(samples.energy_total).max()),
    )


def test_constraints_whose_terms_vanish_stay_in_the_lanes(core_statuses):
    """A door about the frame's axis: the orientation's two constraints are zero term by term."""
    path = MODELS[0].parents[1] / "tests" / "found" / "door_one_hinge.yaml"
    # by 0.95 s the second has left the lanes
    options = {"t_end": 0.9, "samples": 11}
    runs = Runs(lagcli.load(path), ["gx"], [[1.7], [2.0], [0.5]], **options)
    found = runs()
    assert core_statuses() == [2] * 3
    for row in range(3):
        expected, _ = runs.single(row)
        np.testing.assert_allclose(found[row][0], expected, rtol=0, atol=1e-6)
        position, velocity, _ = _residuals(runs, found[row][0])
        assert max(position.max(), velocity.max()) <= 1e-12


def slider_cranks(count=30, **options):
    """Slider-cranks that turn and swing and differ in everything, and in how long they take."""
    random = np.random.default_rng(7)
    table = np.column_stack(
        [
            random.uniform(0.5, 2.0, count),
            random.uniform(0.05, 0.15, count),
            random.uniform(0.2, 0.4, count),
            random.uniform(0.0, 0.1, count),
            random.uniform(0.0, 1.0, count),
        ]
    )
    options = {"t_end": 2.0, "samples": 101, "rtol": 1e-8, "atol": 1e-9, **options}
    return Runs(
        lagcli.load(MODELS[NAMES.index("slider_crank")]),
        ["m", "r", "l", "tau", "c"],
        table,
        **options,
    )


def test_lanes_are_refilled_and_each_run_is_its_own(core_statuses):
    runs = slider_cranks()
    found = runs()
    assert core_statuses() == [2] * 30
    lengths = {run.steps for _, run in found}
    assert max(lengths) > 1.5 * min(lengths)
    for row in range(0, 30, 3):
        expected, single = runs.single(row)
        samples, run = found[row]
        assert run.status == single.status == "completed"
        assert abs(run.steps - single.steps) < 0.1 * single.steps
        size = np.abs(expected).max(axis=0)
        np.testing.assert_allclose(samples, expected, rtol=0, atol=1e-5 * size.max())


@pytest.mark.parametrize("samples", [1, 2, 70, 801])
def test_what_a_run_gives_does_not_depend_on_its_company(samples):
    runs = slider_cranks(20, samples=samples)
    together = runs()
    for rows in ([3], [17, 5], [11, 0, 19, 2, 7, 12, 9, 3, 4, 18]):
        apart = runs.at(*rows)()
        for row, (one, run) in zip(rows, apart, strict=True):
            np.testing.assert_array_equal(one, together[row][0])
            assert run == together[row][1] or vars(run) == vars(together[row][1])


def test_every_instruction_set_gives_the_same(monkeypatch):
    runs = slider_cranks(10)
    found = runs()
    original = batch.BatchIntegrator
    monkeypatch.setattr(batch, "BatchIntegrator", lambda *arguments: original(*arguments, PORTABLE))
    for (one, _), (other, _) in zip(found, runs(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_many_runs_go_through_few_slots(monkeypatch):
    runs = slider_cranks(30, samples=11)
    monkeypatch.setattr("lagcli.engine.integrate.batch._HELD", 1)
    assert [run.status for _, run in runs()] == ["completed"] * 30


@pytest.mark.parametrize(
    "changes",
    [
        {"t_start": 0.7, "t_end": 1.2, "samples": 5},
        {"t_end": 1.0, "times": (0.1, 0.4, 0.40001, 0.9)},
        {"t_end": 0.5, "samples": 3, "max_step": 0.004},
    ],
    ids=["t_start", "times", "max_step"],
)
def test_settings_apply(changes):
    runs = Runs(lagcli.load(MODELS[NAMES.index("driven_slider_crank")]), rtol=1e-10, **changes)
    [(found, run)] = runs()
    expected, single = runs.single(0)
    # vectors and single numbers round differently, and so do step sizes
    assert abs(run.steps - single.steps) <= 1
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * np.abs(expected).max())


def test_runs_without_samples_are_done():
    assert [(len(x), run.status) for x, run in slider_cranks(3)(times=np.empty(0))] == [
        (0, "completed")
    ] * 3


def test_no_runs_are_none():
    runs = slider_cranks(1).at()
    assert runs() == []


def test_programs_of_another_run_change_nothing():
    runs = slider_cranks(4)
    for row in range(4):
        expected, one = runs.single(row)
        found, other = runs.single(row, kept=True)
        np.testing.assert_array_equal(other.tolerances, one.tolerances)
        assert vars(other) | {"tolerances": None} == vars(one) | {"tolerances": None}
        np.testing.assert_array_equal(found, expected)


# what leaves the lanes


def left_alone(runs, leaving, core_statuses, **changes):
    """Check that these runs, and no others, leave, and end as single ones; return the records."""
    found = runs(**changes)
    assert [
        row for row, status in enumerate(core_statuses()) if status == LaneStatus.LEFT
    ] == leaving
    for row in leaving:
        expected, single = runs.single(row, **changes)
        samples, run = found[row]
        assert (run.status, run.message) == (single.status, single.message)
        np.testing.assert_array_equal(samples, expected)
    return [run for _, run in found]


def test_a_singular_configuration_leaves(core_statuses):
    """A slider-crank with r = l lies flat at φ = π/2, where B vanishes."""
    model = lagcli.load(MODELS[NAMES.index("slider_crank")])
    table = [[0.3], [0.1], [0.25], [0.1 + 1e-12], [0.2]]
    runs = Runs(model, ["l"], table, t_end=1.0, samples=11)
    records = left_alone(runs, [1, 3], core_statuses)
    assert "singular" in records[1].message
    assert [r.status for r in records] == [
        *("completed", "failed", "completed", "failed", "completed")
    ]


def test_no_lane_passes_a_singular_configuration_unseen():
    """Constraints that lose rank at the time s, or never."""
    for seed in range(4):
        text, _ = losing_rank(np.random.default_rng(seed))
        times = np.random.default_rng(seed).uniform(0.2, 0.9, 6)
        table = [*([0, s] for s in times), [1.3, 0.5], [1.3, 0.2]]
        runs = Runs(lagcli.load_text(text), ["o", "s"], table, t_end=1.0, samples=2)
        records = [run for _, run in runs()]
        for singular, record in zip(times, records, strict=False):
            assert stated_time(record.message) == pytest.approx(singular, abs=5e-3)
        assert [record.status for record in records[6:]] == ["completed", "completed"]


def test_undefined_values_leave(core_statuses):
    model = lagcli.load_text("""
parameters: {k: 1}
coordinates: [x]
T: x'^2/2
V: -k*sqrt(1 - x)
initial: {x: 0, x': 0.5}
""")
    runs = Runs(model, ["k"], [[0.001], [1.0], [0.002]], t_end=2.5, samples=7)
    records = left_alone(runs, [0, 2], core_statuses)
    assert "no finite value" in records[0].message
    assert records[0].undefined is not None


def test_stiff_runs_leave(core_statuses):
    model = lagcli.load_text("""
parameters: {c: 1}
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: x^2/2
Q: {x: -c*(x' - cos(t)), y: -y'}
initial: {x: 1, x': 0, y: 0, y': 1}
""")
    runs = Runs(model, ["c"], [[1.0], [1e6], [2.0]], t_end=10.0, samples=5, rtol=1e-5)
    records = left_alone(runs, [1], core_statuses)
    assert "stiff" in records[1].message
    assert "DOP853" in records[0].methods


def test_runs_of_too_many_steps_leave(core_statuses):
    model = lagcli.load_text(PENDULUM)
    runs = Runs(model, ["g"], [[1.0], [500.0]], t_end=3.0, samples=5)
    steps = [runs.single(row)[1].steps for row in (0, 1)]
    records = left_alone(runs, [1], core_statuses, max_steps=sum(steps) // 2)
    assert "--max-steps" in records[1].message


def test_runs_of_too_much_time_leave(core_statuses):
    model = lagcli.load_text(PENDULUM)
    runs = Runs(model, ["g"], [[9.81]], t_end=1e4, samples=5)
    began = time.process_time()
    [(_, run)] = runs(timeout=0.05)
    assert run.status == "failed"
    assert "--timeout" in run.message
    assert time.process_time() - began < 5
    assert core_statuses() == [LaneStatus.LEFT]


def test_an_elimination_that_does_not_suit_leaves(core_statuses):
    """An order that begins with what has next to no inertia in one of the runs."""
    from lagcli.engine.integrate.prepared import prepare as prepared_with
    from lagcli.engine.linear.elimination import Elimination

    model = lagcli.load_text("""
parameters: {e: 1}
coordinates: [z, x]
T: (x'^2 + e*z'^2)/2
V: 9.81*z
constraints: {rod: x^2 + z^2 = 1}
initial: {x: 0.6, z: -0.8, x': 0, z': 0}
""")
    runs = Runs(model, ["e"], [[1.0], [1e-14], [0.5]], t_end=1.0, samples=5)
    order = Elimination((0, 1, 2), (False,) * 3, ((1, 2), (2,), ()), 1.0)
    prepared = prepared_with(runs.system, order)
    records = left_alone(runs, [1], core_statuses, prepared=prepared)
    assert records[1].status == "completed"


def test_runs_of_another_rank_run_one_by_one():
    """The order of elimination leaves out as many rows as the representative run may do without."""
    runs = Runs(lagcli.load(MODELS[NAMES.index("parallelogram")]), t_end=0.1, samples=3)
    assert suits_batch(runs.system, runs.request)
    runs.request = runs.request._replace(rank=4)
    assert not suits_batch(runs.system, runs.request)


def test_runs_whose_steps_end_at_kinks_run_one_by_one():
    """Lanes step over kinks: at the same tolerance their errors were a hundred times as large."""
    runs = Runs(
        lagcli.load_text("""
parameters: {k: 1, K: 10, A: 1.3}
coordinates: [x]
T: x'^2/2
V: k*x^2/2
Q: {x: "-K*max(x, 0) + A*cos(1.1*t)"}
initial: {x: 1, x': 0}
"""),
        ["A"],
        [[1.0], [1.3], [1.6]],
        t_end=20.0,
        samples=11,
        rtol=1e-6,
    )
    assert not suits_batch(runs.system, runs.request)
    for row, (samples, run) in enumerate(runs()):
        np.testing.assert_array_equal(samples, runs.single(row)[0])
        assert run.kinks > 5


@pytest.mark.parametrize(
    "changes",
    [
        {"prepared": None},
        {"method": "Radau"},
        {"formulation": "baumgarte"},
        {"times": np.linspace(0.0, 1.0, 1_000_000)},
    ],
    ids=lambda x: next(iter(x)),
)
def test_what_has_no_lanes(changes):
    runs = slider_cranks(1)
    assert suits_batch(runs.system, runs.request)
    assert not suits_batch(runs.system, changed(runs.request, **changes))


@pytest.mark.parametrize("leaving", [False, True])
def test_an_interrupt_acts_immediately(leaving):
    simulation = prepare(lagcli.load_text(PENDULUM), SettingsOverrides(t_end=1e5, samples=2))
    system, request = simulation.system, simulation.request
    if not leaving:
        short = changed(request, t_end=1.0, times=np.array([1.0]))
        request = request._replace(prepared=prepare_batch(system, short))
    calls = []

    def check_cancelled():
        calls.append(time.process_time())
        if len(calls) > 5:
            raise Interrupted

    values = np.tile(request.state.p, (9, 1))
    q, v = np.tile(request.state.q, (9, 1)), np.tile(request.state.v, (9, 1))
    with pytest.raises(Interrupted):
        run_batch(system, request, values, q, v, lambda finished: None, check_cancelled)
    assert np.diff(calls).max() < 0.5


def test_a_run_whose_dense_output_strays_leaves(core_statuses):
    """Its samples are those of a single run; the others stay in their lanes."""
    path = Path(__file__).parents[3] / "found" / "straying_samples.yaml"
    text = path.read_text().replace("1.972", "k").replace("\nT:", "\nparameters: {k: 1}\nT:")
    # without a kink, which has no lanes
    text = text.replace("max(0, x' + 0.105)^2", "(x' + 0.105 + sqrt((x' + 0.105)^2 + 1e-4))^2/4")
    factors = [[0.1], [1.972], [0.12]]
    runs = Runs(lagcli.load_text(text), ["k"], factors, method="DOP853")
    left_alone(runs, [1], core_statuses)
