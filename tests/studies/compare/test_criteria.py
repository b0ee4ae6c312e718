"""The costs by which methods are tuned, from results made by hand."""

from dataclasses import replace
from math import exp, inf, log, nan, sqrt

import pytest

from beaver_ftc.studies.compare import criteria
from beaver_ftc.studies.compare.criteria import (
    EFFORT,
    INADMISSIBLE,
    LOST,
    DetectorCost,
    LawCost,
)
from beaver_ftc.studies.compare.sets import SetFlight
from beaver_ftc.studies.compare.trial import LAW, Entry, Result
from beaver_ftc.studies.margins import Margin
from flying import loss, scenario

FAULTED, HEALTHY = (SetFlight("c", scenario(faults=faults)) for faults in ([loss("rudder", 0.5)], []))
CASES = [FAULTED, HEALTHY, FAULTED, FAULTED, FAULTED]
SOUND = Result(
    Entry("x", LAW), False, 9.0, True, delay_s=1.0, correct=True, rms_deg_s=2.0, energy_deg2_s2=4.0
)
FOUND = [
    SOUND,  # a delay of 1 s, rightly named: 1/4
    replace(SOUND, faulted=False, false_alarm=True),  # 1 of 5 flights
    replace(SOUND, delay_s=0.25, correct=False),  # 0.2 / 2 + 1 / 2
    replace(SOUND, delay_s=inf, correct=False),  # 1
    replace(SOUND, delay_s=inf, correct=False, false_alarm=True),  # 1, and 1 of 5 flights
]
J = (0.25 + 0.6 + 1.0 + 1.0) / 4 + 2 / 5


def given(monkeypatch, results):
    left = list(results)
    monkeypatch.setattr(criteria, "fly_entry", lambda *asked: left.pop(0))


def test_a_detector_costs_delay_names_and_false_alarms(monkeypatch):
    given(monkeypatch, FOUND)
    assert DetectorCost("x", CASES)({"a": 1.0}) == pytest.approx(J)


MARGINS = [Margin(40.0, "none", "rudder", 9.0, inf, 60.0), Margin(50.0, "none", "rudder", 7.0, 8.0, 50.0)]


@pytest.fixture
def law(monkeypatch):
    """A law on four faulted flights; the oracle's errors and the default law's effort are made up."""
    monkeypatch.setattr(criteria, "yardsticks", lambda *_: ([FAULTED] * 4, (1.0, 2.0, 4.0, 1.0), 2.0))
    monkeypatch.setattr(criteria, "margins_of", lambda scenario: MARGINS)
    return LawCost("lqr", "exact", None, 0)


def test_a_law_costs_its_error_over_the_oracles(law, monkeypatch):
    lost = replace(SOUND, rms_deg_s=inf)
    given(monkeypatch, [SOUND, SOUND, SOUND, lost])
    assert law({}) == pytest.approx(exp((log(2.0) + log(1.0) + log(0.5) + log(LOST)) / 4))


def test_a_law_may_spend_no_more_than_the_default_and_a_tenth(law, monkeypatch):
    allowed = (EFFORT * 2.0) ** 2
    for energy, admissible in ((allowed * 0.99, True), (allowed * 1.01, False)):
        given(monkeypatch, [replace(SOUND, energy_deg2_s2=energy)] * 4)
        over = INADMISSIBLE * sqrt(1.01)
        tracked = exp((log(2.0) + log(1.0) + log(0.5) + log(2.0)) / 4)
        assert law({}) == pytest.approx(tracked if admissible else over)


@pytest.mark.parametrize(
    ("changes", "short"),
    [
        ({}, 0.0),
        ({"up_db": 3.0}, 0.5),
        ({"down_db": 4.5}, 0.25),
        ({"phase_deg": 9.0}, 0.8),
        ({"up_db": 0.0}, 1.0),
        ({"up_db": nan}, 1.0),
        ({"down_db": nan}, 1.0),
        ({"phase_deg": nan}, 1.0),
    ],
)
def test_a_law_with_too_little_margin_is_not_flown(law, monkeypatch, changes, short):
    """6 dB and 45 deg are what a scenario asks of the default law."""
    monkeypatch.setattr(criteria, "margins_of", lambda scenario: [MARGINS[0], replace(MARGINS[1], **changes)])
    given(monkeypatch, [] if short else [SOUND] * 4)
    assert law.shortfall({}) == pytest.approx(short)
    if short:
        assert law({}) == pytest.approx(INADMISSIBLE * (1.0 + short))
