"""Both ends of the line, without a process between: what the grader sends is what a submission is shown."""

from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.control import Reference
from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc_live.challenge import line, pilot
from telling import numbers

SURFACES = ("aileron", "elevator", "rudder", "flap")
MEASURED = Measured(
    2.5,
    *(numbers(*of, seed=seed) for seed, of in enumerate([(3,), (5,), (3,), (3, 4), (3,), (3,), (3,)])),
    altitude_m=1234.5,
)
REFERENCE = Reference(*(numbers(3, seed=seed) for seed in (6, 7, 8)))


def submitted(kind, answer=()):
    """A submission of this kind that gives an answer, and what it was asked: kind, time, numbers."""
    code, asked = object.__new__(kind), []
    code.surfaces, code._sizes = SURFACES, (5, 4)

    def respond(*question):
        asked.append(question)
        return np.array(answer)

    code.asked = respond
    return code, asked


def assert_same(found, expected):
    assert type(found) is type(expected)
    for name, one, other in zip(expected._fields, found, expected, strict=True):
        np.testing.assert_array_equal(one, other, err_msg=name)


def test_a_detector_is_shown_what_is_measured_and_the_command():
    command = numbers(4, seed=9)
    code, asked = submitted(line.SubmittedDetector, [0.0] * 11)
    code.step(MEASURED, command)
    ((kind, t_s, shown),) = asked
    assert (kind, t_s) == (pilot.VERDICT, 2.5)
    measured, (rest,) = pilot.frame_of(np.concatenate(shown), 5, SURFACES)
    assert_same(measured, MEASURED)
    np.testing.assert_array_equal(rest, command)


def test_a_law_is_shown_what_is_measured_the_reference_and_the_verdict():
    said = Verdict(True, "q", "rudder", None, -0.3, np.array([0.9, 0.8, 0.7, 0.6]), 1.5)
    command = numbers(4, seed=9)
    code, asked = submitted(line.SubmittedLaw, command)
    np.testing.assert_array_equal(code.step(MEASURED, REFERENCE, said), command)
    ((kind, t_s, shown),) = asked
    assert (kind, t_s) == (pilot.COMMAND, 2.5)
    measured, (rest,) = pilot.frame_of(np.concatenate(shown), 5, SURFACES)
    reference, verdict = pilot.law_given(rest, SURFACES)
    for found, expected in ((measured, MEASURED), (reference, REFERENCE), (verdict, said)):
        assert_same(found, expected)
    code, _ = submitted(line.SubmittedLaw, [0.1, np.nan, 0.2, 0.3])
    with pytest.raises(line.Mistake, match=r"its command is not finite: 0\.1, nan, 0\.2, 0\.3"):
        code.step(MEASURED, REFERENCE, said)


def asking(times=1):
    """The design model as a submission has it; what it asks goes to the grader's end at once."""
    code, _ = submitted(line.SubmittedCode)
    code._deadline, answers = 100.0, []
    code._model = SimpleNamespace(
        f=lambda x, y: 2.0 * x + y[:3], G=lambda y: np.arange(12.0).reshape(3, 4) * y[4]
    )
    code._send = answers.append

    def send(kind, content):
        assert kind == pilot.ASKS
        code._evaluate(content, times)

    return pilot.AskedModel(SimpleNamespace(send=send, take=answers.pop), 4), code


@pytest.mark.parametrize("shape", [(3,), (1, 3), (4, 3)])
def test_the_design_model_answers_over_the_line_what_it_answers_here(shape):
    model, code = asking()
    x, y = numbers(*shape, seed=1), numbers(5, seed=2)
    np.testing.assert_array_equal(model.f(x, y), 2.0 * x + y[:3])
    np.testing.assert_array_equal(model.G(y), np.arange(12.0).reshape(3, 4) * y[4])
    assert 100.0 <= code._deadline < 101.0  # moved by what the grader itself took


@pytest.mark.parametrize(("x", "y"), [((3,), (4,)), ((3,), (6,)), ((4,), (5,)), ((0,), (5,))])
def test_what_fits_neither_x_nor_y_is_refused(x, y):
    model, _ = asking()
    with pytest.raises(line.Mistake, match=r"allowed|x \(3,\) or \(n, 3\), y \(5,\)"):
        model.f(np.ones(x), np.ones(y))
