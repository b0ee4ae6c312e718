"""A hand-over taken back: pitch returns to the elevator, without a leap, once nobody names it any more.

The published unanticipated fault is at first taken for the elevator by the published thresholds [Zhang2005,
Fig. 7]; a detector that knows names a true loss and takes the name back.
"""

import numpy as np
import pytest

from beaver_ftc.control.accommodation import MODE_UNANTICIPATED, MODES
from beaver_ftc.diagnosis import Verdict
from beaver_ftc.loop.loop import Loop
from beaver_ftc.results.metrics import metrics
from beaver_ftc.studies.reproduce.choices import scenario
from flying import loss

UNANTICIPATED = {"type": "unanticipated", "Cm_alpha3": 10, "at_s": 12.0}
OURS = {"fdi.scheme": "adaptive-estimators", "fdi.thresholds": "published", "fdi.sharpen": "none"}
PUBLISHED, DEFAULT = "fault-tolerant-published", "fault-tolerant"


def landed(changes, detector=None):
    """(metrics, log by column, the record of the flight at its end)."""
    loop = Loop(scenario("handing-back", changes), detector=detector)
    log = np.concatenate([rows.copy() for rows in loop.chunks()])
    return metrics(loop.land()), dict(zip(loop.columns, log.T, strict=True)), loop.frames[0]


def unanticipated(law, airspeed_mps, **changes):
    return landed(
        {"faults": [UNANTICIPATED], "control.law": law, "initial.airspeed_mps": airspeed_mps} | OURS | changes
    )


@pytest.mark.parametrize("law", [PUBLISHED, DEFAULT])
def test_the_flight_of_fig_7_ends_with_the_elevator_flying(law):
    document, log, frame = unanticipated(law, 45.0)
    assert MODES[frame["supervisor"]["mode"]] == "unanticipated"
    assert [change["mode"] for change in document["supervisor"]][-2:] == ["reallocated", "unanticipated"]
    assert frame["control"]["allocation"]["output"]["hand_over"] == 0.0
    assert document["departure"] is None
    back = log["t_s"] > document["supervisor"][-1]["time_s"] + 1.1
    assert np.ptp(log["flap_cmd_rad"][back]) == 0.0
    assert np.ptp(log["elevator_cmd_rad"][back]) > np.radians(2.0)
    (gone,) = document["isolation"]["withdrawn"]
    assert gone["fault"] == "elevator"
    assert gone["to_s"] == document["isolation"]["time_s"]


class Knows:
    """Names a loss of the elevator from 12 s on, and from 16 s on says that it was none."""

    def reset(self, context):
        pass

    def step(self, measured, command):
        if measured.t_s < 12.0:
            return Verdict()
        if measured.t_s < 16.0:
            return Verdict(True, "q", "elevator", "loss_of_effectiveness", -0.4)
        return Verdict(True, "q", "unanticipated", "unanticipated")


@pytest.mark.parametrize("law", [PUBLISHED, DEFAULT])
def test_pitch_is_handed_back_without_a_leap(law):
    """Back in a second, and with no surface faster than actuators follow (60 deg/s [SL03])."""
    document, log, _ = landed({"faults": [loss(at_s=12.0)], "control.law": law, "duration_s": 20.0}, Knows())
    t = log["t_s"]
    assert np.all(log["mode"][t > 16.01] == MODE_UNANTICIPATED)
    for surface in ("elevator", "flap"):
        speeds = np.degrees(np.abs(np.diff(log[f"{surface}_cmd_rad"]))) * 100.0
        assert 0.0 < speeds[t[1:] > 15.99].max() < 60.0
    trimmed = log["flap_cmd_rad"][0]
    assert log["flap_cmd_rad"][t < 17.0][-1] == pytest.approx(trimmed, abs=np.radians(0.01))
    assert np.all(log["flap_cmd_rad"][t > 17.1] == trimmed)
    because = "the detector gave another verdict"
    gone = {"fault": "elevator", "from_s": 12.0, "to_s": 16.0, "because": because}
    assert document["isolation"]["withdrawn"] == [gone]
    assert document["isolation"]["so_far"] is None  # a plug-in says itself how sure it is
