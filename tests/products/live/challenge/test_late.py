"""The line to a submission: which message is taken, what it may know, what its time costs, how it ends."""

import pytest

from beaver_ftc_live.challenge import line, pilot


def head(kind, frame, content, size=None):
    return pilot.HEAD.pack(kind, frame, len(content) if size is None else size) + content


WRITES, NUMBERS = "writes on the line to the grader", b"8 bytes."
MOST_QUESTIONS = 4 + 8 * (3 * 64 + 5)  # y has 5 numbers


@pytest.mark.parametrize(
    ("kind", "length", "said", "found"),
    [
        (pilot.COMMAND, 8, head(pilot.COMMAND, 3, NUMBERS), NUMBERS),
        (pilot.COMMAND, 8, head(pilot.VERDICT, 3, NUMBERS), WRITES),
        (pilot.COMMAND, 8, head(pilot.COMMAND, 2, NUMBERS), WRITES),
        (pilot.COMMAND, 8, head(pilot.COMMAND, 3, NUMBERS[:7]), WRITES),
        (pilot.READY, None, head(pilot.READY, 3, b"x" * 1000), b"x" * 1000),
        (pilot.READY, None, head(pilot.READY, 3, b"x" * 1001), WRITES),
        (pilot.READY, None, head(pilot.ERROR, 9, b"KeyError: 3"), "KeyError: 3, at 2.5 s"),
        (pilot.READY, None, head(pilot.ERROR, 3, b"e" * 1000), "e" * 197 + "..., at 2.5 s"),
        (pilot.COMMAND, 8, head(pilot.REFUSED, 3, b"forks"), "tried what is not allowed: forks, at 2.5 s"),
        (pilot.COMMAND, 8, head(pilot.ASKS, 1, b"q", MOST_QUESTIONS + 1), WRITES),
        (
            pilot.COMMAND,
            8,
            head(pilot.ASKS, 1, b"q" * MOST_QUESTIONS) + head(pilot.ASKS, 3, b"r") + head(b"C", 3, NUMBERS),
            NUMBERS,
        ),
    ],
)
def test_the_message_that_must_come_is_the_only_one_that_is_taken(monkeypatch, kind, length, said, found):
    """Of the right kind, frame and length; but for questions, which are counted, and what ends a flight."""
    left, asked = bytearray(said), []

    def read(size):
        taken = bytes(left[:size])
        del left[:size]
        return taken

    code = line.SubmittedCode("source", "name", line.Allowance(10.0))
    code._frame, code._t_s, code._sizes = 3, 2.5, (5, 4)
    monkeypatch.setattr(code, "_read", read)
    monkeypatch.setattr(code, "_evaluate", lambda question, times: asked.append((question, times)))
    if isinstance(found, bytes):
        assert code._answer(kind, length, 2.0) == found
        assert asked == ([(b"q" * MOST_QUESTIONS, 1), (b"r", 2)] if said[:1] == pilot.ASKS else [])
    else:
        with pytest.raises(line.Mistake) as ended:
            code._answer(kind, length, 2.0)
        assert str(ended.value) == found
        assert isinstance(ended.value, line.Barred) == (said[:1] != b"E" or found == WRITES)
    assert code._allowance.left_s < 10.0
    assert code._deadline == float("inf")
