"""What a plug-in answers is checked in its very frame, and it alone is to blame."""

import numpy as np
import pytest

from beaver_ftc.diagnosis import Verdict
from beaver_ftc.diagnosis.state import NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.loop.loop import Loop
from beaver_ftc.scenario.schema import Scenario


class Answers:
    """A detector or a law that answers what it was given, and keeps what it was asked."""

    def __init__(self, answer=None, error=None):
        self.answer, self.error, self.contexts, self.asked = answer, error, [], []

    def reset(self, context):
        self.contexts.append(context)

    def step(self, *asked):
        self.asked.append(asked)
        if self.error is not None:
            raise self.error
        return self.answer


def _scenario(**keys):
    return Scenario.model_validate({"name": "x", "duration_s": 1, **keys})


@pytest.fixture(scope="module")
def frame():
    """A frame with a detector and a law, of a flight that has a scheme and a law of those names."""
    keys = {"fdi": {"scheme": "augmented-ekf"}, "control": {"law": "nominal", "options": {}}}
    loop = Loop(_scenario(**keys), Answers(Verdict()), Answers(np.zeros(4)))
    return loop.plugin_frame, loop.frames[0]["fdi"]["plugin_verdict"]


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (True, "step returned bool, allowed: a Verdict"),
        (Verdict(axis="yaw"), "verdict.axis is 'yaw', allowed: p, q, r or None"),
        (Verdict(isolated="nose"), "verdict.isolated is 'nose', allowed: None, unanticipated, aileron, "
                                   "elevator, rudder, flap"),
        (Verdict(detected=np.nan), "verdict.detected is nan, allowed: True or False"),
        (Verdict(isolated=["flap"]), "verdict.isolated is ['flap'], allowed: None, unanticipated, aileron, "
                                     "elevator, rudder, flap"),
        (Verdict(type=3), "verdict.type is 3, allowed: a str or None"),
        (Verdict(statistic=1j), "verdict.statistic is 1j, allowed: a number"),
        (Verdict(candidates=(1,)), "verdict.candidates is (1,), allowed: a tuple of str"),
        (Verdict(effectiveness=[1, 1, 1, 1j]), "verdict.effectiveness has type list, allowed: 4 numbers"),
        (Verdict(estimate=float("inf")), "verdict.estimate is inf, allowed: a finite number"),
        (Verdict(effectiveness=[1, 2, 3]), "verdict.effectiveness has shape (3,), allowed: 4 numbers"),
        (Verdict(effectiveness=[1, 2, 3, np.nan]),
         "verdict.effectiveness is not finite: [1.0, 2.0, 3.0, nan]"),
    ],
)  # fmt: skip
def test_an_answer_that_is_no_verdict(frame, answer, says):
    plugins, taken = frame
    with pytest.raises(SimulationFailed) as failed:
        plugins._checked(answer, taken)
    assert str(failed.value) == f"plug-in augmented-ekf at 0 s: {says}"


@pytest.mark.parametrize(
    ("verdict", "taken"),
    [
        (Verdict(), (0, 0, NOT_ISOLATED, 0.0, 0)),
        (Verdict(True, "q", "elevator", None, -0.5), (1, 1, 1, -0.5, 0)),
        (Verdict(True, "r", "flap", None, 1), (1, 2, 3, 1.0, 0)),
        (Verdict(1, "p", "unanticipated", None, np.float32(0.25)), (1, 0, UNANTICIPATED, 0.25, 0)),
        (Verdict(effectiveness=(1, 0.5, 0.25, 0)), (0, 0, NOT_ISOLATED, 0.0, 1)),
    ],
)
def test_what_is_taken_of_a_verdict(frame, verdict, taken):
    plugins, record = frame
    record["effectiveness"] = 7.0
    assert plugins._checked(verdict, record) is verdict
    found = tuple(
        record[name].item() for name in ("detected", "axis", "isolated", "theta", "has_effectiveness")
    )
    assert found == taken
    expected = verdict.effectiveness if taken[-1] else [7.0] * 4
    assert record["effectiveness"].tolist() == list(expected)


class Late(Answers):
    """Fails from 0.05 s on."""

    def step(self, measured, *more):
        if measured.t_s > 0.045:
            raise LookupError("no more")
        return self.answer


@pytest.mark.parametrize(
    ("detector", "law", "blamed"),
    [
        (Late(Verdict()), Answers(np.zeros(4)), "augmented-ekf"),
        (Answers(Verdict()), Late(np.zeros(4)), "lqr"),
    ],
)
def test_who_fails_in_flight_is_blamed_and_when(detector, law, blamed):
    loop = Loop(_scenario(fdi={"scheme": "augmented-ekf"}, control={"law": "lqr"}), detector, law)
    with pytest.raises(SimulationFailed) as failed:
        loop.fly_chunk(0, 20)
    assert str(failed.value) == f"plug-in {blamed} at 0.05 s: step raised LookupError: no more"
