"""`decay`: which truths are flown, what a flight counts for, and what the document says of them."""

import json
import re
from dataclasses import replace
from math import comb, isclose

import numpy as np
import pytest
from typer.testing import CliRunner

import beaver_ftc as bf
from beaver_ftc.cli.main import app
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.declared import undeclared
from beaver_ftc.studies.decay.errors import Error, changes_of, errors_of
from beaver_ftc.studies.decay.shown import _interval, as_text, sentences
from beaver_ftc.studies.decay.survey import (
    FACTORS,
    TOGETHER,
    Flight,
    cases_of,
    document_of,
    median,
    row_of,
    run_decay,
    scenario_of,
)

LOSS = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.4, "at_s": 1.5}
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


def test_flights_of_one_number_have_the_same_seed_and_instants():
    flown = [truth_of(DECLARED, error, f, run=2) for error in KEYS for f in FACTORS]
    assert len({(one.seed, one.faults[0].at_s) for one in flown}) == 1
    later = {truth_of(DECLARED, TOGETHER, 1.0, run).faults[0].at_s - 1.5 for run in range(20)}
    assert 0.0 <= min(later) < max(later) <= 1.5  # 5 s before the end at the latest
    assert len(later) > 5
    assert all(isclose(20.0 * s, round(20.0 * s), abs_tol=1e-9) for s in later)


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


def test_what_a_flight_counts_for():
    found = Metrics.of(bf.fly(bf.load(SHORT), log=False).metrics)
    right = row_of(found)
    assert (right["detected"], right["named"], right["misnamed"]) == (True, True, False)
    assert right["tracking_deg_s"] == max(vars(found.tracking.post_fault_rms_deg_s).values())
    premature = replace(found.isolation, correct=False, premature=True)
    wrong = row_of(replace(found, isolation=premature, false_alarm=True))
    assert (wrong["false_alarm"], wrong["detected"], wrong["named"], wrong["misnamed"]) == (
        True,
        False,
        False,
        True,
    )
    assert wrong["delay_s"] is None
    assert row_of(None)["failed"]


@pytest.mark.parametrize("n", [5, 6, 20])
def test_the_interval_of_a_median_is_that_of_the_sign_test(n):
    """The r-th smallest is below the median with at least 97.5 %: counted by binomial coefficients."""
    rows = [{"x": float(value)} for value in np.random.default_rng(n).permutation(n)]
    found = median(rows, "x")
    tail = [sum(comb(n, k) for k in range(r + 1)) / 2**n for r in range(n)]
    low = max((r for r in range(n) if tail[r] <= 0.025), default=None)
    assert found["low"] == (None if low is None else float(low))
    assert found["high"] == (None if low is None else float(n - 1 - low))
    assert median([*rows, *[{"x": None}] * (n + 1)], "x")["value"] is None


def test_a_document_and_its_files(tmp_path):
    (tmp_path / "short.yaml").write_text(json.dumps(SHORT))
    line = ["decay", str(tmp_path / "short.yaml"), "--flights", "2", "--workers", "1", "--out", str(tmp_path)]
    done = CliRunner().invoke(app, [*line, "--format", "json"])
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert [(row["error"], row["factor"]) for row in document["rows"]] == [
        (name, factor) for name in (*KEYS, TOGETHER) for factor in FACTORS
    ]
    alarms = {
        row["factor"]: row["false_alarm"]["count"] for row in document["rows"] if row["error"] == TOGETHER
    }
    assert (alarms[1.0], alarms[4.0]) == (0, 2)
    folder = tmp_path / "short-decay"
    assert {path.name for path in folder.iterdir()} == {
        f"decay.{kind}" for kind in ("json", "csv", "png", "html")
    }


def test_what_the_rows_say():
    scenario, flown = bf.load(SHORT), row_of(None) | {"failed": False, "detected": True, "named": True}
    flown |= {"delay_s": 0.05, "tracking_deg_s": 0.25, "bound_used": 0.5}
    errors = errors_of(scenario)
    cases = cases_of(errors, 4)
    rows = [
        flown | {"false_alarm": case.run == 0, "misnamed": case.run < 2, "named": case.run >= 2}
        if (case.error, case.factor) == ("inertia coupling", 2.0)
        else flown
        for case in cases
    ]
    document = document_of(scenario, errors, cases, 1, rows)
    first, *others = sentences(document)
    assert first == (
        "short: with every error at the limit of what is declared, 0 of 4 flights have a false alarm and "
        "0 of 4 a wrong name."
    )
    says = {error.name: error.says for error in errors} | {TOGETHER: "all that are declared"}
    sound = [
        f"{name} ({of}): no false alarm and no wrong name up to 4 times the declared size."
        if not of.startswith("none")
        else f"{name} (not declared{of[4:]}): no false alarm and no wrong name up to 4 times the unit."
        for name, of in says.items()
    ]
    counts = "gives a false alarm in 1 of 4 flights and a wrong name in 2 of 4."
    found = f"inertia coupling (0.25): an error of 2 times the declared size {counts}"
    assert others == [found if line.startswith("inertia coupling") else line for line in sound]
    lines = as_text(document).splitlines()
    (line,) = (line for line in lines if re.match(r"inertia coupling +0.25 +2 ", line))
    assert re.split("  +", line)[3:8] == [
        "4", "25 (1 to 81)", "100 (40 to 100)", "50 (7 to 93)", "50 (7 to 93)",
    ]  # fmt: skip
    for row in document["rows"]:
        if row["error"] == TOGETHER:
            counts = (1, 2) if row["factor"] == 1.0 else (3, 4)
            row["false_alarm"]["count"], row["misnamed"]["count"] = counts
    assert "1 of 4 flights have a false alarm and 2 of 4 a wrong name" in next(sentences(document))


def test_a_scenario_without_a_diagnosis_is_refused(tmp_path):
    with pytest.raises(BadInput, match="scheme: none diagnoses nothing"):
        run_decay(tmp_path, bf.load(SHORT | {"fdi": {"scheme": "none"}}))


def test_errors_left_out_leave_the_signs_of_the_others_and_intervals_are_in_the_unit_asked():
    """A sign is drawn for every error, whether it is made or not."""
    errors = [
        Error(name, "", lambda factor, draws, name=name: {name: factor * draws.choice([-1.0, 1.0])})
        for name in "abcdefgh"
    ]

    def made(*names):
        return changes_of(errors, dict.fromkeys(names, 2.0), np.random.default_rng(3))

    whole = made(*"abcdefgh")
    assert {abs(whole[name]) for name in "abcdefgh"} == {2.0}
    assert {whole[name] for name in "abcdefgh"} == {-2.0, 2.0}
    nothing = {"uncertainty": {}, "sensors": "ideal", "environment": {}}
    assert made("c", "h") == nothing | {name: whole[name] for name in "ch"}
    found = {"value": 0.25, "low": 0.125, "high": None}
    assert _interval(found, 100.0) == "25 (12.5 to never)"
    assert _interval(found | {"low": 0.25, "high": 0.25}, 10.0) == "2.5"
    assert _interval(found | {"value": None}) == "never"
