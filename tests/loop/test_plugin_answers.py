"""What a plug-in answers is checked in its very frame, and it alone is to blame."""

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc import SimulationFailed, Verdict

SURFACES = ("aileron", "elevator", "rudder", "flap")


class Answers:
    """A detector or a law that answers what it was given; from an instant on it fails."""

    def __init__(self, answer, fails_at_s=np.inf):
        self.answer, self.fails_at_s = answer, fails_at_s

    def reset(self, context):
        pass

    def step(self, measured, *more):
        if measured.t_s > self.fails_at_s:
            raise LookupError("no more")
        return self.answer


def flown(detector=None, law=None):
    keys = {"fdi": {"scheme": "augmented-ekf"}, "control": {"law": "lqr" if law else "fault-tolerant"}}
    return bf.fly({"name": "x", "duration_s": 0.2, **keys}, detector=detector, law=law)


NAMES = "allowed: None, unanticipated, aileron, elevator, rudder, flap"
REFUSED = [
    (True, "step returned bool, allowed: a Verdict"),
    (Verdict(axis="yaw"), "verdict.axis is 'yaw', allowed: p, q, r or None"),
    (Verdict(isolated="nose"), f"verdict.isolated is 'nose', {NAMES}"),
    (Verdict(detected=np.nan), "verdict.detected is nan, allowed: True or False"),
    (Verdict(isolated=["flap"]), f"verdict.isolated is ['flap'], {NAMES}"),
    (Verdict(type=3), "verdict.type is 3, allowed: a str or None"),
    (Verdict(statistic=1j), "verdict.statistic is 1j, allowed: a number"),
    (Verdict(candidates=(1,)), "verdict.candidates is (1,), allowed: a tuple of str"),
    (Verdict(effectiveness=[1, 1, 1, 1j]), "verdict.effectiveness has type list, allowed: 4 numbers"),
    (Verdict(estimate=float("inf")), "verdict.estimate is inf, allowed: a finite number"),
    (Verdict(estimate=10**400), f"verdict.estimate is {10**400}, allowed: a finite number"[:500]),
    (Verdict(effectiveness=[1, 2, 3]), "verdict.effectiveness has shape (3,), allowed: 4 numbers"),
    (Verdict(effectiveness=[1, 2, 3, np.nan]),
     "verdict.effectiveness is not finite: [1.0, 2.0, 3.0, nan]"),
]  # fmt: skip


@pytest.mark.parametrize(("answer", "says"), REFUSED)
def test_an_answer_that_is_no_verdict(answer, says):
    with pytest.raises(SimulationFailed) as failed:
        flown(Answers(answer))
    assert str(failed.value) == f"plug-in augmented-ekf at 0 s: {says}"


@pytest.mark.parametrize(
    "verdict",
    [
        Verdict(),
        Verdict(True, "q", "elevator", None, -0.5),
        Verdict(True, "r", "flap", None, 1),
        Verdict(1, "p", "unanticipated", None, np.float32(0.25)),
    ],
)
def test_what_is_taken_of_a_verdict(verdict):
    found = flown(Answers(verdict))
    assert (found.detection.detected, found.detection.axis) == (bool(verdict.detected), verdict.axis)
    assert (found.isolation.fault, found.isolation.estimate) == (verdict.isolated, verdict.estimate)


@pytest.mark.parametrize(
    ("kind", "size", "given", "expected"),
    [
        (None, None, (1, 0.5, 0.25, 0), [1.0, 0.5, 0.25, 0.0]),
        ("stuck", 0.1, None, [1.0] * 4),  # the size is an angle
    ],
)
def test_the_law_is_given_the_effectiveness_that_a_detector_answers(kind, size, given, expected):
    log = flown(Answers(Verdict(True, "q", "elevator", kind, size, effectiveness=given))).log
    assert [log[f"{s}_effectiveness_estimate"].iloc[-1] for s in SURFACES] == expected


@pytest.mark.parametrize(
    ("detector", "law", "blamed"),
    [
        (Answers(Verdict(), 0.045), Answers(np.zeros(4)), "augmented-ekf"),
        (Answers(Verdict()), Answers(np.zeros(4), 0.045), "lqr"),
    ],
)
def test_who_fails_in_flight_is_blamed_and_when(detector, law, blamed):
    with pytest.raises(SimulationFailed) as failed:
        flown(detector, law)
    assert str(failed.value) == f"plug-in {blamed} at 0.05 s: step raised LookupError: no more"
