"""Messages to the page of `lagcli play`: the numbers of `simulate`, or errors."""

from __future__ import annotations

import json
import shlex
import struct
import threading
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from patience import PATIENCE, wait_until
from shipped import PATHS, every_model

import lagcli
from lagcli.errors import LagcliError, ModelError, NumericalError, UsageError
from lagcli.model.loader import load, load_text
from lagcli.play.runs import MOST_SAMPLES, Played, PlayRequest, on_page, plot_groups
from lagcli.play.server import Client, encode
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.cancellation import Interruption

MODELS = Path(__file__).parents[3] / "models"
ALL_PLOTS = (
    *("coordinates", "velocities", "accelerations", "multipliers", "constraint forces"),
    *("energies", "powers", "energy balance", "velocity residuals", "outputs"),
)


def play(name: str, **options: Any) -> Played:
    return Played(load(name), SettingsOverrides(**options))


def run(played: Played, plots: tuple[str, ...] = ("coordinates",), **values: Any) -> dict[str, Any]:
    return played.run(PlayRequest(1, plots=plots, **values), Interruption())


def curves(answer: dict[str, Any]) -> dict[str, np.ndarray]:
    return {s["name"]: s["values"] for p in answer["plots"].values() for s in p["series"]}


def test_curves_are_those_of_simulate() -> None:
    played = play("slider_crank")
    values = {"set": {"m": "1.7", "r": "l/4"}, "set_initial": {"phi": "0.25", "psi": "{guess: 0}"}}
    answer = run(played, ALL_PLOTS, **values, t_end="1.5")
    model = load(MODELS / "slider_crank.yaml", **values)
    t = lagcli.simulate(model, t_end=1.5)
    found = curves(answer)
    assert np.array_equal(answer["plots"]["energies"]["time"], t.time)
    for name, expected in {
        "phi": t.q[:, 0],
        "psi_dot": t.v[:, 1],
        "phi_ddot": t.a[:, 0],
        "lambda.guide": t.multipliers[:, 0],
        "Qc.psi": t.constraint_force[:, 1],
        "energy_total": t.energy_total,
        "energy_balance": t.energy_balance,
        "power_applied": t.power_applied,
        "slider": t.outputs["slider"],
        "residual_velocity.guide": t.residual_velocity[:, 0],
    }.items():
        assert np.array_equal(found[name], expected), name
    assert answer["values"]["r"] == 0.3 / 4
    assert answer["start"] == {"psi": t.q[0, 1], "psi'": t.v[0, 1]}
    assert answer["status"] == "completed"
    assert answer["t_end"] == 1.5


@pytest.mark.parametrize("name", every_model())
def test_every_model_can_be_played_with(name: str) -> None:
    played = Played(load(PATHS[name]))
    answer = run(played, tuple(plot_groups(played.model)), t_end="0.01")
    assert answer["status"] == "completed"
    assert answer["scene"]["points"]
    assert answer["values"].keys() == played.controls.keys() - {"t_end"}
    for name, value in answer["values"].items():
        assert value == pytest.approx(played.controls[name].value, rel=1e-14)
    for name, plot in answer["plots"].items():
        assert plot["series"] or "residuals" in name  # of contacts that are open
        assert all(len(s["values"]) == len(plot["time"]) for s in plot["series"])


def test_contacts_and_events_are_listed_and_marked() -> None:
    played = play("bouncing_ball")
    answer = run(played, ("coordinates", "energies"))
    fall = (2 / 9.81) ** 0.5
    first = answer["events"]["entries"][0]
    assert (first["text"], first["time"]) == ("floor has an impact", pytest.approx(fall))
    assert answer["events"]["sentences"][1].startswith("note: `floor` came to rest at t = 4.06")
    assert answer["events"]["more"] == 0
    for plot in answer["plots"].values():
        assert plot["marks"][0] == first["time"]
        assert list(plot["time"]).count(first["time"]) == 2  # before and after
    (flashes,) = (s for s in answer["scene"]["shapes"] if s["kind"] == "flash")
    assert flashes["times"][0] == first["time"]
    # with another coefficient, the second impact is elsewhere
    moved = run(played, set={"e": "0.5"})["events"]["entries"]
    assert moved[0]["time"] == first["time"]
    assert moved[1]["time"] == pytest.approx(2 * fall)
    assert run(play("slider_crank"))["events"] is None


def test_friction_can_be_moved() -> None:
    played = play("block_on_incline")
    assert run(played, set={"mu": "0.1"})["status"] == "completed"
    with pytest.raises(ModelError, match="must not be negative") as raised:
        run(played, set={"mu": "-1"})
    assert len(raised.value.diagnostics) == 1


def test_dependent_values_follow_unless_they_are_moved() -> None:
    played = play("rolling_disk")
    assert run(played, set={"r": "0.6"}, t_end="0.1")["values"]["A"] == 2 * 0.6**2 / 4
    moved = run(played, set={"r": "0.6", "A": "0.2"}, t_end="0.1")["values"]
    assert (moved["r"], moved["A"]) == (0.6, 0.2)


def test_another_number_of_members_brings_other_controls() -> None:
    played = play("chain")
    masses = played.members

    def asked(**given: str) -> dict[str, Any]:
        nonlocal masses
        request = PlayRequest(1, set=given, t_end="0.1", plots=("coordinates",), members=masses)
        answer = played.run(request, Interruption())
        masses = answer.get("members", masses)
        return answer

    few = asked(**{"N": "3", "m[3]": "2"})
    assert [c["name"] for c in few["controls"] if c["family"] == "m"] == ["m[1]", "m[2]", "m[3]"]
    assert "controls" not in asked(**{"N": "3", "m[3]": "4"})
    # of two masses, the third has none
    two = asked(**{"N": "2", "m[3]": "4"})
    assert "m[3]" not in two["command"]
    t = lagcli.simulate(load(MODELS / "chain.yaml", {"N": 2}), t_end=0.1)
    assert np.array_equal(curves(two)["y[2]"], t.q[:, 3])
    # controls come with the first good answer, not with an error
    with pytest.raises(LagcliError):
        asked(N="5", l="nothing")
    assert len([c for c in asked(N="5")["controls"] if c["family"] == "m"]) == 5
    assert len([c for c in asked()["controls"] if c["family"] == "m"]) == 20
    with pytest.raises(UsageError, match="this page goes as far as"):
        asked(N="100000")
    with pytest.raises(UsageError, match="N is a number"):
        asked(N="many")
    assert asked()["status"] == "completed"


def test_what_the_program_was_started_with_stays() -> None:
    model = load(MODELS / "slider_crank.yaml", set={"l": "40 cm"}, set_initial={"phi": "0.1"})
    played = Played(model, SettingsOverrides(t_end=1.0))
    answer = run(played, set={"m": "3"})
    assert (answer["values"]["l"], answer["values"]["phi"], answer["t_end"]) == (40.0, 0.1, 1.0)
    words = shlex.split(answer["command"])
    assert words[3:] == [
        *("--set", "l=40 cm", "--set", "m=3", "--set-initial", "phi=0.1"),
        *("--t-end", "1.0", "-o", "run.h5"),
    ]
    saved = load_text(played.text(PlayRequest(1, {"m": "3"})))
    assert saved.parameters["l"].value == 0.4
    assert saved.settings.t_end == 1.0


@pytest.mark.parametrize("grid", ["samples: 1000001", f"times: {[k / 1000 for k in range(4002)]}"])
def test_long_runs_are_sampled_as_a_page_can_draw_them(grid: str) -> None:
    text = (MODELS / "pendulum_cartesian.yaml").read_text(encoding="utf-8")
    text = text.replace("samples: 1001", grid)
    played = Played(load_text(text.replace("t_end: 10, ", "" if "times" in grid else "t_end: 1, ")))
    time = run(played)["plots"]["coordinates"]["time"]
    assert len(time) == MOST_SAMPLES
    assert time[-1] == (4.001 if "times" in grid else 1)


@pytest.mark.parametrize(
    ("values", "kind", "message"),
    [
        ({"set": {"m": "0"}}, NumericalError, "no inertia"),
        ({"set": {"l": "0.01"}}, ModelError, "violate the constraint `guide`"),
        ({"set": {"m": "nonsense"}}, ModelError, "uses `nonsense`"),
        ({"set": {"m": "2 3"}}, ModelError, "m=2 3: error.syntax"),
        ({"set": {"m": "1/0"}}, ModelError, "division by zero"),
        ({"set": {"q": "1"}}, ModelError, "no parameter `q`"),
        ({"set_initial": {"psi": "0.3"}}, ModelError, "free one of"),
        ({"t_end": "-1"}, UsageError, "t_end"),
        ({"t_end": "soon"}, UsageError, "t_end"),
        ({"t_end": "nan"}, UsageError, "finite"),
    ],
)
def test_wrong_values_are_errors_and_the_next_run_is_right(
    values: dict[str, Any], kind: type[LagcliError], message: str
) -> None:
    played = play("slider_crank")
    with pytest.raises(kind, match=message):
        run(played, **values)
    assert run(played, t_end="0.1")["status"] == "completed"


def test_a_run_that_takes_too_long_gives_what_there_is() -> None:
    answer = run(play("slider_crank", timeout=0.05), t_end="100000")
    assert answer["status"] == "failed"
    assert "stopped after 0.05 s" in answer["message"]
    assert answer["plots"]["coordinates"]["time"][0] == 0


@pytest.mark.parametrize(
    "message",
    [
        {},
        {"number": "1"},
        {"number": 1, "set": ["m"]},
        {"number": 1, "set": {"m": 2}},
        {"number": 1, "set_initial": {"phi": None}},
        {"number": 1, "plots": "energy"},
        {"number": 1, "t_end": 3},
    ],
)
def test_messages_that_are_no_requests_are_rejected(message: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"."):
        PlayRequest.parsed(message)


# frames


def decoded(frame: bytes) -> Any:
    """Read a frame as the page does."""
    (length,) = struct.unpack_from("<I", frame)
    assert (4 + length) % 8 == 0, "Float64Array begins at a multiple of 8 bytes"
    numbers = np.frombuffer(frame, "<f8", offset=4 + length)

    def restored(found: dict[str, Any]) -> Any:
        place = found.get("$array")
        return numbers[place[0] : place[0] + place[1]] if place else found

    return json.loads(frame[4 : 4 + length], object_hook=restored)


@pytest.mark.parametrize("text", ["", "a", "φ̇ in m/s²", "x" * 7])
def test_frames_hold_what_was_put_in(text: str) -> None:
    arrays = [np.array([1.5, np.nan, -0.0, np.inf]), np.empty(0), np.linspace(0, 1, 5)[::2]]
    value = {"text": text, "n": np.float64("nan"), "a": arrays, "b": {"c": (arrays[0], None)}}
    found = decoded(encode(value))
    assert (found["text"], found["n"]) == (text, None)
    for one, other in zip(found["a"], arrays, strict=True):
        assert np.array_equal(one, other, equal_nan=True)
    assert np.array_equal(found["b"]["c"][0], arrays[0], equal_nan=True)


# the thread of a client


class Answers:
    """Collects the messages to a client."""

    def __init__(self, played: Played):
        self.got: list[dict[str, Any]] = []
        self.change = threading.Condition()
        self.client = Client(played, self.take)
        self.client.start()

    def take(self, answer: dict[str, Any]) -> None:
        with self.change:
            self.got.append(answer)
            self.change.notify()

    def wait(self, number: int) -> dict[str, Any]:
        with self.change:
            there = self.change.wait_for(
                lambda: any(a["number"] == number for a in self.got), PATIENCE
            )
        assert there, [a["number"] for a in self.got]
        return next(a for a in self.got if a["number"] == number)


#: The end of a run that nobody waits for.
ENDLESS = "1e9"


def test_the_newest_request_wins_and_a_long_run_makes_room_for_it() -> None:
    answers = Answers(play("slider_crank"))
    answers.client.ask(PlayRequest(1, t_end=ENDLESS))
    wait_until(lambda: answers.client._running)
    with answers.client._change:  # all of them before it looks for the next one
        for number in range(2, 50):
            answers.client.ask(
                PlayRequest(number, {"m": str(number)}, plots=("coordinates",), t_end="0.1")
            )
    assert answers.wait(49)["values"]["m"] == 49
    assert [a["number"] for a in answers.got] == [49]
    answers.client.close()
    answers.client.join(PATIENCE)
    assert not answers.client.is_alive()


def test_a_short_run_is_drawn_even_if_a_newer_one_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lagcli.play.server.GRACE", 600.0)  # a loaded machine takes long for it
    played = play("slider_crank")
    began, go_on = threading.Event(), threading.Event()
    usual = played.run

    def held(request: PlayRequest, interruption: Interruption) -> dict[str, Any]:
        began.set()
        go_on.wait(PATIENCE)
        return usual(request, interruption)

    monkeypatch.setattr(played, "run", held)
    answers = Answers(played)
    answers.client.ask(PlayRequest(1, t_end="0.1"))
    assert began.wait(PATIENCE)
    for number in range(2, 8):
        answers.client.ask(PlayRequest(number, t_end="0.1"))
    go_on.set()
    answers.wait(7)
    assert [a["number"] for a in answers.got] == [1, 7]
    answers.client.close()


def test_closing_ends_a_run_immediately() -> None:
    answers = Answers(play("slider_crank"))
    answers.client.ask(PlayRequest(1, t_end=ENDLESS))
    wait_until(lambda: answers.client._running)
    answers.client.close()
    answers.client.join(PATIENCE)
    assert not answers.client.is_alive()
    assert not answers.got


def test_a_bug_is_reported_and_ends_nothing(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    played = play("slider_crank")
    answers = Answers(played)
    monkeypatch.setattr(played, "_fitting", lambda request: 1 / 0 if request.set else request)
    monkeypatch.setattr(played, "command", lambda request: "")
    answers.client.ask(PlayRequest(1, {"m": "1"}))
    assert "a bug in lagcli: ZeroDivisionError" in answers.wait(1)["error"]
    assert "Traceback" in capsys.readouterr().err
    monkeypatch.undo()
    answers.client.ask(PlayRequest(2, {"m": "2"}, t_end="0.1"))
    assert answers.wait(2)["status"] == "completed"
    answers.client.close()


# drags


def dragged(played: Played, weights: dict[str, float], target: list[float], **more: Any) -> Any:
    message = {
        "number": 2,
        "plots": [],
        "drag": {"gesture": 1, "time": 0, "weights": weights, "target": target, "length": 1} | more,
    }
    return played.run(PlayRequest.parsed(message), Interruption())


@pytest.mark.parametrize("name", every_model())
def test_every_model_can_be_dragged_and_then_runs(name: str) -> None:
    """In the middle of a run too; the values of the page then have the body where it was."""
    played = Played(load(PATHS[name]))
    answer = run(played, t_end="0.1")
    points = played.description()["draggable"]
    assert points or name == "clutch"
    for point in points[:1]:
        place = [float(x[len(x) // 2]) for x in answer["scene"]["points"][point]]
        target = [place[0] + 0.03, place[1] + 0.02, *place[2:]]
        found = dragged(played, {point: 1}, target, time=0.05)
        words = shlex.split(found["command"])[2:]
        given = {
            entry: value
            for option, text in pairwise(words)
            if option == "--set-initial"
            for entry, value in [text.split("=", 1)]
        }
        assert given.keys() >= found["initial"].keys()
        after = run(played, set_initial=given, t_end="0.1")
        assert after["status"] == "completed"
        for place_name, value in found["scene"]["points"].items():
            first = [float(x[0]) for x in after["scene"]["points"][place_name]]
            assert first == pytest.approx([float(x[0]) for x in value], rel=1e-9, abs=1e-9)


def test_arrows_are_true_while_a_body_is_held() -> None:
    played = play("slider_crank")
    run(played)
    found = dragged(played, {"A": 1}, [0.0, 0.2])
    after = run(played, set_initial={"phi": str(found["initial"]["phi"])})
    arrows = [
        {s["name"]: [x[0] for x in s["components"]] for s in shapes if s["kind"] == "vector"}
        for shapes in (found["scene"]["shapes"], after["scene"]["shapes"])
    ]
    assert arrows[0].keys() == {"v_A", "v_B", "guide"}
    for name, components in arrows[0].items():
        assert components == pytest.approx(arrows[1][name], rel=1e-6, abs=1e-9), name


@pytest.mark.parametrize(
    "drag",
    [
        1,
        {"weights": {}},
        {"weights": {"A": "1"}},
        {"weights": {"A": True}},
        {"target": [1]},
        {"target": [1, float("nan")]},
        {"eye": [1]},
        {"eye": [0.1, 0.1]},
        {"length": 0},
        {"time": None},
    ],
)
def test_drags_that_are_none_are_rejected(drag: Any) -> None:
    usual = {"gesture": 1, "time": 0, "weights": {"A": 1}, "target": [0.1, 0.1], "length": 1}
    changed = usual | drag if isinstance(drag, dict) else drag
    with pytest.raises(ValueError, match=r"."):
        PlayRequest.parsed({"number": 1, "drag": changed})


def test_a_drag_of_nothing_in_the_view_is_an_error() -> None:
    played = play("slider_crank")
    run(played)
    for weights, target in (({"Z": 1.0}, [0.0, 0.0]), ({"A": 1.0}, [0.0, 0.0, 0.0])):
        with pytest.raises(UsageError, match="the moved body does not belong"):
            dragged(played, weights, target)


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ("--set m=2 3: error[syntax]: two numbers", "m = 2 3: error[syntax]: two numbers"),
        ("a\n\n--set-initial phi'=a b: error[x]: b", "a\n\nphi' = a b: error[x]: b"),
        ("--set x[1,2]=3: error[x]: b", "x[1,2] = 3: error[x]: b"),
        ("   note: `m` is given here (--set m=0)", "   note: `m` is given here (m = 0)"),
        ("a constraint, for instance `--set m=1`", "a constraint, for instance `m = 1`"),
        ("write the unit: --set 'alpha=2 deg'", "write the unit: alpha = 2 deg"),
        ('give --set-initial "psi={guess: 0.1}"', "give psi = {guess: 0.1}"),
        ("as in `N: 10` or --set N=10", "as in `N: 10` or N = 10"),
        ("free phi, for instance `phi: {guess: 0.5}`", "mark phi as a guess"),
        ("free one of phi, psi, for instance `phi: {guess: 1}`", "mark one of phi, psi as a guess"),
        ("--timeout allows more", "`lagcli play --timeout` allows more"),
        ("end the run earlier: --t-end 4.5", "end the run earlier: t_end = 4.5"),
        ("no option --nonsense, a--set", "no option --nonsense, a--set"),
    ],
)
def test_values_are_those_of_the_page(said: str, shown: str) -> None:
    assert on_page(said) == shown


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        (
            "the motion; --through-singular continues through it",
            "the motion; `through_singular` continues through it",
        ),
        ("try a smaller --rtol or --max-step", "try a smaller `rtol` or `max_step`"),
        ("or --method DOP853, which", "or `method: DOP853`, which"),
        ("start the run later: --t-start 0.5", "start the run later: `t_start: 0.5`"),
        ("singular there; try --method Radau", "singular there; try `method: Radau`"),
    ],
)
def test_settings_are_those_of_the_model_file(said: str, shown: str) -> None:
    first, second = on_page(said).split("\n")
    assert first == shown
    assert "under `simulation` in the model file" in second


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("slider_crank", {"set": {"m": "0"}}),
        ("slider_crank", {"set": {"m": "2 3"}}),
        ("slider_crank", {"set": {"m": "3 s"}}),
        ("slider_crank", {"set": {"l": "0.01"}}),
        ("slider_crank", {"set": {"q": "1"}}),
        ("slider_crank", {"set_initial": {"psi": "0.3"}}),
        ("slider_crank", {"set_initial": {"m": "0.3"}}),
        ("chain", {"set": {"N": "2.5"}}),
        ("chain", {"set": {"m": "2"}}),
        ("contact/block_on_incline", {"set": {"alpha": "2"}}),
    ],
)
def test_no_error_of_the_page_names_an_option(name: str, values: dict[str, Any]) -> None:
    played = Played(load(MODELS / f"{name}.yaml"))
    with pytest.raises(LagcliError) as error:
        played.run(PlayRequest(1, **values), Interruption())
    assert "--" not in on_page(str(error.value))


def test_a_cut_constraint_stops_acting() -> None:
    """The outer mass flies on a parabola, the inner one swings as a pendulum of its own."""
    played = play("double_pendulum_cartesian")
    answer = run(played, ("coordinates", "velocities", "multipliers"), cuts={"rod_2": 1.0})
    found = curves(answer)
    time = answer["plots"]["coordinates"]["time"]
    before, after = time < 1.0, time > 1.0
    intact = lagcli.simulate(load(PATHS["double_pendulum_cartesian"]))
    k = int(np.flatnonzero(intact.time == 1.0)[0])
    kept = found["x_2"][before]
    assert np.allclose(kept, intact.q[: len(kept), 2], rtol=0, atol=1e-9)
    s = time[after] - 1.0
    q, v = intact.q[k], intact.v[k]
    assert np.allclose(found["x_2"][after], q[2] + v[2] * s, rtol=0, atol=1e-7)
    assert np.allclose(found["y_2"][after], q[3] + v[3] * s - 9.81 / 2 * s**2, rtol=0, atol=1e-7)
    inner = found["x_1"] ** 2 + found["y_1"] ** 2
    assert np.ptp(inner) < 1e-9
    energy = 0.5 * (found["x_1_dot"] ** 2 + found["y_1_dot"] ** 2) + 9.81 * found["y_1"]
    assert np.ptp(energy[after]) < 1e-7
    assert not found["lambda.rod_2"][after].any()
    # restored, it is the whole run again
    again = curves(run(played, ("coordinates",)))
    assert np.array_equal(again["x_2"], intact.q[:, 2])


def test_a_cut_at_the_start_and_its_file() -> None:
    played = play("double_pendulum_cartesian")
    request = PlayRequest(1, plots=("coordinates",), cuts={"rod_1": 0.0})
    answer = played.run(request, Interruption())
    found = curves(answer)
    saved = load_text(played.text(request), "saved.yaml")
    t = lagcli.simulate(saved)
    # the plot has the state on both sides of the cut, too
    kept = np.isin(answer["plots"]["coordinates"]["time"], t.time)
    assert np.array_equal(found["y_1"][kept], t.q[:, 1])
    assert t.q[-1, 1] < -100
    assert not t.multipliers[1:, 0].any()
    command = "lagcli simulate double_pendulum_cartesian_changed.yaml -o run.h5"
    assert played.command(request) == command


def test_a_cut_of_a_constraint_that_is_not_there() -> None:
    with pytest.raises(ModelError, match="not a constraint"):
        run(play("double_pendulum_cartesian"), cuts={"rod_9": 1.0})
    with pytest.raises(ValueError, match="cuts"):
        PlayRequest.parsed({"number": 1, "cuts": {"rod_1": "soon"}})


def test_a_cut_of_a_member_beyond_those_of_the_file() -> None:
    played = play("chain")
    more = {"N": str(int(played.controls["N"].value) + 2)}
    answer = run(played, ("multipliers",), set=more, cuts={f"rod[{more['N']}]": 0.5})
    assert answer["status"] == "completed"


def test_saving_leaves_the_model_of_the_page() -> None:
    """It is read while another thread simulates it."""
    played = play("double_pendulum_cartesian")
    before = played.model
    text = played.text(PlayRequest(1, cuts={"rod_2": 1.0}))
    assert "release: rod_2" in text
    assert played.model is before


def test_terms_of_equations_come_when_asked_for() -> None:
    played = play("slider_crank")
    assert run(played)["balance"] is None
    answer = run(played, balance=True)
    for equation in answer["balance"]["equations"]:
        sides = [sum(t["values"] for t in equation["terms"] if t["side"] == s) for s in (0, 1)]
        assert np.allclose(*sides, rtol=0, atol=1e-12)
    assert 'data-cut="guide"' in played.description()["equations"]


def test_large_families_have_panels_of_their_own() -> None:
    """Also members that are much smaller than others stay with them."""
    series = run(play("chain"))["plots"]["coordinates"]["series"]
    assert {(x["name"].partition("[")[0], x["panel"]) for x in series} == {("x", 0), ("y", 1)}


def test_multipliers_that_are_0_by_definition_are_no_plots() -> None:
    """Those of first-order coordinates; the residuals of their equations are plotted."""
    found = Path(__file__).parents[2] / "found"
    groups = plot_groups(load(found / "vortices.yaml"))
    assert "coordinates" in groups
    assert "velocity residuals" in groups
    assert "multipliers" not in groups
    assert "constraint forces" not in groups
