"""What a surface cannot have done: directions in which its fault, whatever its course, shows nothing."""

import numpy as np
import pytest
from kernels import DT, new_fdi
from statistics_of import Across

from beaver_ftc.aircraft import load
from beaver_ftc.diagnosis.belief import air
from beaver_ftc.diagnosis.detection.likelihood import STEP
from beaver_ftc.diagnosis.detection.parity import set_up_views
from beaver_ftc.diagnosis.detection.tones import set_up_tones
from beaver_ftc.diagnosis.schemes import fault_classes
from beaver_ftc.diagnosis.state import LOSS, POSITION
from beaver_ftc.loop.loop import Loop, fly
from beaver_ftc.scenario.diagnosis import FdiConfig
from beaver_ftc.studies.matrix.fault_matrix import declared
from flying import SINES, scenario

AIRCRAFT = load()
AILERON, ELEVATOR, RUDDER, FLAP = range(4)
PITCH_AXIS, ROLL_AXIS, YAW_AXIS, PAST_AILERON, PAST_RUDDER = range(5)
FLOW = np.array([0.05, 0.0, 45.0, 1200.0, 0.1])  # alpha, beta, airspeed, pressure, dpt
G = np.array([[-9.0, 0.0, 1.2, 0.0], [0.0, -8.0, 0.0, -1.5], [-0.4, 0.0, -3.0, 0.0]])


def watching(turns=0.0):
    """A diagnosis with its views; turns: errors of a surface's own terms, as a share of them."""
    fdi = new_fdi()
    statistical = fdi["statistical"]
    statistical["tests"]["keep"], statistical["tests"]["alarm_level"] = 0.99, 5.0
    statistical["noise"]["rapidity"], statistical["noise"]["jitter"], statistical["noise"]["bounded"] = (
        2.0,
        1e-6,
        0.02,
    )
    for block, n in zip(statistical["block"], (1, 2, 2), strict=True):
        block["noise"][:n] = 1e-8
    set_up_views(statistical, AIRCRAFT)
    set_up_tones(statistical["tone_config"], 1e-8, 45.0, 15.0, DT)
    statistical["tests"]["tolerated"] = fdi["bound"]["own_errors"] = turns > 0.0
    fdi["bound"]["own_per_rad"] = turns * np.abs(G)
    fdi["layout"]["position_of"] = range(4)
    for s, fie in enumerate(fdi["isolation"]["estimator"][:4]):
        fie["kind"], fie["surface"], fie["effect"]["Z"] = POSITION, s, G[:, s]
    return fdi


def shown(fdi, courses, frames=70):
    """Show it accelerations, frames after one another: courses(k) (3,) rad/s2."""
    u = np.array([0.05, 0.03, 0.04, 0.0])
    for k in range(frames):
        Across.observe(fdi, courses(k), G, G * u, FLOW, k, False)
    return fdi["statistical"]["views"]


@pytest.mark.parametrize(
    ("surface", "blind"),
    [(AILERON, (PITCH_AXIS, PAST_AILERON)), (RUDDER, (PITCH_AXIS, PAST_RUDDER)),
     (ELEVATOR, (ROLL_AXIS, YAW_AXIS, PAST_AILERON, PAST_RUDDER))],
)  # fmt: skip
def test_a_fault_of_any_course_shows_nothing_where_its_surface_moves_nothing(surface, blind):
    course = np.cumsum(np.random.default_rng(surface).normal(size=70))
    fdi = watching()
    views = shown(fdi, lambda k: course[k] * G[:, surface])
    for v, view in enumerate(views[:5]):
        evidence = np.abs(view["block"]["lanes"]["correlation"]).max()
        felt = Across.is_sensitive_to(fdi, view, surface, G[:, surface])
        assert felt == (v not in blind)
        assert (evidence > 1.0) == felt


@pytest.mark.parametrize("signs", [(1, 1), (1, -1), (-1, 1), (-1, -1)])
def test_errors_that_turn_the_column_are_tolerated(signs):
    """Ends of the tolerance of both axes' terms: what shows across is within the slack of every test."""
    course = np.cumsum(np.random.default_rng(8).normal(size=70))
    turned = G[:, RUDDER] * (1.0 + 0.05 * np.array([signs[0], 0.0, signs[1]]))
    view = shown(watching(turns=0.05), lambda k: course[k] * turned)[PAST_RUDDER]
    lanes = view["block"]["lanes"]
    known = lanes["information"] > 0.0
    assert known.any()
    assert (np.abs(lanes["correlation"]) <= 1.0001 * lanes["coefficient_part"] + 1e-9)[known].all()
    if signs[0] != signs[1]:
        assert np.abs(lanes["correlation"]).max() > 1.0


def test_only_what_a_surface_does_not_move_excludes_it():
    for v in range(5):
        fdi = watching()
        fdi["statistical"]["views"]["direction"][PAST_AILERON, :3] = (0.4 / 9.0, 0.0, -1.0)
        fdi["statistical"]["views"]["direction"][PAST_RUDDER, :3] = (3.0 / 1.2, 0.0, 1.0)
        fdi["statistical"]["views"][v]["block"]["hypothesis"]["score"][0] = 5.1
        found = [Across.excludes(fdi, s) for s in range(4)]
        excluded = {
            AILERON: v in (PITCH_AXIS, PAST_AILERON), ELEVATOR: v != PITCH_AXIS,
            RUDDER: v in (PITCH_AXIS, PAST_RUDDER), FLAP: v != PITCH_AXIS,
        }  # fmt: skip
        assert found == [excluded[s] for s in range(4)]
        fdi["statistical"]["views"][v]["block"]["hypothesis"]["score"][0] = 4.9
        assert not any(Across.excludes(fdi, s) for s in range(4))


@pytest.mark.parametrize(
    ("changes", "instants", "counts"),
    [
        ({}, 1, True), ({"authority": "statistical"}, 1, True), ({}, 0, True), ({}, 2, False),
        ({"pairs": True}, 1, False), ({"authority": "worst-case"}, 1, False),
        ({"fault_class": "published"}, 1, False),
    ],
)  # fmt: skip
def test_views_are_there_only_where_something_is_concluded_from_them(changes, instants, counts):
    """Of two faults one may move what the other does not; within a frame of instants a column turns."""
    config = FdiConfig.model_validate({"fault_class": "all", "statistical": {}, **changes})
    assert config.compares_across(instants) == counts


@pytest.mark.parametrize("substeps", [1, 2])
def test_a_flight_has_them_or_not(substeps):
    loop = Loop(scenario(duration_s=1, substeps=substeps, **declared("light")))
    assert loop.frames["fdi"]["statistical"]["n_views"][0] == (13 if substeps == 1 else 0)
    loop.release()


def test_what_a_surface_does_not_move_rules_its_faults_out():
    fdi = watching()
    fdi["statistical"]["tests"]["enabled"] = fdi["config"]["every_type"] = 1
    fdi["statistical"]["views"][PITCH_AXIS]["block"]["hypothesis"]["score"][0] = 5.1
    estimator = fdi["isolation"]["estimator"]
    assert fault_classes.is_off_the_column(fdi, estimator[AILERON])
    assert not fault_classes.is_off_the_column(fdi, estimator[ELEVATOR])
    fdi["statistical"]["n_views"] = 0
    assert not fault_classes.is_off_the_column(fdi, estimator[AILERON])


def test_views_try_a_step_and_the_losses_of_those_that_move_the_axis():
    tried = []
    for view in watching()["statistical"]["views"][:5]:
        of_it = view["block"]["hypothesis"][: view["block"]["n_hypotheses"]]
        tried.append((view["surface"], *zip(of_it["kind"], of_it["surface"], strict=True)))
    assert tried[PITCH_AXIS] == (-1, (STEP, -1), (LOSS, ELEVATOR), (LOSS, FLAP))
    assert tried[ROLL_AXIS] == tried[YAW_AXIS] == (-1, (STEP, -1), (LOSS, AILERON), (LOSS, RUDDER))
    assert tried[PAST_AILERON] == (AILERON, (STEP, -1), (LOSS, RUDDER))
    assert tried[PAST_RUDDER] == (RUDDER, (STEP, -1), (LOSS, AILERON))


def test_in_moving_air_no_view_of_pitch_tries_what_answers_the_gusts():
    """A law that goes by the vanes moves the elevator before the gyros feel a gust."""
    loop = Loop(scenario(duration_s=1, **declared("light")))
    views = loop.frames["fdi"]["statistical"]["views"][0]
    assert [int(view["block"]["n_hypotheses"]) for view in views[:5]] == [1, 3, 3, 2, 2]
    loop.release()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_rudder_that_floats_in_a_gust_stays_a_candidate(seed):
    """With ideal gyros at 200 Hz the elevator, which answered the gusts, ruled it out within seconds."""
    flown = fly(scenario(
        duration_s=6, rate_hz=201, seed=seed, initial={"airspeed_mps": 51.7, "altitude_m": 2138},
        uncertainty={},
        faults=[{"actuator": "rudder", "type": "float", "at_s": 2}], control={"law": "nominal"},
        environment={"turbulence": "dryden", "severity": "light"},
        fdi={
            "fault_class": "all", "statistical": {}, "authority": "statistical",
            "bounds": {"turbulence": "light"},
        },
    ))  # fmt: skip
    assert flown.detection_time_s is not None
    assert flown.isolated in ("rudder", None)


def test_without_the_vanes_every_gust_is_reckoned_with_in_full():
    record = np.zeros(1, air.AIR).view(np.recarray)[0]
    rng = np.random.default_rng(3)
    config, memory, output = (record[part] for part in ("config", "memory", "output"))
    output["damping"], memory["intensity"] = rng.normal(size=(3, 3)), rng.uniform(1e-5, 1e-4, 3)
    output["axes"] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    config["rolling_length"], config["span"], memory["unmeasured_share"] = 34.0, 14.6, 1.0
    pairs = [(i, j) for i in range(3) for j in range(3)]
    unseen = np.reshape([air.unmeasured_drift(record, 45.0, *pair) for pair in pairs], (3, 3))
    gusts = output["damping"] @ output["axes"]
    assert unseen == pytest.approx(45.0 * gusts @ np.diag(memory["intensity"]) @ gusts.T)
    for m in rng.normal(size=(3, 3)):
        whole = air.full_drift(record, 45.0, m @ output["damping"], np.zeros(3))
        assert whole == pytest.approx(m @ unseen @ m)


@pytest.mark.parametrize(
    ("fault", "left"),
    [
        ({"actuator": "elevator", "type": "bias", "bias_deg": 3.0}, {"elevator"}),
        ({"actuator": "rudder", "type": "loss_of_effectiveness", "magnitude": 0.7}, {"rudder"}),
        ({"actuator": "aileron", "type": "stuck", "position_deg": 5.0}, {"aileron"}),
    ],
)
def test_in_declared_turbulence_a_fault_is_left_to_those_that_can_have_done_it(fault, left):
    given = {"duration_s": 16, "seed": 12, "reference": SINES, "faults": [fault | {"at_s": 6}]}
    flight = fly(scenario(**declared("light") | given))
    assert flight.detection_time_s > 6.0
    named = {flight.isolated} if flight.isolated else {word.split(":")[0] for word in flight.candidates}
    assert named == left
