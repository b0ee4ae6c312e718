"""What the vanes know of the air's rotation, held against JSBSim's own gusts, and the algebra behind it."""

import shutil
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.schema import MAX_MONOMIALS
from beaver_ftc.design.dryden import Dryden, rotation_lengths
from beaver_ftc.design.fdc import MASS
from beaver_ftc.design.model import design_record, rate_damping
from beaver_ftc.design.variants import jacobian
from beaver_ftc.diagnosis.belief import air
from beaver_ftc.diagnosis.belief.air import AIR
from beaver_ftc.loop.loop import Loop
from beaver_ftc.scenario.diagnosis import Bounds
from beaver_ftc.scenario.schema import load as load_given
from flying import declared_in, scenario

ROOT = Path(__file__).resolve().parents[3]
MEMORY_S = 0.05  # over which the whitening filter compares, about
FT = 0.3048


def air_of(turbulence="light"):
    """The record as before a flight."""
    record = np.zeros(1, AIR).view(np.recarray)[0]
    air.set_up_air(record, declared_in(Bounds(turbulence=turbulence), load()), MASS)
    return record


class Flown:
    """A flight frame by frame: gusts seen and true (k, 3) rad/s in level axes, airspeed, headings."""

    def __init__(self, turbulence="light", **keys):
        environment = {"turbulence": "dryden", "severity": turbulence} if turbulence != "none" else {}
        environment |= keys.pop("environment", {})
        bounds = {"turbulence": turbulence if turbulence != "none" else "light"}
        fdi = {"statistical": {}, "bounds": bounds}
        keys = {"uncertainty": {}, "environment": environment, "fdi": fdi, **keys}
        given = load_given(keys) if "aircraft" in keys else scenario(**keys)
        loop = Loop(given)
        loop.sample_references(0, loop.n_frames)
        nodes = [loop.plant.node(f"atmosphere/{axis}-turb-rad_sec") for axis in "pqr"]
        heading = loop.plant.node("attitude/psi-rad")
        accelerations = [loop.plant.node(f"accelerations/a-pilot-{axis}-ft_sec2") for axis in "xyz"]
        record = loop.frames["fdi"]["statistical"]["air"][0]
        rows = []
        loop.fly_frames(1, 0)
        for _ in range(loop.n_frames - 1):
            loop.fly_frames(1, given.substeps)
            turn = np.array(record["memory"]["level_to_body"])
            true = turn.T @ [node.get_double_value() for node in nodes]
            felt = [FT * node.get_double_value() for node in accelerations]
            V = loop.frames["measured"]["y"][0][2]
            seen, force = record["memory"]["gust"], record["memory"]["force"]
            rows.append([*seen, *true, V, heading.get_double_value(), *force, *felt])
        rows = np.array(rows)
        self.seen, self.true = rows[:, 0:3], rows[:, 3:6]
        self.airspeed, self.heading = rows[:, 6].mean(), np.unwrap(rows[:, 7])
        self.force, self.felt = rows[:, 8:11], rows[:, 11:14]
        self.rate_hz, self.turbulence, self.record = given.rate_hz, turbulence, record

    def intensity(self, signal, over_s=MEMORY_S):
        """Of the random walk that differs as much over so long (3,), as a share of what is declared."""
        frames = round(over_s * self.rate_hz)
        differences = signal[frames:] - signal[:-frames]
        declared = Dryden(self.turbulence).rotation_walk(14.63) * self.airspeed
        return np.mean(differences**2, axis=0) / over_s / declared


@cache
def _flown(turbulence, airspeed_mps, seed, **keys):
    return Flown(
        turbulence,
        duration_s=20,
        seed=seed,
        initial={"airspeed_mps": airspeed_mps, "altitude_m": 1143},
        **keys,
    )


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("airspeed_mps", [35, 45, 52])
@pytest.mark.parametrize("turbulence", ["light", "severe"])
def test_pitching_and_yawing_gusts_are_seen_but_for_less_than_the_share_declared(
    turbulence, airspeed_mps, seed
):
    flown = _flown(turbulence, airspeed_mps, seed)
    left = flown.intensity(flown.true - flown.seen)
    assert left[1] < air.UNMEASURED_SHARES[1]
    assert left[2] < air.UNMEASURED_SHARES[2]
    assert np.corrcoef(flown.true[:, 1], flown.seen[:, 1])[0, 1] > 0.98
    assert np.corrcoef(flown.true[:, 2], flown.seen[:, 2])[0, 1] > 0.95


@pytest.mark.parametrize("keys", [{"substeps": 4}, {"rate_hz": 200}, {"rate_hz": 50}])
def test_and_at_other_rates_and_between_jsbsims_frames(keys):
    flown = Flown("light", duration_s=20, seed=3, **keys)
    left = flown.intensity(flown.true - flown.seen)
    assert left[1] < air.UNMEASURED_SHARES[1]
    assert left[2] < air.UNMEASURED_SHARES[2]


def test_a_steady_wind_is_not_taken_for_a_gust():
    still, windy = (
        Flown("light", duration_s=10, seed=3, environment={"wind_mps": wind})
        for wind in ([0, 0, 0], [6, -8, 0.5])
    )
    assert windy.seen == pytest.approx(still.seen, abs=1e-3)
    assert np.std(still.seen[:, 1]) > 0.01


@pytest.mark.parametrize("turbulence", ["light", "severe"])
def test_all_three_true_gusts_drift_no_faster_than_declared(turbulence):
    flights = [_flown(turbulence, 45, seed) for seed in (1, 2, 3, 4)]
    share = np.mean([flight.intensity(flight.true) for flight in flights], axis=0)
    assert (share < 1.0).all()
    assert (share > 0.5).all()


def test_still_air_shows_no_gust():
    flown = Flown("none", duration_s=20)
    assert np.abs(np.diff(flown.seen[:, 1:], axis=0)).max() < 2e-4
    assert np.abs(flown.seen[:, 1:]).max() < 5e-3  # against 0.03 rad/s in light turbulence


@pytest.mark.parametrize("forces", ["felt", "nobody's", "claimed"])
def test_where_no_model_has_the_forces_only_accelerometers_tell_a_gust(tmp_path, monkeypatch, forces):
    """A pull-up in still air: accelerometers say that it is no gust, and without them none is seen; told that
    there are forces all the same, the detector takes it for one."""
    shutil.copytree(ROOT / "tests/data/aircraft/trainer", tmp_path / "trainer")
    file = tmp_path / "trainer/aircraft.yaml"
    text = yaml.safe_load(file.read_text())
    del text["forces"]
    text["damage"] = {"tip-off": {"property": "failures/damage/tip-off", "takes": ["aileron"]}}
    file.write_text(yaml.safe_dump(text))
    monkeypatch.chdir(tmp_path)
    loop = Loop(
        load_given(
            {
                "aircraft": "./trainer",
                "duration_s": 5,
                "fdi": {"statistical": {}, "bounds": {"turbulence": "light"}},
                "reference": {"q": [{"sine": {"amplitude_deg_s": 4, "frequency_hz": 0.5}}]},
            }
        )
    )
    statistical = loop.frames["fdi"]["statistical"][0]
    assert statistical["air"]["output"]["uses_accelerometers"] == 1
    if forces != "felt":
        air.stop_accelerometers(statistical["air"])
    if forces == "claimed":
        statistical["air"]["output"]["measures_gust"], statistical["air"]["memory"]["unmeasured_share"] = (
            1,
            air.UNMEASURED_SHARES,
        )
    for _ in loop.chunks():
        pass
    assert bool(statistical["alarm"]["closest"] > 0.2) is (forces == "claimed")
    seen = float(np.abs(statistical["air"]["output"]["acceleration"]).max())
    assert (seen == 0.0) is (forces == "nobody's")
    assert (seen > 0.05) is (forces == "claimed")


@pytest.fixture
def without_forces(tmp_path, monkeypatch):
    """A folder with the trainer, whose file says no forces."""
    shutil.copytree(ROOT / "tests/data/aircraft/trainer", tmp_path / "trainer")
    file = tmp_path / "trainer/aircraft.yaml"
    text = yaml.safe_load(file.read_text())
    del text["forces"]
    file.write_text(yaml.safe_dump(text))
    monkeypatch.chdir(tmp_path)


def test_where_no_gust_is_seen_each_returns_as_late_as_it_does(without_forces):
    """What the view of roll and yaw that gathers for long reckons with covers a first-order gust of each
    axis at every frequency, and where it is slow by no more than itself."""
    fdi = {"statistical": {}, "bounds": {"turbulence": "light"}}
    statistical = Loop(load_given({"aircraft": "./trainer", "fdi": fdi})).frames["fdi"]["statistical"][0]
    long, record = statistical["block"][2], statistical["air"]
    lengths = rotation_lengths(float(record["config"]["span"]))
    omega = np.geomspace(1e-4, 1e2, 50)  # rad/m
    for g in range(3):
        true = 1.0 / (1.0 / lengths[g] ** 2 + omega**2)
        reckoned = (
            long["drift_scale"]
            * air.slow_power_ratio(record, g)
            / (1.0 / long["return_length"] ** 2 + omega**2)
        )
        assert (reckoned >= true * (1.0 - 1e-9)).all()
        assert reckoned[0] == pytest.approx(true[0], rel=1e-3)


def test_where_no_model_has_the_forces_the_vanes_show_a_gust_roughly_for_a_law_that_answers_them(
    without_forces,
):
    """As JSBSim has it, in turns and climbs, over a filter's memory; the innovation keeps all of it."""
    sine = {"sine": {"amplitude_deg_s": 4, "frequency_hz": 0.2}}
    flown = Flown(
        "moderate", aircraft="./trainer", duration_s=20, seed=3, reference={"p": [sine], "q": [sine]}
    )
    seen, true = (gust[5:, 1:] - gust[:-5, 1:] for gust in (flown.seen, flown.true))
    for axis in (0, 1):
        assert np.corrcoef(seen[:, axis], true[:, axis])[0, 1] > 0.95
    record = flown.record
    assert (
        np.abs(record["output"]["coarse_acceleration"]).max()
        > 0.0
        == np.abs(record["output"]["acceleration"]).max()
    )


def test_nor_does_it_when_the_force_jumps_between_coarse_frames():
    """Elevator and rudder from stop to stop: JSBSim gives a new force half a frame more than it has acted."""
    jumps = {
        "q": [{"square": {"amplitude_deg_s": 60, "frequency_hz": 0.7}}],
        "r": [{"sine": {"amplitude_deg_s": 40, "frequency_hz": 0.2}}],
    }
    flown = Flown("none", duration_s=3, rate_hz=30, reference=jumps, control={"law": "nominal"})
    assert np.abs(np.diff(flown.force[:, 2])).max() > 30.0
    assert np.abs(np.diff(flown.seen[:, 1:], axis=0)).max() < 5e-4


@pytest.mark.parametrize("late", [False, True])
def test_a_heading_that_turns_round_as_the_nose_passes_the_vertical_is_no_gust(late):
    """The turbulence turns with the heading: air from ahead, and a little from aside, turns round at once."""
    record, dt = air_of(), 0.01
    still, gust = np.array([45.0, 0.0, 0.0]), np.array([3.0, 1.0, 0.0])  # m/s; straight down, and level axes
    record["memory"]["level_to_body"], record["memory"]["gust"][2] = _turn(0.0, -1.56), 0.05
    air.start(record, readings(still - record["memory"]["level_to_body"] @ gust), np.array([0.0, -1.56, 0.3]))
    record["memory"]["gust"][2] = 0.05
    over = np.array([np.pi, -1.56, 0.3 + np.pi])
    held = [0.0, 0.0, -record["config"]["gravity"]]  # nothing accelerates
    record["memory"]["force"] = record["memory"]["level_to_body"] @ held
    if late:  # the wind turns a step after the heading
        air.update_gust(record, readings(still - _turn(np.pi, -1.56) @ (gust * [-1, -1, 1])), over, dt)
        record["memory"]["force"] = _turn(np.pi, -1.56) @ held
    air.update_gust(record, readings(still - _turn(np.pi, -1.56) @ gust), over, dt)
    assert abs(record["memory"]["gust"][2]) <= 0.05
    unseen, record["memory"]["unmeasured_share"] = np.array(record["memory"]["unmeasured_share"]), np.ones(3)
    record["output"]["damping"] = np.diag([0.0, 0.0, 5.0]) @ record["output"]["axes"].T
    everything = air.unmeasured_drift(record, 45.0, 2, 2)
    record["memory"]["unmeasured_share"] = unseen
    assert air.unmeasured_drift(record, 45.0, 2, 2) == pytest.approx(everything)


def test_a_gust_that_was_seen_acts_as_before_in_the_step_in_which_the_heading_turns_round():
    """JSBSim's gusts point along the heading of the step before, in body axes as they are now."""
    record, y = air_of(), readings(np.array([45.0, 0.0, 2.0]))
    air.start(record, y, np.array([0.0, -1.56, 0.3]))
    record["memory"]["gust"][1] = 0.04
    over = np.array([np.pi, -1.56, 0.3 + np.pi])
    air.update_gust(record, y, over, 1e-4)
    now = record["memory"]["gust"][1]
    air.fill_effect(record, design_record()[0], np.zeros(3), y, np.zeros(4))
    assert record["memory"]["rotation"][1] == pytest.approx(now)
    air.update_gust(record, y, over, 1e-4)
    now = record["memory"]["gust"][1]
    air.fill_effect(record, design_record()[0], np.zeros(3), y, np.zeros(4))
    assert record["memory"]["rotation"][1] == pytest.approx(-now)


def readings(velocity):
    """alpha, beta, V of a velocity (3,) through the air, m/s in body axes."""
    u, v, w = velocity
    V = np.linalg.norm(velocity)
    return np.array([np.arctan2(w, u), np.arcsin(v / V), V, 0.6 * V * V, 0.3])


def test_a_yawing_gust_is_lost_as_far_as_the_heading_turns_faster_than_it_changes():
    """By the two variances over the lag of the yawing gust, in numbers: 14.63 m, 533.4 m."""
    record = air_of()
    lag_s, sigma, rate = 3 * 14.63 / (np.pi * 45), 2.0, 0.4
    turned, walked = (rate * sigma * lag_s) ** 2, 3 * sigma**2 * 45 / 533.4 * lag_s
    assert air.share_lost_by_turning(record, 45.0, rate) == pytest.approx(turned / walked, rel=1e-9)


def test_the_specific_force_is_the_one_felt_aboard():
    """At the centre of gravity, against JSBSim's accelerometer, under references on all axes."""
    flown = Flown("none", duration_s=8)
    wrong = np.abs(flown.force - flown.felt)
    assert flown.felt[:, 2].mean() == pytest.approx(-9.8, abs=0.5)
    assert (wrong.max(axis=0) < [0.05, 0.1, 0.1]).all()


def _turn(phi, theta):
    turn = np.zeros((3, 3))
    air.level_axes(phi, theta, turn)
    return turn


@given(st.floats(-3, 3), st.floats(-1.5, 1.5))
def test_level_axes_are_turned_not_bent(phi, theta):
    turn = _turn(phi, theta)
    assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    down = turn @ [0.0, 0.0, 1.0]
    assert down == pytest.approx([-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)])
    vector = np.array([0.3, -1.0, 2.0])
    assert [air.to_level(turn, vector, i) for i in range(3)] == pytest.approx(turn.T @ vector)
    assert (turn.T @ [1.0, 0.0, 0.0])[1] == 0.0  # the nose points ahead, up or down, not aside


@given(st.floats(30, 55), st.floats(0, 0.25), st.floats(-0.1, 0.1))
def test_the_damping_is_the_slope_of_the_aerodynamic_moments(V, alpha, beta):
    """f without its inertia coupling, which is of second order in the rates: at none, its slope vanishes."""
    design = design_record()[0]
    y = np.array([alpha, beta, V, 0.5 * V * V, 0.3])
    _, _, slope, _ = jacobian(design, np.zeros(3), y, np.zeros(4))
    out = np.zeros((3, 3))
    rate_damping(design, np.zeros(3), y, np.zeros(4), np.zeros(MAX_MONOMIALS), out)
    assert out == pytest.approx(slope, rel=1e-9, abs=1e-12)


def test_a_gust_acts_through_the_damping_in_body_axes():
    """The air pitches up: against it the aircraft pitches down, and is damped as if it did."""
    record, design = air_of(), design_record()[0]
    y = np.array([0.1, 0.02, 45.0, 1036.0, 0.3])
    record["output"]["axes"] = _turn(0.6, 0.1)
    record["memory"]["gust"] = [0.0, 0.02, -0.03]
    air.fill_effect(record, design.view(), np.zeros(3), y, np.zeros(4))
    _, _, slope, _ = jacobian(design, np.zeros(3), y, np.zeros(4))
    body = _turn(0.6, 0.1) @ record["memory"]["gust"]
    assert record["output"]["acceleration"] == pytest.approx(-slope @ body)


def test_what_is_not_seen_drifts_in_body_axes_as_a_covariance_turns():
    record, design = air_of(), design_record()[0]
    y = np.array([0.1, 0.02, 45.0, 1036.0, 0.3])
    record["output"]["axes"] = turn = _turn(0.6, 0.1)
    air.fill_effect(record, design, np.zeros(3), y, np.zeros(4))
    spread = turn @ np.diag(45.0 * Dryden("light").rotation_walk(14.63) * air.UNMEASURED_SHARES) @ turn.T
    expected = record["output"]["damping"] @ spread @ record["output"]["damping"].T
    found = [[air.unmeasured_drift(record, 45.0, i, j) for j in range(3)] for i in range(3)]
    assert np.array(found) == pytest.approx(expected, rel=1e-12)


def test_a_gust_unseen_drifts_besides_as_its_axis_turns_in_the_body():
    """A gust of the variance of its own process, kept for its own lag while the axis turns, as a walk."""
    record, y, dt = air_of(), readings(np.array([45.0, 0.0, 2.0])), 0.01
    before, after = np.array([0.5, -1.45, 0.2]), np.array([0.53, -1.47, 0.2])
    air.start(record, y, before)
    air.update_gust(record, y, after, dt)
    record["output"]["damping"] = D = np.diag([5.0, 3.0, 1.0])
    air.begin_sums(record, 45.0, dt)
    air.average_frame(record, 1.0)
    turned = (_turn(*after[:2]) - _turn(*before[:2]))[:, 0] / dt
    lag_s = np.sqrt(0.3048 * 1750 * 14.63) / 2.6 / 45
    variance = 45 * Dryden("light").rotation_walk(14.63)[0] * lag_s / 2  # of a first-order process
    expected = np.outer(D @ turned, D @ turned) * variance * lag_s
    assert record["output"]["turn_variance"] / dt == pytest.approx(expected, rel=1e-9)


TURN = {  # to 30 deg of bank, and round
    "p": [
        {"step": {"amplitude_deg_s": 15, "start_s": 0.5}},
        {"step": {"amplitude_deg_s": -15, "start_s": 2.5}},
    ],
    "q": [{"step": {"amplitude_deg_s": 3.6, "start_s": 1.5}}],
    "r": [{"step": {"amplitude_deg_s": 6.2, "start_s": 1.5}}],
}


@pytest.mark.parametrize("wind_mps", [[0, 0, 0], [10, 5, 0]])
def test_the_rolling_gust_rolls_whatever_the_heading(wind_mps):
    """Of an aircraft that flies across what JSBSim takes for ahead it would pitch the nose; the vanes would
    see nothing of it."""
    flown = Flown("light", duration_s=25, seed=5, reference=TURN, environment={"wind_mps": wind_mps})
    across = np.abs(np.cos(flown.heading)) < 0.5
    assert across.sum() > 400
    left = flown.intensity((flown.true - flown.seen)[across])
    assert left[1] < air.UNMEASURED_SHARES[1]
    assert left[2] < air.UNMEASURED_SHARES[2]
