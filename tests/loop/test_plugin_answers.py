"""What a plug-in answers is checked in its very frame, and it alone is to blame."""

import numpy as np
import pytest

from beaver_ftc.diagnosis import Verdict
from beaver_ftc.diagnosis.state import NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.documents.errors import BadInput, SimulationFailed, Stopped
from beaver_ftc.loop.loop import Loop
from beaver_ftc.loop.plugin_frame import PluginFrame
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
        (None, "step returned NoneType, allowed: a Verdict"),
        (Verdict(axis="yaw"), "verdict.axis is 'yaw', allowed: p, q, r or None"),
        (Verdict(isolated="nose"), "verdict.isolated is 'nose', allowed: None, unanticipated, aileron, "
                                   "elevator, rudder, flap"),
        (Verdict(detected=np.ones(2)), "verdict.detected is array([1., 1.]), allowed: True or False"),
        (Verdict(detected="no"), "verdict.detected is 'no', allowed: True or False"),
        (Verdict(detected=np.nan), "verdict.detected is nan, allowed: True or False"),
        (Verdict(axis=["q"]), "verdict.axis is ['q'], allowed: p, q, r or None"),
        (Verdict(isolated=["flap"]), "verdict.isolated is ['flap'], allowed: None, unanticipated, aileron, "
                                     "elevator, rudder, flap"),
        (Verdict(type=3), "verdict.type is 3, allowed: a str or None"),
        (Verdict(statistic="x"), "verdict.statistic is 'x', allowed: a number"),
        (Verdict(statistic=1j), "verdict.statistic is 1j, allowed: a number"),
        (Verdict(statistic=np.ones(2)), "verdict.statistic is array([1., 1.]), allowed: a number"),
        (Verdict(candidates=None), "verdict.candidates is None, allowed: a tuple of str"),
        (Verdict(candidates="flap"), "verdict.candidates is 'flap', allowed: a tuple of str"),
        (Verdict(candidates=(1,)), "verdict.candidates is (1,), allowed: a tuple of str"),
        (Verdict(effectiveness=[1, 1, 1, 1j]), "verdict.effectiveness has type list, allowed: 4 numbers"),
        (Verdict(effectiveness=["1"] * 4), "verdict.effectiveness has type list, allowed: 4 numbers"),
        (Verdict(estimate="x"), "verdict.estimate is 'x', allowed: a finite number"),
        (Verdict(estimate=float("inf")), "verdict.estimate is inf, allowed: a finite number"),
        (Verdict(effectiveness=[1, 2, 3]), "verdict.effectiveness has shape (3,), allowed: 4 numbers"),
        (Verdict(effectiveness=[]), "verdict.effectiveness has type list, allowed: 4 numbers"),
        (Verdict(effectiveness="all"), "verdict.effectiveness has type str, allowed: 4 numbers"),
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


def test_errors_are_put_in_one_line_and_bounded(frame):
    plugins, _ = frame
    raising = Answers(error=ValueError("a\n  b" + "c" * 600))
    with pytest.raises(SimulationFailed) as failed:
        plugins._ask("mine", raising.step)
    says = str(failed.value)
    assert says.startswith("plug-in mine at 0 s: step raised ValueError: a bccc")
    assert len(says) == len("plug-in mine at 0 s: ") + 500
    with pytest.raises(SimulationFailed, match="step raised SystemExit: 3"):
        plugins._ask("mine", Answers(error=SystemExit(3)).step)
    with pytest.raises(BadInput, match=r"^as it says$"):
        plugins._ask("mine", Answers(error=BadInput("as it says")).step)
    for failure in (GeneratorExit("g"), BaseException("g")):
        with pytest.raises(SimulationFailed, match=f"step raised {type(failure).__name__}: g"):
            plugins._ask("mine", Answers(error=failure).step)


@pytest.mark.parametrize("end", [KeyboardInterrupt(), Stopped(143)])
def test_a_signal_that_ends_the_command_is_no_failure_of_the_code_it_arrives_in(frame, end):
    plugins, _ = frame
    with pytest.raises(type(end)) as ended:
        plugins._ask("mine", Answers(error=end).step)
    assert ended.value is end


def test_each_is_told_of_its_own_options_once_and_one_that_goes_on_not_again():
    law = Answers(np.zeros(4))
    keys = {"fdi": {"scheme": "augmented-ekf", "options": {"alarm": 2.0}},
            "control": {"law": "lqr", "options": {"q": 3.0}}}  # fmt: skip
    detector = Answers(Verdict())
    loop = Loop(_scenario(**keys), detector, law)
    assert [dict(context.options) for context in detector.contexts + law.contexts] == [
        {"alarm": 2.0},
        {"q": 3.0},
    ]
    begun = loop.plugin_frame
    assert begun._names == ("augmented-ekf", "lqr")
    given = loop.frames, loop.scenario, loop.trimmed
    PluginFrame(*given, detector, law, begun)
    assert (len(detector.contexts), len(law.contexts)) == (1, 1)
    PluginFrame(*given, Answers(Verdict()), law, begun)
    PluginFrame(*given, detector, Answers(), begun)
    assert (len(detector.contexts), len(law.contexts)) == (1, 1)
    PluginFrame(*given, detector, law, None)
    assert (len(detector.contexts), len(law.contexts)) == (2, 2)
    unnamed = PluginFrame(loop.frames, _scenario(), loop.trimmed, detector, law, begun)
    assert unnamed._names == ("Answers", "Answers")


class Tolerant(Answers):
    fault_tolerant = True


@pytest.mark.parametrize(
    ("detector", "law", "named", "expected"),
    [
        (None, Answers(np.zeros(4)), "fault-tolerant", (1, (0, 0), 0)),
        (None, Tolerant(np.zeros(4)), "oracle", (1, (1, 0), 0)),
        (Answers(Verdict()), None, "fault-tolerant", (0, None, 0)),
        (Answers(Verdict()), None, "oracle", (0, (1, 1), 1)),
    ],
)
def test_what_a_record_is_made_ready_for(detector, law, named, expected):
    frames = Loop(_scenario(control={"law": named}), detector, law).frames
    config, power = frames["control"]["config"][0], frames["control"]["power"]["config"]["enabled"][0]
    of_law = config["uses_verdict"], config["informed"]
    assert (
        frames["fdi"]["config"]["enabled"][0],
        of_law if expected[1] is not None else None,
        power,
    ) == expected


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


def test_every_stage_is_called_as_machine_code():
    """A dispatcher would look up the type of the record at each call: thirty times a frame's time."""
    for detector, law, called in (
        (Answers(Verdict()), None, {"begin", "diagnose", "decide", "command", "finish"}),
        (None, Answers(np.zeros(4)), {"begin", "diagnose", "decide", "take_command", "finish"}),
    ):
        loop = Loop(_scenario(duration_s=0.1), detector, law)
        assert sum(len(rows) for rows in loop.chunks()) == 10
        stages = loop.plugin_frame._direct
        assert {stage.__name__ for stage in stages} == called
        assert {type(code) for code in stages.values()} == {type(len)}
