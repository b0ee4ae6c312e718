"""Both ends of the line, without a process between them: what the grader sends is what the pilot unpacks."""

import os
import pickle
import struct
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


def test_an_answer_has_as_many_numbers_as_its_kind():
    """A command one a surface; a verdict seven, and an effectiveness of each surface."""
    code, _ = submitted(line.SubmittedCode)
    assert [code._length(kind) for kind in (pilot.COMMAND, pilot.VERDICT)] == [8 * 4, 8 * (7 + 4)]


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


def test_a_thousand_questions_in_a_frame_are_allowed():
    asking(1000)[0].G(np.ones(5))
    with pytest.raises(line.Barred, match="more than 1000 times in a frame"):
        asking(1001)[0].G(np.ones(5))


@pytest.mark.parametrize(
    ("status", "late", "last", "says"),
    [
        (None, False, False, "closes the line to the grader, at 2.5 s"),
        (0, False, False, "its process ended, status 0, at 2.5 s"),
        (3, False, False, "its process ended, status 3, at 2.5 s"),
        (-9, False, False, "its process was ended by SIGKILL, at 2.5 s"),
        (-9, True, False, "no answer in time, at 2.5 s"),
        (-9, True, True, "the 60 s for all its flights are over, at 2.5 s"),
    ],
)
def test_why_nothing_more_comes_is_said(status, late, last, says):
    def wait(within_s):
        assert within_s == line.END_S
        if status is None:
            raise line.subprocess.TimeoutExpired("pilot", within_s)
        return status

    code, _ = submitted(line.SubmittedCode)
    code._frame, code._t_s, code._late, code._last_chance = 4, 2.5, late, last
    with pytest.raises(line.Barred) as ended:
        code._gone(SimpleNamespace(wait=wait))
    assert str(ended.value) == says
    code._frame = 0  # before the flight has begun there is no time to name
    assert code._when() == ""


def test_a_message_that_a_pipe_takes_in_pieces_arrives_whole():
    """A pipe takes 3 bytes, none for now, then 4, and so on; of one that has closed nothing is said here."""
    taken, sizes = bytearray(), iter([3, None, 4] * 9)

    def write(content):
        size = next(sizes)
        taken.extend(content[: size or 0])
        return None if size is None else min(size, len(content))

    code, _ = submitted(line.SubmittedCode)
    code._process = SimpleNamespace(stdin=SimpleNamespace(write=write))
    code._send(bytes(range(40, 60)))
    assert taken == bytes([20, 0, 0, 0, *range(40, 60)])

    def closed(content):
        raise BrokenPipeError

    code._process.stdin.write = closed
    code._send(b"lost")


class Told:
    """The pilot's end: frames that it is shown, and all that it says, with the frame that it says it of."""

    def __init__(self, *shown):
        self.shown, self.said, self.frame = list(shown), [], 0

    def take(self):
        if not self.shown:
            raise EOFError
        return self.shown.pop(0)

    def send(self, kind, content=b""):
        self.said.append((kind, self.frame, content))


DETECTOR = """
import numpy as np
from beaver_ftc.diagnosis import Verdict
class Mine:
    def reset(self, context):
        self.trim = context.trim_y
    def step(self, measured, command):
        return Verdict(True, "r", "flap", None, measured.y[4], 2.0 * command + self.trim[1], measured.t_s)
"""
LAW = """
class Mine:
    def reset(self, context):
        pass
    def step(self, measured, reference, verdict):
        said = [measured.x[0], reference.commanded[1], reference.rate[2], verdict.estimate]
        return said[:4 - (measured.t_s > 3.0)]
"""
CONTEXT = SimpleNamespace(surfaces=SURFACES, trim_y=np.array([0.0, 0.25, 0.0, 0.0, 0.0]))


def frames(*rest):
    """Two frames as the grader packs them."""
    every = [MEASURED, MEASURED._replace(t_s=3.5)]
    return [np.concatenate([*line._shown(measured), *rest]).tobytes() for measured in every]


def test_a_detector_answers_each_frame_with_its_number():
    command = numbers(4, seed=9)
    told = Told(*frames(command))
    with pytest.raises(EOFError):
        pilot.fly(told, {"source": DETECTOR, "name": "mine.py", "context": CONTEXT})
    assert told.said[:2] == [(pilot.READY, 0, b"detector:Mine"), (pilot.BEGUN, 0, b"")]
    assert [said[:2] for said in told.said[2:]] == [(pilot.VERDICT, 1), (pilot.VERDICT, 2)]
    for (_, _, content), t_s in zip(told.said[2:], (2.5, 3.5), strict=True):
        found = [1.0, 3.0, 4.0, 1.0, MEASURED.y[4], t_s, 1.0, *(2.0 * command + 0.25)]
        np.testing.assert_array_equal(np.frombuffer(content), found)


def test_a_law_answers_each_frame_with_a_command_of_every_surface():
    verdict = Verdict(True, "q", "rudder", None, -0.3, None, 1.5)
    said = pilot.verdict_numbers(verdict, SURFACES)
    told = Told(*frames(*REFERENCE, said))
    with pytest.raises(ValueError, match=r"the command has shape \(3,\), allowed: \(4,\)"):
        pilot.fly(told, {"source": LAW, "name": "mine.py", "context": CONTEXT})
    expected = [MEASURED.x[0], REFERENCE.commanded[1], REFERENCE.rate[2], -0.3]
    ready, begun, (kind, frame, content) = told.said
    assert (ready, begun) == ((pilot.READY, 0, b"law:Mine"), (pilot.BEGUN, 0, b""))
    assert (kind, frame, list(np.frombuffer(content))) == (pilot.COMMAND, 1, expected)


def test_without_a_flight_a_class_is_named_and_that_is_all():
    told = Told()
    pilot.fly(told, {"source": LAW.replace("class Mine:", "class Mine:\n    fault_tolerant = 1"),
                     "name": "mine.py", "context": None})  # fmt: skip
    assert told.said == [(pilot.READY, 0, b"fault-tolerant law:Mine")]


def test_whatever_goes_wrong_is_said_in_a_line(monkeypatch):
    """After the walls; an act that they refuse is told at once. Then the process ends."""
    context = SimpleNamespace(surfaces=SURFACES, model=None)
    told, ended = Told(pickle.dumps({"source": "1/0", "name": "mine.py", "context": context})), []
    flown = []

    def fly(of, given):
        flown.append(given["context"].model)
        raise SystemExit("first\n  second " + "é" * 600)

    def confine(tell):
        tell("x" * 501)
        return ["limits", "names"]

    monkeypatch.setattr(pilot, "_own_streams", lambda: told)
    monkeypatch.setattr(pilot, "confine", confine)
    monkeypatch.setattr(pilot, "fly", fly)
    monkeypatch.setattr(pilot.os, "_exit", ended.append)
    pilot.main()
    refused, walls, error = told.said
    assert refused == (pilot.REFUSED, 0, b"x" * 500)
    assert walls == (pilot.WALLS, 0, b"limits names")
    assert error == (pilot.ERROR, 0, ("SystemExit: first second " + "é" * 600).encode()[:500])
    assert ended == [0]
    assert (flown[0]._line, flown[0]._surfaces) == (told, 4)


def test_a_pipe_s_pieces_are_one_message_and_its_end_ends_the_process(monkeypatch):
    inward, into = os.pipe()
    outward, out = os.pipe()
    at = pilot.Line(inward, out)
    os.write(into, struct.pack("<I", 5) + b"hello" + struct.pack("<I", 300) + b"x")
    assert at.take() == b"hello"
    read, pieces = os.read, iter([4, 1, 2])
    monkeypatch.setattr(pilot.os, "read", lambda file, size: read(file, min(size, next(pieces, 7))))
    os.write(into, b"x" * 299)
    assert at.take() == b"x" * 300
    at.frame = 258
    at.send(pilot.ASKS, b"three")
    assert read(outward, 99) == b"Q\x02\x01\x00\x00\x05\x00\x00\x00three"
    os.close(into)

    def end(status):
        raise SystemExit(status)

    monkeypatch.setattr(pilot.os, "_exit", end)
    with pytest.raises(SystemExit) as ended:
        at.take()
    assert ended.value.code == 0
    for file in (inward, outward, out):
        os.close(file)
