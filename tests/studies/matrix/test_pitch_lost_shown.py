"""Elevator and flap lost: the report of rows made by hand, the linear numbers, short rows, the scenarios."""

import pytest

from beaver_ftc.studies.matrix import pitch_lost
from beaver_ftc.studies.matrix.pitch_lost import (
    FILES,
    LAWS,
    LOST,
    PitchCase,
    as_text,
    document_of,
    fly_case,
)
from beaver_ftc.studies.present.page import contents

UNLIMITED = {
    "airspeed_mps": 52.0, "phugoid_damping": [0.05, 1.0], "gain_margin_db": None, "phase_margin_deg": None,
    "attitude_zero_rad_s": 0.123, "worth_deg": [-1.25, 2.5],
}  # fmt: skip


def outcome(number, departure=None):
    lost = departure is not None
    return {
        "q_rms_deg_s": None if lost else 0.5 + number / 10, "theta_swing_deg": None if lost else 2.0 + number,
        "outside_share": 0.25 if number % 4 == 1 else 0.0, "departure": departure,
    }  # fmt: skip


def rows_of(speeds):
    gone = {"time_s": 19.46, "signal": "alpha_rad"}
    return [
        {
            "law": law, "lost": name, "airspeed_mps": V,
            "without": outcome(i + 10 * j, gone if i in (1, 2, 3) else None),
            "with": outcome(i + j, gone if i in (3, 4) and law == LAWS[1] else None),
        }
        for law in LAWS for i, name in enumerate(LOST) for j, V in enumerate(speeds)
    ]  # fmt: skip


def test_the_report(changed):
    document = document_of(rows_of((45.0, 52.0)), (45.0,))
    document["margins"].append(UNLIMITED)
    assert not changed(as_text(document).splitlines(), "text")
    assert not changed({key: value for key, value in document.items() if key != "flights"})
    assert contents(FILES, document)["pitch-lost.txt"] == as_text(document) + "\n"
    assert list(contents(FILES, document)) == ["pitch-lost.json", "pitch-lost.txt"]
    assert document_of(rows_of((45.0,))[:3], (45.0,))["passed"]


@pytest.fixture
def short(monkeypatch):
    for name, value in (("DURATION_S", 4.0), ("AT_S", 1.0), ("SETTLED_S", 2.5)):
        monkeypatch.setattr(pitch_lost, name, value)


@pytest.mark.parametrize("lost", ["elevator -1 deg", "flap 20 deg down"])
def test_a_row(lost, short, changed):
    assert not changed(fly_case(PitchCase(lost, 38.0, LAWS[0])))
