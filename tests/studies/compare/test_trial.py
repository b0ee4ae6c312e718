"""A flight boiled down for the comparison: what never came is infinite, and each number is of its part."""

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.undeclared import undeclared
from beaver_ftc.studies.compare import sets, trial
from flying import scenario

# What stands for what, besides the sets of gusts: a constant error of the model covers wrong coefficients.
COVERED = ("uncertainty.coefficients.", "environment.gust")


@pytest.mark.parametrize("name", sets.set_names())
def test_a_set_has_enough_flights_and_draws_inside_what_it_declares(name):
    """For the statistical detector as well, which declares how fast the model's error changes."""
    cases = sets.of_set(name)
    assert name == "healthy" or sum(bool(case.scenario.faults) for case in cases) >= 36
    both = trial.Entry(trial.STATISTICAL, trial.LAW)
    outside = {each.key for case in cases for each in undeclared(trial.with_entry(case.scenario, both))}
    assert not [key for key in outside if not key.startswith(COVERED)]


def test_the_time_of_a_frame_is_that_of_the_frames_that_were_flown(monkeypatch):
    monkeypatch.setattr(trial, "thread_time", iter((0.0, 1.0)).__next__)
    fault = {"actuator": "elevator", "type": "hardover", "direction": -1, "at_s": 1.0}
    case = sets.SetFlight("", scenario(duration_s=60.0, faults=[fault]))
    (result,) = trial.fly_case(case, [trial.Entry("none", "nominal")], trade_off=False).results
    assert result.departed
    assert result.us > 1e6 / (60.0 * case.scenario.rate_hz)


def test_an_option_of_the_scenario_counts_for_its_own_scheme_alone():
    flight = scenario(fdi={"scheme": "augmented-ekf", "options": {"alarm": 5.0}})
    chosen = {"exact": {"detectors": {"augmented-ekf": {"alarm": 3.0}, "augmented-ukf": {"alarm": 2.0}}}}
    both = (trial.with_entry(flight, trial.Entry(f"augmented-{k}kf", trial.LAW), chosen) for k in "eu")
    assert [each.fdi.options["alarm"] for each in both] == [5.0, 2.0]


def test_flights_that_change_to_another_law_compare_none(tmp_path):
    file = tmp_path / "x.yaml"
    file.write_text("{name: x, runs: 1, base: {name: x, changes: [{at_s: 3, law: oracle}]}}")
    with pytest.raises(BadInput, match="changes: each scheme and each law flies to the end"):
        sets.of_sweep(file)
