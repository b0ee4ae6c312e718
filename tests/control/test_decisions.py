"""Supervisor, oracle, accommodation and what is left of a surface: a decision at a time."""

import numpy as np
import pytest

import law_records
from beaver_ftc.control import accommodation, allocation
from beaver_ftc.control.accommodation import (
    MODE_ADAPTIVE,
    MODE_NOMINAL,
    MODE_REALLOCATED,
    MODE_UNANTICIPATED,
)
from beaver_ftc.control.laws import rejecting
from beaver_ftc.control.laws.rejecting import OBSERVER_ERROR, observer_response
from beaver_ftc.design.model import design_record
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
