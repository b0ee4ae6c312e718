"""The flight behind the page: it breaks, is diagnosed, saved, and flies again to the bit."""

import json

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.documents.errors import BadInput
from beaver_ftc_live.page import messages
from beaver_ftc_live.page.messages import encode
from beaver_ftc_live.page.session import Session, level_turn, remaining_text
from given import documents

CONVERSATION = documents("conversation")[0]
LOSS = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.4}


def asked(session, **request):
    """Say it as a page does."""
    return session.handle(messages.parse(json.dumps(request)))


def flown(session, frames):
    for _ in range(frames):
        session.step()
    return session


@pytest.fixture
def session(tmp_path):
    return Session(bf.load("fault-free"), tmp_path, seed=1)


def told(session, kind):
    return [event for event in (*session.told, *session.fresh_events) if event["kind"] == kind]


@pytest.mark.parametrize(
    ("left", "gone", "text"),
    [
        ("abcd", "efghij", "a, b, c, d"),
        ("abcde", "fghi", "5 remain; excluded: f, g, h, i"),
        ("abcde", "fghijk", "5 remain; excluded: f, g, h, i and 2 more"),
    ],
)
def test_few_candidates_are_listed_and_many_are_counted(left, gone, text):
    assert remaining_text(left, left + gone) == text


def test_a_loss_is_detected_named_and_told(session):
    flown(session, 300)
    asked(session, do="break", fault=LOSS)
    flown(session, 500)
    frame = session.frame()
    assert (frame["axis"], frame["isolated"], frame["mode"]) == ("q", "elevator", "reallocated")
    assert frame["estimate"] == pytest.approx(-0.4, abs=0.05)
    kinds = [
        event["kind"]
        for event in (*session.told, *session.fresh_events)
        if event["kind"] not in ("candidates", "supervisor")
    ]
    assert kinds[:4] == ["flight", "broken", "alarm", "named"]
    truth = dict(zip(session.surfaces, frame["effectiveness"], strict=True))
    assert truth == {"aileron": 1.0, "elevator": 0.6, "rudder": 1.0, "flap": 1.0}
    asked(session, do="repair", actuator="elevator")
    flown(session, 2)
    assert session.frame()["effectiveness"] == [1.0] * 4
    assert session.state()["broken"] == []


def test_what_a_page_hears_in_a_flight_is_what_is_kept(session, changed):
    heard = [session.hello()]
    for frames, request in CONVERSATION:
        says = asked(session, **request)
        flown(session, frames)
        heard += [says, session.take_events(), session.frame(), session.state()]
    assert not changed(heard, relative=1e-3)


def test_what_is_saved_flies_again_to_the_bit(session, tmp_path):
    flown(session, 250)
    asked(session, do="break", fault=LOSS)
    asked(session, do="stick", rates_deg_s=[2.5, -1, 0.5])
    flown(session, 130)
    asked(session, do="stick", rates_deg_s=[0, 0, 0])
    asked(session, do="blow", velocity_mps=[0, 0, -4])
    flown(session, 220)
    asked(session, do="repair")
    asked(session, do="break", fault={"type": "bias", "actuator": "rudder", "bias_deg": 2})
    flown(session, 100)
    says = asked(session, do="save")
    (folder,) = tmp_path.iterdir()
    assert str(folder) in says
    again = bf.fly(folder / "scenario.yaml")
    kept = bf.open_run(folder)
    assert len(kept.log) == 702
    assert np.array_equal(kept.log.to_numpy(), again.log.to_numpy(), equal_nan=True)
    assert kept.metrics["detection"] == again.metrics["detection"]
    flown(session, 10)  # and goes on
    assert session.sim.frames == 712


def test_the_page_may_name_scenarios_and_no_files(session, tmp_path):
    (tmp_path / "mine.yaml").write_text("name: mine\n")
    with pytest.raises(BadInput, match="is not known"):
        asked(session, do="fresh", scenario="mine")
    asked(session, do="fresh", scenario="rudder-stuck", law="adaptive", fault_class="all")
    assert session.scenario.control.law == "adaptive"
    assert session.scenario.faults[0].actuator == "rudder"
    assert session.sim.frames == 2


# What is asked of a new flight, and what of its scenario is then other than the default.
FRESH = {
    "law": ("lqr", {"control.law": "lqr"}),
    "scheme": ("none", {"fdi.scheme": "none"}),
    "fault_class": ("published", {"fdi.fault_class": "published"}),
    "sensors": ("tactical-grade", {"sensors.p.noise_std_deg_s": 0.0208,
        "fdi.bounds.sensors.p.noise_std_deg_s": 0.0208,
    }),
    "turbulence": ("light", {
        "environment.turbulence": "dryden", "environment.severity": "light", "fdi.bounds.turbulence": "light",
    }),
    "autopilot": (True, {f"autopilot.{held}": 1 for held in ("altitude_m", "airspeed_mps", "heading_deg")}),
}  # fmt: skip


def value_at(scenario, key):
    """At a dotted key; of a list its length."""
    for part in key.split("."):
        scenario = getattr(scenario, part)
    return len(scenario) if isinstance(scenario, tuple) else scenario


@pytest.mark.parametrize("key", FRESH)
def test_a_new_flight_is_what_was_asked_for_and_declared(session, key):
    value, expected = FRESH[key]
    assert set(FRESH) == set(messages.Fresh.model_fields) - {"do", "n", "scenario"}
    asked(session, do="fresh", **{key: value})
    assert {place: value_at(session.scenario, place) for place in expected} == expected
    again = session.scenario.with_({"name": "fault-free"})
    asked(session, do="fresh")  # and stays so
    assert session.scenario.with_({"name": "fault-free"}) == again


def test_the_game_hides_what_is_broken_and_what_the_diagnosis_says(session):
    asked(session, do="game", move="second")
    flown(session, 100)
    asked(session, do="break", fault=LOSS)
    flown(session, 200)
    frame, columns = session.frame(), session.columns
    assert "isolated" not in frame
    assert "effectiveness" not in frame
    hidden = {name for name, value in zip(columns, frame["v"], strict=True) if value is None}
    assert {"elevator_effective_rad", "elevator_pos_rad", "mode", "detected", "fie_rudder_excluded"} <= hidden
    assert "elevator_cmd_rad" not in hidden
    assert session.state()["broken"] == []
    for tells in ("save", "repair"):
        with pytest.raises(BadInput, match="a round is on"):
            asked(session, do=tells)
    assert asked(session, do="break", fault={"actuator": "rudder", "type": "float"}) == ""
    assert len(session.sim.in_force) == 1
    assert {event["kind"] for event in session.take_events()} == {"flight", "game"}
    assert {event["kind"] for event in session.hello()["events"]} == {"flight", "game"}
    asked(session, do="game", move="answer", answer="elevator")
    flown(session, 1)
    game = session.state()["game"]
    assert (game["phase"], game["winner"]) == ("over", "detector")
    assert game["its_delay_s"] < game["your_delay_s"] == pytest.approx(2.0, abs=0.02)
    assert {"broken", "alarm", "named"} <= {event["kind"] for event in session.take_events()}


def test_a_coordinated_turn_is_that_of_the_bank_that_the_instruments_show(tmp_path):
    session = Session(bf.load("fault-free").with_({"sensors.phi.bias_deg": 15}), tmp_path, seed=1)
    asked(session, do="stick", rates_deg_s=[0, 0, 0], coordinated=True)
    flown(session, 2)
    _, _, r = session._rates_rad_s()
    assert r == pytest.approx(level_turn(np.radians(15), 0.0, 45.0)[2], abs=0.01)


def test_a_lost_aircraft_ends_the_flight_and_can_still_be_saved(session, tmp_path):
    asked(session, do="stick", rates_deg_s=[20, 0, 0])
    while not session.over:
        session.step()
    assert told(session, "lost")
    with pytest.raises(BadInput, match="is over"):
        asked(session, do="break", fault=LOSS)
    asked(session, do="save")
    (folder,) = tmp_path.iterdir()
    assert bf.fly(folder / "scenario.yaml").departure == session.sim.land().departure


def test_every_message_is_strict_json(session):
    flown(session, 30)
    for message in (session.hello(), session.frame(), session.state()):
        assert json.loads(encode(message))["k"] == message["k"]


def test_the_rates_of_a_level_turn():
    """At 60 degrees of bank, level, 98.0665 tan(60 deg) m/s: psi' is 0.1 rad/s; half of it is yaw."""
    rates = level_turn(np.pi / 3, 0.0, 98.0665 * np.tan(np.pi / 3))
    assert rates == pytest.approx([0.0, 0.1 * np.sin(np.pi / 3), 0.05])
    assert np.linalg.norm(level_turn(0.4, 0.3, 45.0)) == pytest.approx(9.80665 * np.tan(0.4) / 45.0)
