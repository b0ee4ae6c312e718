"""Supervisor, oracle, accommodation and what is left of a surface: a decision at a time."""

import numpy as np
import pytest

import law_records
from beaver_ftc.control import accommodation, allocation
from beaver_ftc.control.accommodation import (
    MAX_EVENTS,
    MODE_ADAPTIVE,
    MODE_NOMINAL,
    MODE_REALLOCATED,
    MODE_UNANTICIPATED,
    SUPERVISOR,
)
from beaver_ftc.control.laws import rejecting
from beaver_ftc.control.laws.rejecting import N_POINTS, OBSERVER_ERROR, observer_response, rejecting_dtype
from beaver_ftc.design.model import design_record, unanticipated_pitch
from beaver_ftc.diagnosis.state import NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.diagnosis.types import GIVE_UP, SCALE_COMMAND, SUBTRACT_OFFSET, WAIT_FOR_SURFACE
from beaver_ftc.loop import frame as whole
from beaver_ftc.loop.assembly import frame_dtype
from beaver_ftc.loop.frame import true_faults_dtype
from law_records import put

AILERON, ELEVATOR, RUDDER, FLAP = range(4)
DT = 0.02


def record(dtype):
    return np.zeros(1, dtype).view(np.recarray)[0]


def new_control(**fields):
    control = law_records.new_control(main=(0, 1, 2), stand_in=FLAP, dt=DT, law="fault-tolerant-published")
    return put(control, **({"effectiveness": 1.0, "least_effectiveness": 0.1} | fields))


def new_frame(faults=None, **fields):
    """A frame whose law has these fields; of the diagnosis and the truth, nothing but whole surfaces."""
    frame = record(frame_dtype(4))
    frame["control"], frame["faults"] = new_control(**fields), new_faults(**(faults or {}))
    frame["fdi"]["types"]["surface"]["accommodation"]["mode"] = -1
    return frame


def given_up(frame):
    """The command, once what does not follow is given up."""
    whole.assess_faults(frame)
    control = frame["control"]
    output, informed = control["surfaces"]["output"], control["config"]["informed"]
    accommodation.park_failed_surfaces(output, frame["assessment"], frame["faults"], informed)
    allocation.park(control["allocation"]["output"], control["layout"], output["parked"])
    return control["allocation"]["output"]


def accommodated(frame):
    """The surfaces as the law takes them, from what the diagnosis says."""
    whole.assess_faults(frame)
    whole.accommodate(frame)
    return frame["control"]["surfaces"]["output"]


def new_faults(**fields):
    faults = record(true_faults_dtype(4))
    faults["effectiveness"] = 1.0
    for name, value in fields.items():
        faults[name] = value
    return faults


def test_every_change_of_mode_is_noted_and_of_too_many_the_latest():
    state = record(SUPERVISOR)
    accommodation.supervise(state, MODE_NOMINAL, 0.0)
    accommodation.supervise(state, MODE_NOMINAL, 1.0)
    accommodation.supervise(state, MODE_REALLOCATED, 2.0)
    accommodation.supervise(state, MODE_REALLOCATED, 3.0)
    assert state["n_modes"] == 3
    assert state["mode_is"][:3].tolist() == [MODE_NOMINAL, MODE_ADAPTIVE, MODE_REALLOCATED]
    assert state["mode_at_s"][:3].tolist() == [0.0, 2.0, 3.0]
    assert state["mode"] == MODE_REALLOCATED
    for k in range(MAX_EVENTS):
        accommodation.supervise(state, MODE_ADAPTIVE if k % 2 == 0 else MODE_UNANTICIPATED, 10.0 + k)
    assert state["n_modes"] == 3 + MAX_EVENTS
    assert state["mode_at_s"][-1] == 9.0 + MAX_EVENTS
    assert state["mode_is"][-1] == MODE_UNANTICIPATED
    assert state["mode_at_s"][-2] == 10.0 + MAX_EVENTS - 5


@pytest.mark.parametrize(
    ("diagnoses_all_types", "isolated", "lead", "accommodation_mode", "stand_in", "mode"),
    [
        (0, 5, -1, -1, FLAP, MODE_REALLOCATED), (0, 5, -1, -1, -1, MODE_ADAPTIVE),
        (0, 6, -1, -1, FLAP, MODE_ADAPTIVE), (0, UNANTICIPATED, -1, -1, FLAP, MODE_UNANTICIPATED),
        (1, 5, ELEVATOR, SCALE_COMMAND, FLAP, MODE_REALLOCATED),
        (1, 5, ELEVATOR, GIVE_UP, FLAP, MODE_REALLOCATED),
        (1, 5, ELEVATOR, SUBTRACT_OFFSET, FLAP, MODE_ADAPTIVE),
        (1, 5, ELEVATOR, WAIT_FOR_SURFACE, FLAP, MODE_ADAPTIVE),
        (1, 5, ELEVATOR, GIVE_UP, -1, MODE_ADAPTIVE), (1, 6, RUDDER, GIVE_UP, FLAP, MODE_ADAPTIVE),
        (1, UNANTICIPATED, -1, -1, FLAP, MODE_UNANTICIPATED), (1, NOT_ISOLATED, -1, -1, FLAP, MODE_ADAPTIVE),
        (1, NOT_ISOLATED, ELEVATOR, GIVE_UP, FLAP, MODE_REALLOCATED),
    ],
)  # fmt: skip
def test_the_mode_that_the_diagnosis_asks_for(
    diagnoses_all_types, isolated, lead, accommodation_mode, stand_in, mode
):
    frame = new_frame(stand_in=stand_in)
    fdi = frame["fdi"]
    fdi["config"]["diagnoses_all_types"], fdi["isolation"]["estimator"]["surface"][4:8] = (
        diagnoses_all_types,
        range(4),
    )
    verdict = fdi["verdict"]
    (
        verdict["detected"],
        verdict["isolated_estimator"],
        verdict["target"],
        verdict["accommodation_mode"],
    ) = (
        1,
        isolated,
        lead,
        accommodation_mode,
    )
    assert asked_for(frame) == mode
    verdict["detected"] = 0
    assert asked_for(frame) == MODE_NOMINAL


def asked_for(frame):
    """The mode that the diagnosis asks for."""
    whole.assess_faults(frame)
    config, layout = frame["control"]["config"], frame["control"]["layout"]
    return accommodation.mode_from(config, layout, frame["fdi"]["verdict"], frame["assessment"])


@pytest.mark.parametrize(
    ("faults", "mode"),
    [
        ({}, MODE_NOMINAL), ({"present": 1}, MODE_ADAPTIVE),
        ({"present": 1, "Cm_alpha3": 0.1}, MODE_UNANTICIPATED),
        ({"present": 1, "effectiveness": (1, 0.5, 1, 1)}, MODE_REALLOCATED),
        ({"present": 1, "immovable": (0, 1, 0, 0)}, MODE_REALLOCATED),
        ({"present": 1, "effectiveness": (0.5, 1, 0.5, 0.5)}, MODE_ADAPTIVE),
        ({"effectiveness": (1, 0.5, 1, 1)}, MODE_NOMINAL),
    ],
)  # fmt: skip
def test_the_oracles_mode_is_that_of_the_true_fault(faults, mode):
    assert accommodation.true_mode(ELEVATOR, new_faults(**faults)) == mode


def test_the_oracle_takes_each_surface_for_what_it_is():
    faults = new_faults(present=1, effectiveness=(0.6, 0.7, 1, 1), immovable=(0, 1, 0, 0), effective=0.1)
    output = new_control()["surfaces"]["output"]
    targets = [accommodation.reported(output, None, faults, s, 0.2, True) for s in range(2)]
    assert targets == [0.6, 0.0]
    assert output["offset"][:2] == pytest.approx([0.1 - 0.6 * 0.2, 0.1])
    faults["present"] = 0
    accommodation.reported(output, None, faults, 0, 0.2, True)
    assert output["offset"][0] == 0.0


def compensated(law, detected=1, lead=-1, accommodation_mode=-1):
    frame = new_frame({"Cm_alpha3": 0.5}, law=law, fhat=9.0)
    fdi, prediction, measured = frame["fdi"], frame["prediction"], frame["measured"]
    prediction["design"], measured["y"][:5] = design_record()[0], (0.2, 0.0, 45.0, 1000.0, 0.3)
    fdi["verdict"]["detected"], fdi["fdae"]["network"]["output"] = detected, (0.1, 0.2, 0.3)
    fdi["verdict"]["target"], fdi["verdict"]["accommodation_mode"] = lead, accommodation_mode
    expected = unanticipated_pitch(prediction["design"], measured["y"], 0.5)
    return accommodated(frame)["unknown"].tolist(), float(expected)


def test_what_the_law_takes_the_unknown_for():
    assert compensated("adaptive")[0] == pytest.approx([0.1, 0.2, 0.3])
    assert compensated("adaptive", detected=0)[0] == [0.0] * 3
    assert compensated("nominal")[0] == [0.0] * 3
    assert compensated("adaptive", lead=ELEVATOR, accommodation_mode=WAIT_FOR_SURFACE)[0] == [0.0] * 3
    assert compensated("adaptive", lead=ELEVATOR, accommodation_mode=SUBTRACT_OFFSET)[0] == pytest.approx(
        [0.1, 0.2, 0.3]
    )
    assert compensated("adaptive", lead=AILERON, accommodation_mode=WAIT_FOR_SURFACE)[0] == [0.0] * 3
    known, expected = compensated("oracle-published")
    assert known == [0.0, expected, 0.0]
    assert expected != 0.0


@pytest.mark.parametrize("which", ["healthy", "immovable", "jammed", "moving jam", "abandoned"])
def test_a_surface_given_up_goes_to_its_trim(which):
    frame = new_frame({"immovable": (0, 0, 1, 0)}, law="oracle" if which == "immovable" else "adaptive")
    control, fdi = frame["control"], frame["fdi"]
    control["layout"]["trim"], out = 0.3, control["allocation"]["output"]
    surfaces = control["surfaces"]["output"]
    out["command"], out["saturated"], fdi["config"]["diagnoses_all_types"] = 0.1, 1, 1
    if "jam" in which:
        fdi["types"]["surface"]["accommodation"]["mode"][RUDDER] = GIVE_UP
        surfaces["effectiveness"][RUDDER] = 0.0 if which == "jammed" else 0.5
    surfaces["given_up"][RUDDER] = which == "abandoned"
    given_up(frame)
    up = which not in ("healthy", "moving jam")
    assert out["command"].tolist() == [0.1, 0.1, 0.3 if up else 0.1, 0.1]
    assert out["saturated"].tolist() == [1, 1, 0 if up else 1, 1]
    assert surfaces["authority_lost"] == up


def test_the_answer_of_the_observer_is_its_own_error_dynamics():
    """e' = a - dd; e is corrected by L_rate, dd by L_disturbance of the innovation."""
    memory, rng = record(OBSERVER_ERROR), np.random.default_rng(1)
    e = dd = 0.0
    for a in rng.normal(size=10):
        missed = e + DT * (a - dd)
        assert observer_response(memory, 1, a, 0.3, 2.0, DT) == pytest.approx(missed)
        e, dd = 0.7 * missed, dd + 2.0 * missed
    assert memory["rate"].tolist()[::2] == [0.0, 0.0]


def lost_rudder(theta, believed=1.0, frames=400, noise=0.0):
    """What is learnt of a rudder with this loss: its moment, and what the observer misses of it."""
    control, rng = new_control(), np.random.default_rng(2)
    law, observer = control["rejecting"], record(OBSERVER_ERROR)
    config, memory = law["config"], law["memory"]
    memory["L_rate"], memory["L_disturbance"], config["fading"] = 0.3, 2.0, rejecting.derive_fading(DT)
    for k in range(frames):
        given = np.zeros((3, 4))
        given[2, RUDDER] = 0.5 * np.sin(0.2 * k)
        unexplained = (theta - (believed - 1.0)) * given[2, RUDDER]
        missed = observer_response(observer, 2, unexplained, 0.3, 2.0, DT) + noise * rng.normal()
        rejecting.accumulate(config, memory, 2, believed, given[2, RUDDER], missed)
    return memory["sums"]


@pytest.mark.parametrize("believed", [1.0, 0.6])
@pytest.mark.parametrize("theta", [-0.3, -0.95])
def test_what_is_left_is_found_by_least_squares(theta, believed):
    """Without noise exactly, but for the share of the diagnosis' own estimate, whose weight follows."""
    found = lost_rudder(theta, believed)
    assert found["product"][2] == pytest.approx(theta * found["square"][2], rel=1e-6)
    assert found["innovation"][2] == pytest.approx(theta**2 * found["square"][2], rel=1e-6)
    assert found["frames"][2] == pytest.approx(
        (1 - (1 - rejecting.derive_fading(DT)) ** 400) / rejecting.derive_fading(DT)
    )
    prior = found["innovation"][2] / found["frames"][2] / 0.2**2
    share = prior / (prior + found["square"][2])
    expected = 1.0 + (1 - share) * theta + share * -0.5
    assert rejecting.effectiveness_seen(found, 2, 0.5) == pytest.approx(expected, rel=1e-6)
    assert bool(rejecting.is_effective(found, (0, 1, 2), RUDDER, 0.1)) == (theta > -0.9)
    assert rejecting.effectiveness_seen(found, 1, 0.5) == 0.5  # of pitch nothing has been seen


@pytest.mark.parametrize(
    ("named", "seen", "kept"),
    [
        (0.3, 0.6, 0.6),
        (0.3, 0.2, 0.3),
        (0.3, 1.5, 1.0),
        (0.01, 0.02, 0.02),
        (0.01, 0.06, 0.1),
        (0.04, 0.05, 0.1),
    ],
)
def test_the_larger_of_both_estimates_is_believed(named, seen, kept):
    found = new_control()["rejecting"]["memory"]["sums"]
    found["frames"], found["square"], found["named"], found["innovation"] = 10.0, 4.0, 1, 0.0
    found["product"] = 4.0 * (seen - 1.0)
    assert rejecting.larger_estimate(found, named, 2, 0.1) == pytest.approx(kept)


def test_what_was_seen_before_a_surface_was_named_counts_no_longer():
    found = new_control()["rejecting"]["memory"]["sums"]
    found["frames"], found["square"], found["product"], found["innovation"] = 10.0, 4.0, -0.4, 1.0
    assert rejecting.larger_estimate(found, 0.3, 2, 0.1) == pytest.approx(0.3)
    assert found["named"].tolist() == [0, 0, 1]
    assert (found["square"][2], found["product"][2]) == (0.0, 0.0)
    assert found["square"][0] == 4.0


def test_the_schedule_has_the_fastest_loop_of_each_point_and_its_observer():
    law = np.zeros(1, rejecting_dtype(4))[0]["config"]
    qdyn = np.linspace(500.0, 1500.0, N_POINTS)
    G = np.zeros((N_POINTS, 3, 4))
    G[:, 0, AILERON], G[:, 1, ELEVATOR], G[:, 2, RUDDER], G[:, 1, FLAP] = (
        -qdyn / 100,
        -qdyn / 80,
        -qdyn / 400,
        qdyn / 500,
    )
    approach = np.array([0.3, 0.3, 0.3, 0.05])
    gyros = [rejecting.Gyro(), rejecting.Gyro(1e-3), rejecting.Gyro(1e-3, 0.01, 0.2)]
    rejecting.set_up(
        law, dt_s=DT, substeps=4, approach=approach, speed_rad_s=np.full(4, 0.05), gyros=gyros,
        margin=(6.0, 45.0), qdyn=qdyn, G=G, carriers=[(0, AILERON), (1, ELEVATOR), (2, RUDDER), (1, FLAP)],
    )  # fmt: skip
    whole = 1.0 - (1.0 - approach) ** 4  # four JSBSim frames
    assert law["share"] == 0.25
    assert law["qdyn"] == pytest.approx(qdyn)
    assert law["lead"] == pytest.approx(np.minimum(1.0 / whole, 4.0))
    assert law["fading"] == pytest.approx(1.0 - np.exp(-DT / 5.0))
    for row, (axis, surface) in enumerate([(0, AILERON), (1, ELEVATOR), (2, RUDDER), (1, FLAP)]):
        gyro = gyros[axis]
        loop = rejecting.Loop(DT, 0.25, whole[surface], min(1 / whole[surface], 4.0), gyro.delay_s, gyro.keep)
        for j in range(N_POINTS):
            s = rejecting.fastest(loop, (6.0, 45.0), gyro.noise_rad_s, G[j, axis, surface], 0.05)
            assert law["Kp_at"][row, j] == pytest.approx(s)
            pole = np.exp(-6.5 * s * DT)
            assert law["L_rate_at"][row, j] == pytest.approx(1.0 - pole**2)
            assert law["L_disturbance_at"][row, j] == pytest.approx((1.0 - pole) ** 2 / DT)
    # without noise a loop is as fast as its margins let it, wherever it flies; with it, faster for a larger G
    assert np.ptp(law["Kp_at"][0]) == 0.0
    assert (np.diff(law["Kp_at"][2]) > 0.0).all()


@pytest.mark.parametrize(
    ("law", "fixed", "kept"),
    [
        ("fault-tolerant", False, 0.5), ("fault-tolerant", True, 0.0), ("oracle", False, 0.2),
        ("fault-tolerant-published", False, 0.1), ("fault-tolerant-published", True, 0.0),
    ],
)  # fmt: skip
def test_only_what_may_still_act_is_taken_for_what_the_observer_sees(law, fixed, kept):
    """The verdict leaves an aileron a tenth, the observer sees a half; a fixed one gives nothing."""
    true = {"present": 1, "effectiveness": (0.2, 1.0, 1.0, 1.0)}
    frame = new_frame(true, law=law, effectiveness_step=1.0)
    fdi, control = frame["fdi"], frame["control"]
    fdi["verdict"]["detected"], fdi["verdict"]["isolated_estimator"] = 1, 0
    fdi["isolation"]["estimator"]["surface"][:4], fdi["isolation"]["estimator"]["theta"][0] = range(4), -0.9
    fdi["types"]["surface"]["accommodation"]["mode"][AILERON], fdi["config"]["diagnoses_all_types"] = (
        GIVE_UP if fixed else -1,
        fixed,
    )
    found = control["rejecting"]["memory"]["sums"]
    found["named"], found["frames"], found["square"], found["product"] = 1, 1.0, 2.0, -1.0
    frame["prediction"]["design"], frame["measured"]["y"][:4] = design_record()[0], (0.2, 0.0, 45.0, 1000.0)
    surfaces = accommodated(frame)
    assert surfaces["target"] == pytest.approx([kept, 1.0, 1.0, 1.0])
    assert surfaces["effectiveness"] == pytest.approx(surfaces["target"])
    assert not control["rejecting"]["memory"]["withdrawn"].any()


def test_what_no_verdict_names_is_whole_and_a_plug_ins_estimates_count_from_its_alarm_on():
    frame = new_frame(target=0.3, offset=0.2, lag=0.1, effectiveness_step=0.25)
    verdict = frame["fdi"]["verdict"]
    verdict["isolated_estimator"], verdict["has_effectiveness"] = NOT_ISOLATED, 1
    verdict["effectiveness"] = 0.9, 0.4, 1.0, 0.8
    surfaces = accommodated(frame)
    assert surfaces["target"].tolist() == [1.0] * 4
    assert not surfaces["offset"].any()
    assert not surfaces["lag"].any()
    verdict["detected"] = 1
    surfaces = accommodated(frame)
    assert surfaces["target"].tolist() == [0.9, 0.4, 1.0, 0.8]
    assert surfaces["effectiveness"] == pytest.approx([0.9, 0.75, 1.0, 0.8])  # by no more than a step
