"""Supervisor, oracle, accommodation and what is left of a surface: a decision at a time."""

import numpy as np
import pytest

import law_records
from beaver_ftc.compiled import fill
from beaver_ftc.control import accommodation
from beaver_ftc.control.accommodation import (
    MODE_ADAPTIVE,
    MODE_NOMINAL,
    MODE_REALLOCATED,
    MODE_UNANTICIPATED,
)
from beaver_ftc.control.laws.effectiveness_estimator import OBSERVER_ERROR, observer_response
from beaver_ftc.control.laws.evidence import accumulate, derive_fading, effectiveness_seen, is_effective
from beaver_ftc.diagnosis.conclusion import NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.diagnosis.types import GIVE_UP, SCALE_COMMAND, SUBTRACT_OFFSET, WAIT_FOR_SURFACE
from beaver_ftc.loop import frame as whole
from beaver_ftc.loop.assembly import frame_dtype
from law_records import ELEVATOR, FLAP, RUDDER, put

DT = 0.02


def record(dtype):
    return np.zeros(1, dtype).view(np.recarray)[0]


def new_control(**fields):
    control = law_records.new_control(main=(0, 1, 2), stand_in=FLAP, dt=DT, law="fault-tolerant-published")
    return put(control, **({"effectiveness": 1.0, "least_effectiveness": 0.1} | fields))


def new_frame(stand_in):
    """A frame of a law with this stand-in; of the diagnosis and the truth, nothing but whole surfaces."""
    frame = record(frame_dtype(4))
    frame["control"], frame["faults"]["effectiveness"] = new_control(stand_in=stand_in), 1.0
    frame["fdi"]["types"]["surface"]["accommodation"]["mode"] = -1
    return frame


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
    frame = new_frame(stand_in)
    fdi = frame["fdi"]
    fill(fdi["config"], diagnoses_all_types=diagnoses_all_types)
    fdi["isolation"]["estimator"]["surface"][4:8] = range(4)
    said = {"isolated_estimator": isolated, "target": lead, "accommodation_mode": accommodation_mode}
    fill(fdi["verdict"], detected=1, **said)
    assert asked_for(frame) == mode
    fdi["verdict"]["detected"] = 0
    assert asked_for(frame) == MODE_NOMINAL


def asked_for(frame):
    """The mode that the diagnosis asks for."""
    whole.assess_faults(frame)
    config, layout = frame["control"]["config"], frame["control"]["layout"]
    return accommodation.mode_from(config, layout, frame["fdi"]["verdict"], frame["assessment"])


def lost_rudder(theta, believed):
    """What is learnt of a rudder with this loss: its moment, and what the observer misses of it."""
    control = new_control()
    law, observer = control["rejecting"], record(OBSERVER_ERROR)
    config, memory = law["config"], law["memory"]
    memory["L_rate"], memory["L_disturbance"], config["fading"] = 0.3, 2.0, derive_fading(DT)
    for k in range(400):
        given = np.zeros((3, 4))
        given[2, RUDDER] = 0.5 * np.sin(0.2 * k)
        unexplained = (theta - (believed - 1.0)) * given[2, RUDDER]
        missed = observer_response(observer, 2, unexplained, 0.3, 2.0, DT)
        accumulate(config, memory, 2, believed, given[2, RUDDER], missed)
    return memory["sums"]


@pytest.mark.parametrize("believed", [1.0, 0.6])
@pytest.mark.parametrize("theta", [-0.3, -0.95])
def test_what_is_left_is_found_by_least_squares(theta, believed):
    """Without noise exactly, but for the share of the diagnosis' own estimate, whose weight follows."""
    found = lost_rudder(theta, believed)
    assert found["product"][2] == pytest.approx(theta * found["square"][2], rel=1e-6)
    assert found["innovation"][2] == pytest.approx(theta**2 * found["square"][2], rel=1e-6)
    assert found["frames"][2] == pytest.approx((1 - (1 - derive_fading(DT)) ** 400) / derive_fading(DT))
    prior = found["innovation"][2] / found["frames"][2] / 0.2**2
    share = prior / (prior + found["square"][2])
    expected = 1.0 + (1 - share) * theta + share * -0.5
    assert effectiveness_seen(found, 2, 0.5) == pytest.approx(expected, rel=1e-6)
    assert bool(is_effective(found, (0, 1, 2), RUDDER, 0.1)) == (theta > -0.9)
    assert effectiveness_seen(found, 1, 0.5) == 0.5  # of pitch nothing has been seen
