"""The class: every exercise has its answer, the minutes are ninety. docs-check flies the answers."""

import re
from math import exp
from pathlib import Path

PAGE = (Path(__file__).resolve().parents[2] / "docs/tutorials/class.md").read_text(encoding="utf-8")
SHEETS, _, ANSWERS = re.sub(r" *\| *", " | ", PAGE).partition("## Answers")


def test_every_exercise_has_an_answer():
    asked = re.findall(r"^- (\d[a-z])\. ", SHEETS, re.MULTILINE)
    answered = re.findall(r"\b(\d[a-z])(?: \||:)", ANSWERS)
    assert len(asked) > 12
    assert set(asked) == set(answered)


def test_the_minutes_are_ninety():
    said = [int(minutes) for minutes in re.findall(r"^## \d\. .*\((\d+) minutes\)", SHEETS, re.MULTILINE)]
    assert len(said) == 5
    assert sum(said) == 90


def test_the_threshold_by_hand_is_the_log_s():
    by_hand = 0.02 * 0.01 / (1.0 - exp(-10.0 * 0.01))
    (shown,) = re.findall(r"\| 2b \| ([\d.]+) rad/s", ANSWERS)
    assert f"{by_hand:.4f}" == shown
    assert f"= {shown}$" in ANSWERS
