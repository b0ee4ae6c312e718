"""What a surface cannot have done: directions in which its fault, whatever its course, shows nothing."""

import numpy as np
import pytest
from kernels import new_fdi

from beaver_ftc.aircraft import load
from beaver_ftc.diagnosis import across, air, isolation
from beaver_ftc.diagnosis.state import LOSS, POSITION, STEP
from beaver_ftc.diagnosis.views import set_up_views
from beaver_ftc.loop.loop import fly
from beaver_ftc.studies.matrix.cases import declared
from flying import SINES, scenario

AIRCRAFT = load()
AILERON, ELEVATOR, RUDDER, FLAP = range(4)
PITCH_AXIS, ROLL_AXIS, YAW_AXIS, PAST_AILERON, PAST_RUDDER = range(5)
G = np.array([[-9.0, 0.0, 1.2, 0.0], [0.0, -8.0, 0.0, -1.5], [-0.4, 0.0, -3.0, 0.0]])


def watching(turns=0.0):
    """A diagnosis with its views; turns: errors of a surface's own terms, as a share of them."""
    fdi = new_fdi()
    statistical = fdi["statistical"]
    statistical["n_blocks"], statistical["keep"], statistical["alarm_level"] = 3, 0.99, 5.0
    statistical["rapidity"], statistical["jitter"], statistical["bounded"] = 2.0, 1e-6, 0.02
    for block, n in zip(statistical["block"], (1, 2, 2), strict=True):
        block["noise"][:n] = 1e-8
    set_up_views(statistical, AIRCRAFT)
    statistical["tolerated"] = fdi["bound"]["own_errors"] = turns > 0.0
    fdi["bound"]["own_per_rad"] = turns * np.abs(G)
    fdi["layout"]["position_of"] = range(4)
    for s, fie in enumerate(fdi["estimator"][:4]):
        fie["kind"], fie["surface"], fie["effect"]["Z"] = POSITION, s, G[:, s]
    return fdi


def shown(fdi, courses, frames=70):
    """Show it accelerations, frames after one another: courses(k) (3,) rad/s2."""
    u = np.array([0.05, 0.03, 0.04, 0.0])
    for k in range(frames):
        across.observe(fdi, courses(k), G, G * u, 45.0, k, False)
    return fdi["statistical"]["views"]


@pytest.mark.parametrize(
    ("surface", "blind"),
    [(AILERON, (PITCH_AXIS, PAST_AILERON)), (RUDDER, (PITCH_AXIS, PAST_RUDDER)),
     (ELEVATOR, (ROLL_AXIS, YAW_AXIS, PAST_AILERON, PAST_RUDDER))],
)  # fmt: skip
def test_a_fault_of_any_course_shows_nothing_where_its_surface_moves_nothing(surface, blind):
    course = np.cumsum(np.random.default_rng(surface).normal(size=70))
    views = shown(watching(), lambda k: course[k] * G[:, surface])
    for v, view in enumerate(views):
        evidence = np.abs(view["block"]["lane"]["correlation"]).max()
        felt = across.feels(view, surface, G[:, surface])
        assert felt == (v not in blind)
        assert (evidence > 1.0) == felt


@pytest.mark.parametrize("signs", [(1, 1), (1, -1), (-1, 1), (-1, -1)])
def test_errors_that_turn_the_column_are_tolerated(signs):
    """Ends of the tolerance of both axes' terms: what shows across is within the slack of every test."""
    course = np.cumsum(np.random.default_rng(8).normal(size=70))
    turned = G[:, RUDDER] * (1.0 + 0.05 * np.array([signs[0], 0.0, signs[1]]))
    view = shown(watching(turns=0.05), lambda k: course[k] * turned)[PAST_RUDDER]
    lane = view["block"]["lane"]
    known = lane["information"] > 0.0
    assert known.any()
    assert (np.abs(lane["correlation"]) <= 1.0001 * lane["slack"] + 1e-9)[known].all()
    if signs[0] != signs[1]:
        assert np.abs(lane["correlation"]).max() > 1.0


def test_only_what_a_surface_does_not_move_excludes_it():
    for v in range(5):
        fdi = watching()
        fdi["statistical"]["views"]["mix"][PAST_AILERON] = (0.4 / 9.0, 0.0, -1.0)
        fdi["statistical"]["views"]["mix"][PAST_RUDDER] = (3.0 / 1.2, 0.0, 1.0)
        fdi["statistical"]["views"][v]["block"]["hypothesis"]["score"][0] = 5.1
        found = [across.excludes(fdi, s) for s in range(4)]
        excluded = {
            AILERON: v in (PITCH_AXIS, PAST_AILERON), ELEVATOR: v != PITCH_AXIS,
            RUDDER: v in (PITCH_AXIS, PAST_RUDDER), FLAP: v != PITCH_AXIS,
        }  # fmt: skip
        assert found == [excluded[s] for s in range(4)]
        fdi["statistical"]["views"][v]["block"]["hypothesis"]["score"][0] = 4.9
        assert not any(across.excludes(fdi, s) for s in range(4))


@pytest.mark.parametrize(("instants", "excluded"), [(1, True), (2, False)])
def test_within_a_frame_a_column_turns_and_nothing_is_concluded(instants, excluded):
    fdi = watching()
    fdi["statistical"]["enabled"] = fdi["every_type"] = 1
    fdi["instants"] = instants
    fdi["statistical"]["views"][PITCH_AXIS]["block"]["hypothesis"]["score"][0] = 5.1
    assert bool(isolation.rules_out(fdi, fdi["estimator"][AILERON], True)) == excluded


def test_views_try_a_step_and_the_losses_of_those_that_move_the_axis():
    tried = []
    for view in watching()["statistical"]["views"]:
        of_it = view["block"]["hypothesis"][: view["block"]["n_hypotheses"]]
        tried.append((view["surface"], *zip(of_it["kind"], of_it["surface"], strict=True)))
    assert tried[PITCH_AXIS] == (-1, (STEP, -1), (LOSS, ELEVATOR), (LOSS, FLAP))
    assert tried[ROLL_AXIS] == tried[YAW_AXIS] == (-1, (STEP, -1), (LOSS, AILERON), (LOSS, RUDDER))
    assert tried[PAST_AILERON] == (AILERON, (STEP, -1), (LOSS, RUDDER))
    assert tried[PAST_RUDDER] == (RUDDER, (STEP, -1), (LOSS, AILERON))


def test_without_the_vanes_every_gust_is_reckoned_with_in_full():
    record = np.zeros(1, air.AIR).view(np.recarray)[0]
    rng = np.random.default_rng(3)
    record["damping"], record["per_metre"] = rng.normal(size=(3, 3)), rng.uniform(1e-5, 1e-4, 3)
    record["axes"], record["rolling"], record["span"] = np.linalg.qr(rng.normal(size=(3, 3)))[0], 34.0, 14.6
    record["unseen"] = 1.0
    pairs = [(i, j) for i in range(3) for j in range(3)]
    whole = [air.whole_drift(record, 45.0, *pair) for pair in pairs]
    assert whole == pytest.approx([air.unseen_drift(record, 45.0, *pair) for pair in pairs])
    gusts = record["damping"] @ record["axes"]
    assert np.reshape(whole, (3, 3)) == pytest.approx(45.0 * gusts @ np.diag(record["per_metre"]) @ gusts.T)


@pytest.mark.parametrize(
    ("fault", "left"),
    [
        ({"actuator": "elevator", "type": "bias", "bias_deg": 3.0}, {"elevator", "flap"}),
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
