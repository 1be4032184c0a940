"""Contacts and events at the start of a run."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.equations.derivation.lagrange import derive
from lagcli.errors import ModelError, UsageError
from lagcli.model.loader import load_text
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.contacts import check_clocks, true_at_start
from lagcli.simulations.partition import partition
from lagcli.simulations.simulation import prepare

BALL = """
coordinates: {x: m, y: m}
parameters: {m: 1, mu: 0.3, e: 0.5, r: 0.1}
T: m/2*(x'^2 + y'^2)
V: m*9.81*y
constraints:
  floor: {expr: y >= r, restitution: e, friction: mu, slip: x'}
  rod: x = 2*y
events:
  there: {when: y <= 1, stop: true}
  later: {when: t >= 2, stop: true}
  turn: {when: y' = 0, record: true}
initial: {x: {guess: 0.3}, y: 0.5, x': {guess: 0}, y': 0}
"""


def test_open_contacts_do_not_constrain() -> None:
    start = prepare(lagcli.load_text(BALL)).start
    assert start.state.q.tolist() == pytest.approx([1.0, 0.5])
    assert start.rank == 1


def test_the_setting_says_below_which_gap_a_contact_is_closed() -> None:
    text = (
        "coordinates: [x, y]\nT: x'^2 + y'^2\nV: y\nconstraints: {floor: y >= 1}\n"
        "initial: {x: 0, y: 1.0001, x': 1, y': 0}\n"
    )
    wide = text + "simulation: {closed: 1.0e-3}\n"
    assert prepare(lagcli.load_text(text)).freedom.held == ()
    assert prepare(lagcli.load_text(text), SettingsOverrides(closed=1e-3)).freedom.held == (
        "floor",
    )
    assert prepare(lagcli.load_text(wide)).freedom.held == ("floor",)
    assert prepare(lagcli.load_text(wide), SettingsOverrides(closed=1e-9)).freedom.held == ()
    assert lagcli.check(lagcli.load_text(wide)).rank.freedom.held == ("floor",)
    below = wide.replace("1.0001", "0.9999")
    assert lagcli.check(lagcli.load_text(below)).rank.freedom.held == ("floor",)


def test_only_a_constraint_may_be_declared_closed() -> None:
    for name, remedy in (("floor1", "did you mean `floor`?"), ("b", "the contacts are: `floor`")):
        text = BALL.replace("initial: {", f"initial: {{{name}: closed, ")
        with pytest.raises(ModelError) as found:
            lagcli.load_text(text)
        (one,) = found.value.diagnostics
        assert one.message == f"`initial` says that `{name}` is closed, which is not a contact"
        assert remedy in (one.help or "")


def test_a_contact_is_closed_if_the_file_declares_it() -> None:
    text = BALL.replace("y: 0.5", "y: {guess: 0.5}").replace("y': 0", "y': {guess: -1}")
    closed = text.replace("initial: {", "initial: {floor: closed, ")
    state = prepare(lagcli.load_text(closed)).start.state
    assert state.q.tolist() == pytest.approx([0.2, 0.1])
    assert state.v.tolist() == pytest.approx([0.0, 0.0])


def test_a_violated_contact_reports_by_how_much() -> None:
    with pytest.raises(ModelError, match=r"`floor` is violated by 0.012 m at the start \(y >= r\)"):
        prepare(lagcli.load_text(BALL.replace("y: 0.5", "y: 0.088")))


def test_values_of_other_parameters_are_checked() -> None:
    model = lagcli.load_text(BALL.replace("restitution: e", "restitution: e*cos(x - 1)"))
    prepare(model)
    for value in (-0.5, 1.5):
        with pytest.raises(ModelError, match="`restitution` of constraint `floor` is"):
            prepare(lagcli.load_text(model.text, set={"e": value}))


def test_conditions_that_hold_at_the_start_are_named() -> None:
    simulation = prepare(lagcli.load_text(BALL))
    (note,) = true_at_start(simulation.system, simulation.start.state)
    assert note.startswith("the condition of event `there` holds at the start")


def test_independent_coordinates_reject_contacts() -> None:
    with pytest.raises(UsageError, match="need constraints that hold at all times, but `floor`"):
        partition(derive(lagcli.load_text(BALL)))


def test_conserved_quantities_are_those_of_all_modes() -> None:
    # a body on a rough floor: only what friction and impacts leave is monitored
    text = """
coordinates: [x, y, z]
T: (x'^2 + y'^2 + z'^2)/2
V: 9.81*y
constraints: {floor: {expr: y >= 0, friction: 0.3, slip: x'}}
initial: {x: 0, y: 1, z: 0, x': 1, y': 0, z': 1}
"""
    assert list(prepare(lagcli.load_text(text)).monitor.formulas) == ["p_z"]
    smooth = text.replace(", friction: 0.3, slip: x'", "")
    assert {"p_x", "p_z"} <= set(prepare(lagcli.load_text(smooth)).monitor.formulas)
    kicked = smooth + "events: {kick: {when: t >= 1, impulse: {z: 1}}}\n"
    assert not prepare(lagcli.load_text(kicked)).monitor.formulas


def test_an_impact_at_the_start_that_is_rejected_leaves_no_samples() -> None:
    """Kane and Levinson's double pendulum, which strikes as it starts."""
    model = lagcli.load_text("""
coordinates: [a, b]
definitions: {y: cos(20 deg) + cos(30 deg) - cos(a) - cos(b)}
T: (4/3*a'^2 + 1/3*b'^2 + cos(a - b)*a'*b')/2
constraints:
  floor: {expr: y >= 0, restitution: 0.7, friction: 0.5, slip: a'*cos(a) + b'*cos(b)}
initial: {a: 20 deg, b: 30 deg, a': -0.1, b': -0.2}
""")
    found = lagcli.simulate(model, impacts="newton", t_end=0.1)
    assert found.status == "failed"
    assert "an impact at `floor` would gain 0.04074 J" in found.message
    assert len(found.time) == 0
    assert found.events is not None
    assert found.events.names == ()


STACK = """
coordinates: [x, y, X, Y]
T: (x'^2 + y'^2)/2 + X'^2 + Y'^2
V: 9.81*(y + 2*Y)
Q: {X: 8*sin(10*t)}
constraints:
  lo: {expr: Y >= 0, restitution: 0.3, friction: 0.2, slip: X'}
  up: {expr: y - Y >= 0.5, restitution: 0.3, friction: 0.2, slip: x' - X'}
initial: {x: 0, y: 0.7, X: 0, Y: 0.1, x': 0.1, y': 0, X': 0, Y': 0}
"""
ROCKING = """
coordinates: [y, p]
T: (y'^2 + 0.1*p'^2)/2
V: 9.81*y
constraints: {a: {expr: y - sin(p) >= 0, restitution: 0.3}, b: y + sin(p) >= 0}
initial: {y: 1, p: 0.2, y': 0, p': 0}
"""


@pytest.mark.parametrize("text", [STACK, ROCKING])
def test_every_sample_of_a_run_is_a_start(text: str) -> None:
    # 370 of 3600 samples of 90 models were refused: gaps to -1e-17 whose terms vanish, too
    run = lagcli.simulate(lagcli.load_text(text), t_end=2, samples=41)
    names = run.coordinates
    for time, q, v in zip(run.time, run.q, run.v, strict=True):
        values = {name: repr(float(x)) for name, x in zip(names, q, strict=True)}
        values |= {f"{name}'": repr(float(x)) for name, x in zip(names, v, strict=True)}
        prepare(lagcli.load_text(text, set_initial=values), SettingsOverrides(t_start=float(time)))
    last = lagcli.load_text(text, set_initial=values)
    again = lagcli.simulate(last, t_start=2.0, t_end=3.0, samples=3)
    whole = lagcli.simulate(lagcli.load_text(text), t_end=3.0, samples=7)
    assert again.q[-1] == pytest.approx(whole.q[-1], abs=1e-7)


@pytest.mark.parametrize("gap", ["-5e-324", "-1e-30", "-1e-14"])
def test_a_gap_of_rounding_is_no_violation_where_its_terms_vanish(gap: str) -> None:
    values = {"Y": gap, "y": "0.5", "Y'": "0", "y'": "0"}
    run = lagcli.simulate(lagcli.load_text(STACK, set_initial=values), t_end=1)
    assert run.status == "completed"
    assert run.q[:, 3] == pytest.approx(0, abs=1e-12)
    with pytest.raises(ModelError, match="violated by 1e-09"):
        prepare(lagcli.load_text(STACK, set_initial=values | {"Y": "-1e-9"}))


TEXT = """\
coordinates: [x]
parameters: {T: 0.01}
T: x'^2/2
initial: {x: 0, x': 1}
events: {tick: {every: T - 0.02, stop: true}}
"""


def test_a_period_that_is_not_positive() -> None:
    with pytest.raises(ModelError, match=r"<text>:5:24: .* is -0.01 s, but must be positive"):
        prepare(load_text(TEXT))
    simulation = prepare(load_text(TEXT, set={"T": 1.0}))
    check_clocks(simulation.model, simulation.system, simulation.settings)


def test_a_period_below_rounding_errors() -> None:
    text = TEXT.replace("T - 0.02", "T/1e6")
    with pytest.raises(ModelError, match="below the rounding errors of times near 1e\\+09 s"):
        prepare(load_text(text), SettingsOverrides(t_start=1e9, t_end=1e9 + 1))


@pytest.mark.parametrize(
    ("friction", "ambiguous"),
    [
        ("lambda.a", "`lambda.a`, which is not unique"),
        ("(lambda.a + lambda.b)", "`lambda.a`, `lambda.b`, which are not unique"),
        ("(lambda.a + 2*lambda.b)", ""),  # the force of both, which is unique
        ("1", ""),
    ],
)
def test_forces_that_depend_on_the_share_of_redundant_constraints(
    friction: str, ambiguous: str
) -> None:
    """The motion differs by the way in which one and the same guide is written."""
    text = f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 10*y
Q: {{x: -0.2*{friction}*tanh(x')}}
constraints: {{a: y = 0, b: 2*y = 0}}
initial: {{x: 0, x': 0, y: 0, y': 0}}
"""
    run = lagcli.simulate(lagcli.load_text(text), t_end=0.1, samples=2)
    assert len(run.warnings) == bool(ambiguous)
    assert ambiguous in "".join(run.warnings)
