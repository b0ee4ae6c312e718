"""`sensitivity SCENARIO`: which truths are flown, what a flight counts for, and what a summary counts."""

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.undeclared import undeclared
from beaver_ftc.studies.sensitivity import beyond
from beaver_ftc.studies.sensitivity.beyond import (
    TOGETHER,
    Flight,
    cases_of,
    row_of,
    scenario_of,
)
from beaver_ftc.studies.sensitivity.command import errors_study
from beaver_ftc.studies.sensitivity.errors import errors_of
from flying import loss

LOSS = loss(at_s=1.5)
SHORT = {
    "name": "short", "duration_s": 8.0, "rate_hz": 20,
    "reference": {"q": [{"sine": {"amplitude_deg_s": 2.0, "frequency_hz": 0.4}}]}, "faults": [LOSS],
}  # fmt: skip
BOUNDS = {
    "coefficients": 0.04, "inertia": 0.03, "sensors": "tactical-grade", "turbulence": "light",
    "inertia_coupling": {"p": 0.2, "q": 0.1, "r": 0.15}, "constant_rad_s2": {"p": 0.02, "q": 0.03, "r": 0.01},
}  # fmt: skip
DECLARED = bf.load(SHORT | {"fdi": {"bounds": BOUNDS}})
KEYS = {  # of the scenario, that leave what is declared when the error does
    "moment coefficients": "uncertainty.coefficients", "moments of inertia": "uncertainty.inertia.I",
    "inertia coupling": "uncertainty.inertia_coupling",
    "unstructured acceleration": "uncertainty.sinusoid", "sensor errors": "sensors",
    "turbulence": "environment",
}  # fmt: skip


def truth_of(scenario, error, factor, run=0):
    return scenario_of(scenario, errors_of(scenario), 5, Flight(error, factor, run))


@pytest.mark.parametrize("error", [*KEYS, TOGETHER])
def test_a_truth_leaves_what_is_declared_where_its_error_does_and_nowhere_else(error):
    """Held against what `validate` finds undeclared."""
    at_limit = list(undeclared(truth_of(DECLARED, error, 1.0)))
    assert at_limit == []
    beyond = [fact.key for fact in undeclared(truth_of(DECLARED, error, 2.0))]
    wanted = KEYS.values() if error == TOGETHER else (KEYS[error],)
    assert beyond
    assert {key for key in wanted if any(fact.startswith(key) for fact in beyond)} == set(wanted)
    assert all(fact.startswith(tuple(wanted)) for fact in beyond)


def test_an_error_is_at_its_limit_and_its_sign_does_not_depend_on_the_factor():
    once, twice = (truth_of(DECLARED, TOGETHER, factor, run=3).uncertainty for factor in (1.0, 2.0))
    for name, ratio in once.coefficients.items():
        assert abs(ratio - 1.0) == pytest.approx(0.04)
        assert twice.coefficients[name] - 1.0 == pytest.approx(2.0 * (ratio - 1.0))
    assert {np.sign(ratio - 1.0) for ratio in once.coefficients.values()} == {-1.0, 1.0}
    assert abs(once.inertia_coupling.r) == 0.15
    sensors = truth_of(DECLARED, TOGETHER, 2.0).sensors
    assert sensors.q.noise_std_deg_s == pytest.approx(2 * 0.0208)
    assert abs(sensors.alpha.bias_deg) == pytest.approx(0.2)


def test_an_error_of_several_axes_says_its_largest_size():
    says = {error.name: error.says for error in errors_of(DECLARED)}
    assert (says["inertia coupling"], says["unstructured acceleration"]) == ("0.2", "0.03 rad/s2")


def test_what_is_not_declared_is_flown_alone_in_units_of_its_own():
    scenario = bf.load(SHORT)  # the published bounds alone
    errors = errors_of(scenario)
    unknown = {error.name: error.says for error in errors if not error.declared}
    assert unknown == {
        "moment coefficients": "none; unit 1 %", "moments of inertia": "none; unit 1 %",
        "sensor errors": "none; unit tactical-grade", "turbulence": "none; unit light",
    }  # fmt: skip
    assert list(undeclared(truth_of(scenario, TOGETHER, 1.0))) == []
    for error in unknown:
        assert {fact.key.startswith(KEYS[error]) for fact in undeclared(truth_of(scenario, error, 1.0))} == {
            True
        }
    rows = {case[:2] for case in cases_of(errors, 2)}
    assert ("moment coefficients", 1.0) in rows
    assert ("inertia coupling", 1.0) not in rows  # the same flights as all together
    exact = dict.fromkeys("pqr", 0.0)
    exact = scenario.with_({"fdi.bounds": {"inertia_coupling": exact, "constant_rad_s2": exact}})
    assert [error.name for error in errors_of(exact)] == list(unknown)


METRICS = {
    "fault": {"at_s": 2.0}, "false_alarm": False, "departure": None,
    "detection": {"time_s": 2.5, "delay_s": 0.5},
    "isolation": {"fault": "elevator", "isolated": True, "correct": True},
    "tracking": {
        "pre_fault_rms_deg_s": {"p": 0.7, "q": 0.1, "r": 0.2},
        "post_fault_rms_deg_s": {"p": 0.3, "q": 0.9, "r": 0.4},
    },
}  # fmt: skip
GOOD = {
    "failed": False, "false_alarm": False, "detected": True, "named": True, "misnamed": False, "lost": False,
    "delay_s": 0.5, "tracking_deg_s": 0.9, "bound_used": 0.25,
}  # fmt: skip
UNNAMED = {"isolation": {"fault": None, "isolated": False, "correct": None}}
WRONG = {"isolation": {"fault": "flap", "isolated": True, "correct": False}}
SILENT = {"detection": {"time_s": None, "delay_s": None}}


@pytest.mark.parametrize(
    ("changes", "differs"),
    [
        ({}, {}),
        (UNNAMED, {"named": False}),
        (WRONG, {"named": False, "misnamed": True}),
        (SILENT | UNNAMED, {"named": False, "detected": False, "delay_s": None}),
        ({"departure": {"time_s": 5.0, "signal": "beta_rad"}}, {"lost": True, "tracking_deg_s": None}),
        (
            {"fault": None} | SILENT | UNNAMED,  # a healthy flight tracks as it does before a fault
            {"named": False, "detected": False, "delay_s": None, "tracking_deg_s": 0.7},
        ),
    ],
)
def test_a_row_is_of_what_was_measured(changes, differs):
    assert row_of(Metrics.of(METRICS | changes), 0.25) == GOOD | differs


def test_no_error_is_larger_than_a_scenario_may_have_it():
    """Four times a slope error of 0.3, and four times 3 rad/s2."""
    bounds = {"sensors": {"p": {"scale_error": 0.3}}, "constant_rad_s2": {"p": 0, "q": 3, "r": 0}}
    truth = truth_of(bf.load(SHORT | {"fdi": {"bounds": bounds}}), TOGETHER, 4.0)
    assert truth.sensors.p.scale_error in (-0.9, 1.0)
    assert truth.uncertainty.sinusoid.q.amplitude_rad_s2 == 10.0


def test_faults_come_later_together_and_end_so_much_later():
    """At most four seconds, and five before the end at the latest; where there is no room, as declared."""
    second = {"actuator": "rudder", "type": "bias", "bias_deg": 2.0, "at_s": 3.0, "end_s": 6.5}
    for duration_s, most_s in ((30.0, 4.0), (10.0, 2.0), (8.0, 0.0), (7.5, 0.0)):
        scenario = bf.load(SHORT | {"duration_s": duration_s, "faults": [LOSS, second]})
        flown = [truth_of(scenario, TOGETHER, 1.0, run) for run in range(25)]
        later_s = [one.faults[0].at_s - 1.5 for one in flown]
        assert [one.faults[1].at_s - 3.0 for one in flown] == pytest.approx(later_s)
        assert [one.faults[1].end_s - 6.5 for one in flown] == pytest.approx(later_s)
        assert min(later_s) >= 0.0
        assert 0.7 * most_s <= max(later_s) <= most_s
        assert all(one.expect.model_dump(exclude_none=True) == {} for one in flown)


def of_rows(**changes):
    """Six flights of a row that can be told apart; the last could not be flown."""
    rows = [
        GOOD | {"delay_s": 0.1 * k, "tracking_deg_s": 0.3 * k, "bound_used": 0.01 * k, "false_alarm": k == 2}
        for k in range(1, 6)
    ]
    rows[0] |= {"lost": True, "tracking_deg_s": None}
    rows[1] |= {"detected": False, "named": False, "delay_s": None}
    rows[2] |= {"misnamed": True, "named": False}
    return [row | changes for row in rows] + [beyond.FAILED]


def test_a_summary_counts_flights_that_were_flown_and_what_never_came_as_longest():
    found = beyond.summary(of_rows())
    assert (found["flights"], found["failed"]) == (5, 1)
    counts = {name: (found[name]["count"], found[name]["of"], found[name]["value"]) for name in
              ("false_alarm", "detected", "named", "misnamed", "lost")}  # fmt: skip
    assert counts == {
        "false_alarm": (1, 5, 0.2), "detected": (4, 5, 0.8), "named": (3, 5, 0.6), "misnamed": (1, 5, 0.2),
        "lost": (1, 5, 0.2),
    }  # fmt: skip
    assert found["lost"]["low"] == pytest.approx(1.0 - 0.975 ** (1 / 5))
    assert (found["delay_s"]["value"], found["tracking_deg_s"]["value"]) == (0.4, pytest.approx(1.2))
    assert found["bound_used"] == {"value": 0.03, "low": None, "high": None}


def test_a_scenario_without_a_diagnosis_is_refused():
    with pytest.raises(BadInput, match="scheme: none diagnoses nothing"):
        errors_study(bf.load(SHORT | {"fdi": {"scheme": "none"}}))
