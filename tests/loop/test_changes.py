"""Law, diagnosis and sensors changed in flight: when asked for, without a bump, and again to the bit."""

from types import SimpleNamespace

import pytest

import beaver_ftc as bf
from beaver_ftc.loop.changing import take_diagnosis
from beaver_ftc.loop.loop import Loop
from flying import loss, same_log, scenario

LAWS = ("nominal", "adaptive", "fault-tolerant-published", "oracle", "indi")
SCHEMES = ("none", "augmented-ekf", "adaptive-estimators")


def flown(*changes, seconds=6.0, **more):
    """A flight on which these changes are made at their second."""
    sim = bf.Simulation(scenario(duration_s=seconds, **more))
    for at_s, change in changes:
        left = round(100 * at_s) - max(sim.frames, 1)  # the first step flies frame 0 as well
        if left:
            sim.step(frames=left)
        sim.change(change)
    while not sim.done:
        sim.step(frames=37)
    return sim


@pytest.fixture(scope="module")
def unchanged():
    return bf.fly(scenario(duration_s=6.0, faults=[loss(at_s=3.0)])).log


@pytest.mark.parametrize("law", LAWS)
def test_a_law_changed_is_flown_again_to_the_bit(law, unchanged):
    sim = flown((2.0, {"law": law}), (4.5, {"law": "fault-tolerant"}), faults=[loss(at_s=3.0)])
    log = sim.log
    assert same_log(log, bf.fly(sim.scenario_flown()).log)
    commands = [name for name in log.columns if name.endswith("_cmd_rad")]
    differs = (log[commands] - unchanged[commands]).abs().max(axis=1)
    assert differs[:201].max() == 0.0  # the command of frame 200 is in effect, and logged, from 201 on
    same = law == "fault-tolerant-published"
    assert (differs[201:450].max() < 1e-9) == same


@pytest.mark.parametrize(
    ("law", "then"),
    [
        ("fault-tolerant", "nominal"),
        ("nominal", "fault-tolerant"),
        ("adaptive", "nominal"),
        ("fault-tolerant", "oracle"),
    ],
)
def test_a_law_takes_over_what_the_one_before_it_had_learnt(law, then):
    """Of a wrong pitching moment nobody is told. A law that began without what integrator or observer had
    found of it jumps by 0.010 to 0.014 rad of elevator; gains that differ are allowed their part."""
    wrong = {"design_model": {"coefficients": {"Cm_0": 1.3}}, "fdi": {"scheme": "none"}, "duration_s": 10.0}
    log = bf.fly(scenario(**wrong, control={"law": law}, changes=[{"at_s": 8.0, "law": then}])).log
    moved = log["elevator_cmd_rad"].diff().abs()
    assert moved[800:803].max() < 0.006


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_diagnosis_changed_begins_anew_and_is_flown_again_to_the_bit(scheme):
    sim = flown((2.0, {"scheme": scheme}), (4.5, {"scheme": "adaptive-estimators"}), faults=[loss(at_s=3.0)])
    log = sim.log
    assert same_log(log, bf.fly(sim.scenario_flown()).log)
    assert log["detected"].iloc[449] == (scheme != "none")
    assert log["detected"].iloc[450] == 0.0
    metrics = sim.land().metrics
    assert metrics["detection"]["time_s"] > 4.5  # the last diagnosis finds it again
    assert metrics["isolation"]["fault"] == "elevator"
    first, second = metrics["changes"]
    assert (first["time_s"], first["scheme"], first["detection_time_s"]) == (2.0, scheme, None)
    assert (second["detection_time_s"] is None) == (scheme == "none")


def test_a_broken_instrument_stays_broken_when_the_sensors_change():
    fault = {"type": "bias", "sensor": "manifold_pressure", "magnitude": 8, "at_s": 0.2}
    sim = flown((0.4, {"sensors": {"q": {"noise_std_deg_s": 0.01}}}), seconds=0.6, faults=[fault])
    assert sim.measured.y[4] - sim["aero/dpt"] > 0.3


def test_an_autopilot_forgets_what_the_oracle_knew():
    change = 0.6, {"law": "nominal"}
    flight = {"faults": [loss("rudder", at_s=0.1, magnitude=1.0)], "control": {"law": "oracle"}}
    sim = flown(change, seconds=0.62, autopilot={"heading_deg": [{"hold": True}]}, **flight)
    assert sim.records[0]["autopilot"]["yaw_loss_share"] == 0.0


def test_an_alarm_before_the_fault_stays_a_false_one():
    """Undeclared sensor errors raise it; a diagnosis begun anew does not make it undone."""
    bad = {"sensors": {"q": {"bias_deg_s": 3.0}}}
    sim = flown((1.0, bad), (3.0, {"scheme": "adaptive-estimators", "sensors": "ideal"}))
    metrics = sim.land().metrics
    assert metrics["false_alarm"]
    assert metrics["detection"]["time_s"] is None
    assert metrics["changes"][1]["detection_time_s"] == pytest.approx(1.0, abs=0.2)


def test_every_part_of_the_log_stays_in_its_column():
    """What is not there any more is not a number."""
    given = {"statistical": {}, "fault_class": "all", "sensor_monitor": "never"}
    sim = flown((2.0, {"scheme": "augmented-ekf"}), fdi=given)
    log, plain = sim.log, bf.fly(scenario(duration_s=6.0, fdi=given)).log
    assert list(log.columns) == list(plain.columns)
    gone = [name for name in log.columns if name.startswith("fie_") or name.endswith("_likelihood_share")]
    assert log[gone][200:].isna().all().all()
    there = [name for name in log.columns if name not in gone]
    assert log[there].notna().all().all()
    assert log["manifold_pressure_inhg"].between(10, 36.5).all()
    assert same_log(log[:200], plain[:200])


def test_a_diagnosis_that_begins_in_moving_air_takes_none_of_it_for_a_fault():
    """With several instants in a frame, the first of them come before it has seen a whole frame."""
    air = {
        "environment": {"turbulence": "dryden", "severity": "light"},
        "fdi": {"statistical": {}, "bounds": {"turbulence": "light"}},
    }
    sim = flown((2.0, {"scheme": "none"}), (3.0, {"scheme": "adaptive-estimators"}), substeps=4, **air)
    assert sim.land().metrics["detection"]["time_s"] is None
    shares = sim.log.filter(like="_likelihood_share")
    assert shares[200:300].isna().all().all()
    assert shares[300:].max().max() < 0.6
    assert same_log(sim.log, bf.fly(sim.scenario_flown()).log)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({}, "says no change"),
        ({"law": "lqrr"}, "law: unknown law 'lqrr', did you mean lqr?"),
        ({"declared_sensors": {"p": {"delay_s": 0.1}}}, "declared_sensors.p: a lag, a delay"),
        ({"at_s": 3, "law": "lqr"}, "at_s: has no meaning here"),
        ({"declared_sensors": "ideal"}, "with a detector object"),
        (
            {"sensors": {name: {"delay_s": 1.0} for name in ("p", "q", "r", "alpha", "beta", "V")}},
            r"sensors: delays of 612 samples in all, allowed: 512 in this flight",
        ),
    ],
)
def test_a_mistake_is_said_in_one_line_and_the_flight_goes_on(change, says):
    detector = SimpleNamespace(reset=id, step=lambda *_: bf.Verdict())
    sim = bf.Simulation(scenario(duration_s=1.0), detector=detector)
    sim.step(frames=10)
    with pytest.raises(bf.BadInput, match=says) as refusal:
        sim.change(change)
    assert "\n" not in str(refusal.value)
    sim.step(frames=10)
    assert sim.scenario_flown().changes == ()


def test_a_new_diagnosis_knows_that_the_levers_have_been_apart():
    frame, new = (Loop(scenario(duration_s=1.0)).frames[0].copy() for _ in range(2))
    frame["fdi"]["engine_monitor"]["memory"]["levers_apart"] = 1
    take_diagnosis(frame, new, 5)
    assert frame["fdi"]["engine_monitor"]["memory"]["levers_apart"] == 1
