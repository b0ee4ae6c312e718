"""How the margins are shown; to the number, at one flight condition."""

from dataclasses import asdict

import numpy as np
import pytest

from beaver_ftc.studies import margins
from beaver_ftc.studies.margins import (
    Margin,
    as_document,
    as_text,
    at,
)
from flying import scenario

REAL = {"control": {"law": "fault-tolerant"}, "sensors": "tactical-grade", "actuators": "servo"}


def test_the_margins_at_a_flight_condition(changed, monkeypatch):
    monkeypatch.setattr(margins, "N_FREQUENCIES", 60)
    found = list(at(scenario(**REAL, uncertainty={})))
    assert not changed([list(asdict(each).values()) for each in found])


ROWS = [
    Margin(30.0, "none", "aileron", 8.0, np.inf, 60.0), Margin(42.5, "none", "aileron", 7.0, 20.0, 50.04),
    Margin(55.0, "none", "aileron", 9.0, 19.0, 49.96), Margin(30.0, "none", "flap", 6.0, 6.0, 45.0),
    Margin(30.0, "elevator given up", "flap", np.inf, np.inf, 44.99),
]  # fmt: skip


def test_the_margins_as_they_are_shown(changed):
    assert not changed(as_text(ROWS, (6.0, 45.0)).splitlines(), "text")
    assert not changed(as_document(ROWS, (6.0, 45.0)))


@pytest.mark.parametrize(
    ("up_db", "down_db", "phase_deg", "keeps"),
    [
        (6, 6, 45, True),
        (5.9, 9, 50, False),
        (9, 5.9, 50, False),
        (9, 9, 44.9, False),
        (np.inf, np.inf, 45, True),
    ],
)
def test_a_margin_keeps_what_is_asked_up_to_the_bound(up_db, down_db, phase_deg, keeps):
    assert Margin(40.0, "none", "flap", up_db, down_db, phase_deg).keeps(6.0, 45.0) is keeps
