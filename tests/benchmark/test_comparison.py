"""The comparison of `make bench`, on what is installed here: models, measuring, page."""

from __future__ import annotations

import math
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from comparison import models, ported, ported_cases, table
from comparison.cases import CASES, chain
from comparison.deriving import Derivation, growth
from comparison.kinetics import solve_symmetric
from comparison.measure import Effort, Point, Result, Worker, _timed, measure
from comparison.peers import METHODS, by_tape
from comparison.peers.ours import DEFAULT
from comparison.process import WholeProcess
from comparison.reference import reference
from comparison.symbols import SymbolicCase
from comparison.verdicts import faster, judge
from random_cases import some

import lagcli
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.lowering.lower import lower
from lagcli.settings.methods import METHOD_NAMES
from lagcli.simulations import simulation

BY_TITLE = {method.title: method for method in METHODS}
OURS, BY_HAND = BY_TITLE["lagcli DOP853"], BY_TITLE["lambdify + solve_ivp DOP853"]
CHEAP = ["pendulum", "slider_crank", "andrews", "chain_5", "stiff_chain_1e6"]


def result(program: str, *points: tuple[float, float], name: str = "") -> Result:
    """Return a Result of (error, seconds) points."""
    made = [Point(error, error, error, [seconds]) for error, seconds in points]
    return Result(program, name, "rtol", 0.0, made)


@pytest.mark.parametrize("name", some(CHEAP, 2))
def test_the_others_get_the_same_equations(name: str) -> None:
    """M, f, B and γ of the geometry, at a random state: those of the model that lagcli reads."""
    import sympy as sp

    case = CASES[name]
    model = case.load()
    system = lower(lagcli.derive(model))
    start, rng = case.start, np.random.default_rng(0)
    q = start.q + 0.1 * rng.standard_normal(len(start.q))
    v = rng.standard_normal(len(q))
    symbolic = SymbolicCase(case)
    kinetics = symbolic.kinetics
    ours = Evaluator(system, tuple(model.parameter_values.values())).dynamics(0.0, q, v)

    def numbers(expressions: list) -> np.ndarray:
        evaluate = sp.lambdify([symbolic.states], [sp.sympify(x) for x in expressions])
        return np.array(evaluate([*q, *v]), dtype=float)

    mass, jacobian = np.zeros_like(ours.mass_matrix), np.zeros_like(ours.jacobian)
    for matrix, entries in ((mass, kinetics.mass), (jacobian, kinetics.jacobian)):
        matrix[tuple(np.array(list(entries)).T)] = numbers(list(entries.values()))
    # rounding of sums of a few dozen terms
    scale = np.abs(ours.forcing).max()
    np.testing.assert_allclose(mass, ours.mass_matrix, rtol=1e-11, atol=1e-14)
    np.testing.assert_allclose(jacobian, ours.jacobian, rtol=1e-11, atol=1e-14)
    np.testing.assert_allclose(
        numbers(kinetics.forcing), ours.forcing, rtol=1e-11, atol=1e-12 * scale
    )
    np.testing.assert_allclose(numbers(kinetics.rhs), ours.rhs, rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("n", [2, 3, 9])
def test_elimination_solves(n: int) -> None:
    rng = np.random.default_rng(n)
    dense = rng.standard_normal((n, n))
    dense = dense @ dense.T + np.eye(n)
    dense[0, n - 1] = dense[n - 1, 0] = 0.0  # left out, and filled in on the way
    entries = {(i, j): x for (i, j), x in np.ndenumerate(dense) if x}
    rhs = rng.standard_normal(n)
    np.testing.assert_allclose(
        solve_symmetric(entries, list(rhs)), np.linalg.solve(dense, rhs), rtol=1e-9
    )


def test_time_at_an_error_is_interpolated_in_log_log() -> None:
    measured = result("x", (1e-4, 1.0), (1e-8, 100.0))
    assert measured.seconds_at(1e-6) == pytest.approx(10.0)
    assert measured.seconds_at(1e-3) == 1.0
    assert measured.seconds_at(1e-9) is None
    assert result("x", (1e-8, 5.0), (1e-7, 7.0)).seconds_at(1e-6) == 5.0


def test_verdicts_say_what_is_missed() -> None:
    ours, slow = result("lagcli", (1e-10, 1.0)), result("CasADi", (1e-10, 3.0), name="IDAS")
    cases = ("pendulum",)
    met = faster({"pendulum": [ours, slow]}, cases, "CasADi", 2, "2 times faster")
    assert met.met
    assert met.measured == "pendulum: 3"
    missed = faster({"pendulum": [ours, slow]}, cases, "CasADi", 4, "4 times faster")
    assert missed.met is False
    assert "✗" in missed.measured
    assert faster({"pendulum": [ours]}, cases, "CasADi", 4, "4 times faster").met is None
    # an error that lagcli alone does not reach counts against it
    rough = result("lagcli", (1e-3, 1.0))
    assert faster({"pendulum": [rough, slow]}, cases, "CasADi", 4, "").met is False


@pytest.mark.slow
def test_a_small_comparison_from_measurement_to_page() -> None:
    case = CASES["pendulum"]
    exact = reference(case)
    assert float(exact.source.split()[-1]) < 1e-9
    results = measure(case, [OURS, BY_HAND], exact.positions, Effort(total=60.0, rounds=1))
    for measured in results:
        assert measured.points, measured.note
        assert measured.best_error < 1e-6
        errors = [p.error for p in measured.points]
        assert errors == sorted(errors, reverse=True)  # tighter tolerances, smaller errors
        assert all(s > 0 for p in measured.points for s in p.seconds)
    report = table.Report("today", "a processor", "a system", {"lagcli": "1", "casadi": None})
    report.titles, report.spans = {"pendulum": case.title}, {"pendulum": case.t_end}
    report.references, report.results = {"pendulum": exact.source}, {"pendulum": results}
    report.growth = growth(lengths=(2, 3))
    report.derivation, report.process = Derivation(0.01, 5.0), WholeProcess(0.25, 0.1)
    page = table.render(report)
    for text in (case.title, BY_HAND.title, "casadi", "| 3 |", "**not met**"):
        assert text in page
    verdicts = {v.target: v for v in judge({}, report.derivation, [], report.process)}
    assert [v.met for v in verdicts.values() if v.met is not None] == [True, False]


def test_a_worker_that_hangs_or_fails_costs_its_own_result() -> None:
    case = CASES["pendulum"]
    worker = Worker(BY_HAND, case)
    worker.process.kill()
    with pytest.raises(Exception, match="process ended"):
        worker.ask("prepare", 1e-6, timeout=10)
    worker.close()
    absent = BY_TITLE["CasADi IDAS"]
    reference_ = np.zeros((101, 2))
    if not _installed("casadi"):
        (failed,) = measure(case, [absent], reference_, Effort(rounds=1))
        assert "casadi" in failed.note
        assert math.isnan(failed.setup)
    (late,) = measure(case, [BY_HAND], reference_, Effort(prepare=0.01, rounds=1))
    assert late.note == "no result within 0.01 s"


def _installed(package: str) -> bool:
    from comparison.machine import installed

    return installed(package) is not None


def test_models_that_are_not_shipped_are_models() -> None:
    model = lagcli.load_text(models.pendulum_of_links(3))
    assert len(model.coordinates) == 3
    assert len(chain(7, 1.0).load().constraints) == 7
    stiff = CASES["stiff_chain_1e8"].load()
    assert len(stiff.constraints) == 5
    assert stiff.parameter_values["c"] == 1e5


@pytest.mark.parametrize("name", ["heavy_top", "bennett", "condenser_microphone"])
def test_peers_of_ported_models_are_given_their_accelerations(name: str) -> None:
    """At a state beside the start; without the redundant rows, those of B⁺ in place of B⁻¹."""
    case = ported_cases.CASES[name]
    equations = case.equations
    prepared = simulation.prepare(case.load(), case.settings())
    system, state = prepared.system, prepared.start.state
    at = Evaluator(system, state.p).dynamics(0.0, state.q, state.v)
    nq, nc = at.mass_matrix.shape[0], at.jacobian.shape[0]
    matrix = np.block([[at.mass_matrix, at.jacobian.T], [at.jacobian, np.zeros((nc, nc))]])
    scale = 1.0 / np.sqrt(np.abs(matrix).max(axis=0))
    right = np.concatenate([at.forcing, at.rhs])
    solution = scale * np.linalg.lstsq(scale[:, None] * matrix * scale, scale * right)[0]
    a = equations.accelerations(0.0, equations.start.tolist(), lambda op, x: op.scalar(*x))
    # the conditions of these matrices are below 1e4
    np.testing.assert_allclose(
        a, solution[:nq], rtol=1e-10, atol=1e-11 * np.abs(solution[:nq]).max()
    )


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
def test_dop853_in_c_follows_the_motion() -> None:
    case = ported_cases.CASES["heavy_top"]
    exact = lagcli.simulate(case.load(), case.settings(rtol=1e-13)).q
    solver = by_tape.Compiled(case)
    errors = [np.abs(solver.positions(solver.at(x)()) - exact).max() for x in (1e-6, 1e-9, 1e-12)]
    assert errors[0] < 1e-3
    assert errors[1] < 1e-2 * errors[0]
    assert errors[2] < 1e-9


@pytest.mark.slow
def test_the_default_run_is_timed_apart_from_what_it_prepares() -> None:
    case = ported_cases.CASES["condenser_microphone"]
    (rtol,) = DEFAULT.settings(case)
    solver = DEFAULT.prepare(case)
    run = solver.at(rtol)
    seconds, result = _timed(run)
    assert np.abs(solver.positions(result)).max() > 0
    assert run.before > 0
    assert run.within > 0  # power series
    assert seconds > 0


def test_auto_is_compared_with_each_method(monkeypatch: pytest.MonkeyPatch) -> None:
    # a process of tests has much more to collect than that of the benchmark
    monkeypatch.setattr(ported, "gc", SimpleNamespace(collect=lambda: None))
    found = ported.compare_methods(ported_cases.CASES["chaplygin_sleigh"], 1, 1)
    assert set(found) == set(METHOD_NAMES)
    assert all(isinstance(x, float) for x in found.values())


def test_the_section_of_ported_models_is_replaced() -> None:
    assert len(ported_cases.CASES) >= 20
    for case in ported_cases.CASES.values():
        assert case.text
    page = table.render(table.Report("2026", "x", "y", {}))
    peers = [result("lagcli", (1e-8, 0.004), name="default"), result("C", (1e-6, 1e-3))]
    peers[1].points += result("C", (1e-10, 4e-3)).points
    peers[1].setup = 1.0
    methods = {1: {"auto": 0.03, "DOP853": 0.02, "Taylor": "stops"}, 10: {"auto": "stops"}}
    for name in ("before", "now"):
        found = {name: ported.Ported(7, peers, 1e-12, methods, 0.25)}
        page = table.with_section(page, table.ported_section(found, "Here."))
    assert page.count(table.PORTED) == 1
    assert "before" not in page[page.index(table.PORTED) :]
    # between 1 ms and 4 ms in log-log
    assert "| now | 7 | 1.0e-08 | 1e-12 | 4 ms | 2 ms | – | – | – | 2.00 | 30 ms |" in page
    assert "| now | 30 ms | 20 ms (DOP853) | 1.50 | stops | – | – |" in page
    for text, met in (
        ("median 1.5 | 2.00, of 1 models", False),
        ("at most 3 | worst 2.00 (now)", True),
        ("below 1 | worst 0.03 (now)", True),
        ("at most 1.2 | median 1.50; worst 1.50 (now); missed by now 1.50", False),
    ):
        assert f"{text} | {'met' if met else '**not met**'} |" in page
    assert page.count("## How each program is used") == 1
    assert page.index(table.PORTED) < page.index("## How each program is used")


@pytest.mark.slow
def test_contacts_and_events_are_measured_beside_what_they_replace() -> None:
    from comparison import contacts

    ball = contacts.bouncing_ball(1, bounces=20)
    assert ball.ratio > 1  # of some hundred
    assert "times faster" in ball.goal
    spring = contacts.kinks("bilinear spring, 2 s", contacts.BILINEAR, 1.0)
    assert spring.met
    assert spring.theirs > spring.ours > 0
    with_contact = contacts.idle("pendulum_cartesian", "contact", 1)
    with_event = contacts.idle("pendulum_cartesian", "event", 1)
    assert with_contact.ratio == pytest.approx(with_contact.ours / with_contact.theirs)
    page = table.render(table.Report("2026", "x", "y", {}, contacts=[ball, spring, with_event]))
    assert page.count(table.CONTACTS) == 1
    assert f"| {spring.ratio:.3g} | fewer | met |" in page
    assert page.index(table.CONTACTS) < page.index("## How each program is used")
