"""A flight boiled down for the comparison: what never came is infinite, and each number is of its part."""

from math import inf
from types import SimpleNamespace

import pytest

from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.declared import undeclared
from beaver_ftc.studies.compare import trial

FLIGHT = SimpleNamespace(frames=2000, scenario=SimpleNamespace(rate_hz=100.0))
DOCUMENT = {
    "fault": {"at_s": 12.0}, "false_alarm": False, "fault_free_s": 12.0, "departure": None,
    "detection": {"delay_s": 0.5},
    "isolation": {"fault": "elevator", "correct": True, "delay_s": 0.75},
    "tracking": {
        "pre_fault_rms_deg_s": {"p": 3.0, "q": 4.0, "r": 0.0},
        "post_fault_rms_deg_s": {"p": 2.0, "q": 3.0, "r": 6.0},
        "surface_travel_deg": {"aileron": 30.0, "elevator": 50.0},
        "surface_energy_deg2_s": {"aileron": 300.0, "elevator": 100.0},
    },
}  # fmt: skip
LOST = {"departure": {"time_s": 14.0, "signal": "alpha"}}


def result(**changes):
    document = {**DOCUMENT, **changes}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trial, "measure", lambda flight: Metrics.of(document))
        return trial.result_of(FLIGHT, trial.Entry("ours", "nominal"), us=7.0)


SOUND = {
    "false_alarm": False, "fault_free_s": 12.0, "faulted": True, "delay_s": 0.5, "isolated": "elevator",
    "correct": True, "isolation_delay_s": 0.75, "rms_deg_s": 7.0, "before_deg_s": 5.0, "after_deg_s": 7.0,
    "travel_deg_s": 4.0, "energy_deg2_s2": 20.0, "departed": False, "us": 7.0,
}  # fmt: skip
NEVER = {"detection": {"delay_s": None}, "isolation": {"fault": None, "correct": None, "delay_s": None}}
WRONG = {"isolation": {"fault": "flap", "correct": False, "delay_s": 0.75}}
BEFORE_ALONE = {"tracking": {**DOCUMENT["tracking"], "post_fault_rms_deg_s": None}}


@pytest.mark.parametrize(
    ("changes", "differs"),
    [
        ({}, {}),
        (NEVER, {"delay_s": inf, "isolated": None, "correct": False, "isolation_delay_s": inf}),
        (WRONG, {"isolated": "flap", "correct": False, "isolation_delay_s": inf}),
        ({"false_alarm": True}, {"false_alarm": True, "correct": False, "isolation_delay_s": inf}),
        (LOST, {"departed": True, "rms_deg_s": inf, "after_deg_s": inf}),
        ({**LOST, "fault": None}, {"departed": True, "faulted": False, "rms_deg_s": inf, "before_deg_s": inf,
                                   "after_deg_s": inf}),
        ({"fault": None, **BEFORE_ALONE}, {"faulted": False, "rms_deg_s": 5.0, "after_deg_s": inf}),
        ({"fault": {"at_s": 20.0}, **BEFORE_ALONE}, {"faulted": False, "rms_deg_s": 5.0, "after_deg_s": inf}),
    ],
)  # fmt: skip
def test_a_flight_boiled_down(changes, differs):
    found = result(**changes)
    assert {name: getattr(found, name) for name in SOUND} == pytest.approx({**SOUND, **differs})


# What stands for what, besides the sets of gusts: a constant error of the model covers wrong coefficients.
COVERED = ("uncertainty.coefficients.", "environment.gust")


@pytest.mark.parametrize("name", trial.set_names())
def test_a_set_has_enough_flights_and_draws_inside_what_it_declares(name):
    """For the statistical detector as well, which declares how fast the model's error changes."""
    cases = trial.of_set(name)
    assert name == "healthy" or sum(bool(case.scenario.faults) for case in cases) >= 36
    both = trial.Entry(trial.STATISTICAL, trial.LAW)
    outside = {each.key for case in cases for each in undeclared(trial.with_entry(case.scenario, both))}
    assert not [key for key in outside if not key.startswith(COVERED)]
