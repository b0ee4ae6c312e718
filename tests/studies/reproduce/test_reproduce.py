import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from beaver_ftc.cli.main import app
from beaver_ftc.scenario.schema import load_scenario
from beaver_ftc.studies.reproduce import (
    beside,
    cases,
    claims,
    measures,
    published_figures,
    reproduction,
    truth_and_design,
)
from beaver_ftc.studies.reproduce.cases import (
    CASES,
    GAINS,
    OURS,
    PUBLISHED,
    VARIANTS,
    LazyFlights,
    fly_case,
    keys_of,
)
from beaver_ftc.studies.reproduce.choices import CHOICES, GIVEN, gains, scenario
from beaver_ftc.studies.reproduce.claims import ABLATIONS, CLAIMS, MEASURED
from beaver_ftc.studies.reproduce.published_figures import FIGURES, shares
from beaver_ftc.studies.reproduce.words import number

SHOWN = {"Fig. 2a", "Fig. 2b", "Fig. 3", "Fig. 4a", "Fig. 4b", "Fig. 4c", "Fig. 5", "Fig. 6", "Fig. 7"}
# What does not hold as flown, and what holds without its mechanism as well.
NOT_BORNE_OUT = {
    "The occurrence of any fault is detected.",
    "Equations (1) and (2) describe the motion of the Beaver.",
    "An unanticipated fault may be detected but is not isolated.",
    "The adaptive law is activated at about 10 s.",
    "An active system has the potential for superior performance.",
    "The bounding function bounds the modelling uncertainty.",
    "Switching continuously improves the transient performance.",
    "Body rates are much faster than the outer loops.",
}
NOT_FOR_ITS_MECHANISM = {
    "Without a fault the nominal law, PI on a linearised inversion, is stable and tracks.",
    "The residuals of the estimator of the true fault stay below their thresholds.",
    "No residual of the elevator's estimator ever exceeds its threshold.",
    "Aileron and rudder could be replaced likewise if there were a second surface.",
}
CHANGES = {"": {}} | {ablation.name: ablation.changes for ablation in ABLATIONS}
MUST_BITE = {  # ablations, each of which breaks a statement
    "network", "hand-over", "adaptation", "dead-zone", "projection", "parametric",
    "aileron-estimator", "elevator-estimator", "rudder-estimator",
}  # fmt: skip


FLOWN = {}  # each distinct flight once


def flown(case, ablation=""):
    return flights_of(ablation)[case]


def flights_of(ablation=""):
    """The published cases under one of CHANGES."""
    return LazyFlights(CHANGES[ablation], FLOWN)


@pytest.mark.parametrize("claim", MEASURED, ids=lambda claim: claim.statement)
def test_a_statement_holds_as_flown_unless_the_reason_is_known(claim):
    holds = claim.holds(claim.number(flights_of()))
    assert holds == (claim.statement not in NOT_BORNE_OUT)
    assert holds or claim.because


@pytest.mark.parametrize(
    "claim",
    [claim for claim in MEASURED if claim.statement not in NOT_BORNE_OUT],
    ids=lambda claim: f"{claim.ablation}: {claim.statement}",
)
def test_a_statement_fails_without_the_mechanism_it_speaks_of(claim):
    number = claim.number(flights_of(claim.ablation))
    assert claim.holds(number) == (claim.statement in NOT_FOR_ITS_MECHANISM)


def test_every_mechanism_has_a_statement_that_fails_without_it():
    bites = {claim.ablation for claim in MEASURED if claim.statement not in NOT_FOR_ITS_MECHANISM}
    assert bites >= MUST_BITE
    assert {claim.ablation for claim in MEASURED} == set(CHANGES) - {""}


def test_statements_without_a_measure_say_why():
    assert all(bool(claim.measure) != bool(claim.reason) for claim in CLAIMS)
    assert len({claim.statement for claim in CLAIMS}) == len(CLAIMS)


@pytest.mark.parametrize(
    ("number", "without", "elsewhere", "verdict"),
    [
        (1.0, 3.0, [(2.0, 2.1), (0.0, 9.0)], claims.STRONGER), (1.0, 3.0, [(2.1, 3.0)], claims.BORNE_OUT),
        (1.0, 3.0, [(2.0, 2.0)], claims.BORNE_OUT),  # there, it holds without its mechanism as well
        (1.0, 3.0, [(np.nan, 3.0)], claims.BORNE_OUT), (1.0, 3.0, [(1.0, np.inf)], claims.STRONGER),
        (2.1, 3.0, [(0.0, 3.0)], claims.NOT_BORNE_OUT), (2.1, 0.0, [], claims.NOT_BORNE_OUT),
        (1.0, 2.0, [(1.0, 3.0)], claims.CANNOT_BE_JUDGED),
    ],
)  # fmt: skip
def test_the_four_verdicts(number, without, elsewhere, verdict):
    claim = MEASURED[0]._replace(limit=2.0, construction=False)
    assert not claim.measure.at_least
    assert claim.verdict(number, without, elsewhere) == verdict
    built = claim._replace(construction=True)  # of which no ablation is flown elsewhere
    assert built.verdict(1.0, 3.0, [(2.0, np.nan)]) == claims.STRONGER
    assert built.verdict(1.0, 3.0, [(2.1, np.nan)]) == claims.BORNE_OUT
    assert not built.testable


def test_the_network_keeps_the_aircraft_only_where_the_feedback_is_slow():
    """With Kp and Ki doubled and more the aircraft is kept without it, too."""
    (claim,) = (c for c in MEASURED if c.measure.of.__name__ == "flown_on")
    fast = {"control.proportional_per_s": 4.0, "control.integral_per_s2": 4.0}
    with_it, without = ({**fast, **CHANGES[ablation]} for ablation in ("", "network"))
    assert claim.holds(claim.number(LazyFlights(with_it, FLOWN)))
    assert claim.holds(claim.number(LazyFlights(without, FLOWN)))
    assert not claim.holds(claim.number(flights_of("network")))


@pytest.mark.parametrize("airspeed_mps", [40.0, 45.0, 50.0])
def test_from_the_centre_of_the_set_no_known_fault_is_named_for_the_unanticipated_one(airspeed_mps):
    def named(theta):
        changes = {"initial.airspeed_mps": airspeed_mps, "fdi.options.initial_theta": theta}
        return measures.named(LazyFlights(changes, FLOWN), "unanticipated")

    assert named(0.0) > 0.2
    assert named(-0.5) == 0.0


@pytest.mark.parametrize("case", reproduction.FAULTY)
def test_the_adaptation_of_the_isolation_estimators_changes_no_alarm_and_no_name(case):
    without = LazyFlights(reproduction.NO_ADAPTATION, FLOWN)
    assert reproduction._found_in(flown(case)) == reproduction._found_in(without[case])
    columns = [name for name in flown(case).log if name.endswith("_effectiveness_estimate")]
    adapted = any((flown(case).log[c] != without[case].log[c]).any() for c in columns)
    assert adapted or case == "unanticipated"  # the estimates are others


def test_a_setting_changes_the_size_and_instant_of_published_losses_alone():
    (loss,) = keys_of(CASES["rudder"], {cases.SIZE: 0.8, cases.AT: 13.0})["faults"]
    assert (loss["magnitude"], loss["at_s"], loss["actuator"]) == (0.8, 13.0, "rudder")
    keys = keys_of(CASES["slight-rudder"], {cases.SIZE: 0.8, cases.AT: 13.0})
    assert (keys["faults"][0]["magnitude"], keys["duration_s"]) == (0.01, 31.0)
    assert "magnitude" not in keys_of(CASES["unanticipated"], {cases.SIZE: 0.8})["faults"][0]
    assert keys_of(CASES["fault-free-nominal"], {cases.SIZE: 0.8}) == {"control.law": "nominal"}
    assert keys_of(CASES["elevator"], {}) == dict(CASES["elevator"].changes)


def test_numbers_agree_with_the_log_itself():
    log, numbers = flown("elevator").log, {c.statement: c for c in MEASURED}
    over = [np.abs(log[f"{axis}_residual_rad_s"]) > log[f"{axis}_threshold_rad_s"] for axis in "pqr"]
    first_s = log["t_s"][1:][np.any(over, axis=0)[1:]][0]
    detected, tracked = (
        numbers[says].number({"elevator": flown("elevator")})
        for says in (
            "The elevator fault is detected within 0.5 s.",
            "With reallocation the pitch rate is tracked acceptably in spite of the fault.",
        )
    )
    assert detected == pytest.approx(first_s - 12.0)
    error = np.rad2deg(log["q_model_rad_s"] - log["q_rad_s"])[1400:]
    assert tracked == pytest.approx(np.linalg.norm(error) / np.sqrt(error.size) / 3.0)


@pytest.mark.parametrize("whose", beside.WHOSE)
def test_no_false_alarm_at_the_corners_and_edges_of_the_published_uncertainty(whose):
    settings = [setting for asked, setting in beside.healthy_settings() if asked == whose]
    thetas = [setting.changes["uncertainty.inertia_coupling"] for setting in settings]
    assert len({tuple(theta.values()) for theta in thetas}) == 27
    assert {value for theta in thetas for value in theta.values()} == {-0.25, 0.0, 0.25}
    assert [beside.false_alarm_of(setting) for setting in settings] == [0.0] * 27


def test_the_unanticipated_fault_is_kept_at_48_mps_by_the_network_alone():
    alone = fly_case(CASES["unanticipated-network"], {"initial.airspeed_mps": 48.0})
    assert alone.metrics.departure is None
    assert alone.metrics.detection.delay_s <= 0.5
    assert alone.metrics.isolation.fault == "unanticipated"
    assert np.all(alone.log["q_rad_s"] < 0.5)


def test_ours_differs_in_scheme_and_law_alone():
    paper, ours = (scenario("x", how) for how in ({}, OURS))
    assert (ours.fdi.scheme, ours.control.law) == ("adaptive-estimators", "fault-tolerant")
    assert (paper.fdi.scheme, paper.control.law) == ("zhang2005", "zhang2005")
    assert ours.fdi.bounds == paper.fdi.bounds
    default = scenario("x", {"fdi": {"scheme": ours.fdi.scheme}, "control": {"law": ours.control.law}})
    assert ours.fdi.sharpen == default.fdi.sharpen
    assert ours.fdi.thresholds == default.fdi.thresholds == "interval"
    for part in ("initial", "uncertainty", "reference", "sensors", "actuators"):
        assert getattr(ours, part) == getattr(paper, part), part


def test_equation_2_as_printed_alarms_at_once_and_a_bound_that_covers_the_engine_does_not():
    whole, printed, covered = truth_and_design.document_of(truth_and_design.fly_designs())["designs"]
    assert whole["alarm_s"] is None
    assert covered["alarm_s"] is None
    assert printed["alarm_s"] == pytest.approx(0.01)
    assert max(printed["share"].values()) > 10.0
    assert max(whole["share"].values()) < 1.0
    assert printed["false_alarm"]
    assert printed["detected_s"] is None
    assert 0 < whole["detected_s"] < covered["detected_s"] < 0.5
    omitted = {name for row in truth_and_design.terms() for name in row["omitted"]}
    assert omitted == {"Cl_a2dpt", "Cm_dpt", "Cn_dpt3"}


def test_published_setting_is_that_of_the_built_in_scenario():
    ours, shipped = scenario("x", {}), load_scenario("elevator-partial-loss")
    for part in ("initial", "uncertainty", "duration_s", "rate_hz", "actuators", "sensors"):
        assert getattr(ours, part) == getattr(shipped, part), part
    assert ours.fdi.bounds == shipped.fdi.bounds
    assert ours.fdi.thresholds == "published"
    assert not any(ours.fdi.sharpen.model_dump().values())


def test_every_choice_has_its_reason_and_none_is_given_by_the_paper():
    assert all(len(choice.reason) > 10 for choice in CHOICES)
    assert not {choice.key for choice in CHOICES} & set(GIVEN)


def test_every_gain_is_halved_and_doubled_and_says_where_it_is_from():
    for gain in gains():
        values = [value for setting in GAINS for key, value in setting.changes.items() if key == gain.key]
        assert values == [gain.default / 2, gain.default * 2]
        assert gain.origin
        assert gain.says
    assert "control.options.network_gain" in {gain.key for gain in gains()}
    assert not {"dead_zone", "projection", "leave_out", "network"} & {gain.name for gain in gains()}


def test_every_published_figure_is_drawn_with_its_panels():
    titles = {view.title.split(":")[0]: view for view, _, _ in FIGURES}
    assert set(titles) >= SHOWN
    for figure in ("Fig. 2a", "Fig. 2b", "Fig. 5", "Fig. 6", "Fig. 7"):
        labels = [panel.label for panel in titles[figure].panels]
        assert labels[:2] == ["elevator deflection", "flap deflection"]
        assert labels[-1] == "pitch rate q"
    for figure in ("Fig. 3", "Fig. 4a", "Fig. 4b", "Fig. 4c"):
        assert len(titles[figure].panels) == 3
    assert {case for _, case, _ in FIGURES} <= set(CASES)


@pytest.mark.parametrize("variant", [*VARIANTS, *GAINS, *ABLATIONS], ids=lambda variant: variant.name)
def test_every_variant_changes_the_scenario(variant):
    control = {k: v for k, v in variant.changes.items() if k != "faults"}
    faults = variant.changes.get("faults", [])
    changed = scenario("x", {"design_model.engine_terms": False, **control, "faults": faults})
    assert changed != scenario("x", {"design_model.engine_terms": False}) or variant.name == "fault"


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (0.0224, "of the amplitude", "2.2 % of the amplitude"),
        (317.2, "times", "317 times"),
        (0.01, "s", "0.01 s"),
        (None, "s", "never"),
    ],
)
def test_numbers_in_words(value, unit, said):
    assert number(value, unit) == said


@pytest.mark.parametrize(
    ("lowest", "number", "highest", "at_least", "limit", "expected"),
    [
        (0.1, 0.2, 1.0, False, 0.5, (0.2, 0.4, 2.0)),
        (1.0, 2.0, 5.0, True, 0.5, (0.1, 0.25, 0.5)),
        (0.1, 0.2, None, False, 0.5, (0.2, 0.4, np.inf)),
        (1.0, None, None, True, 0.5, (0.0, 0.0, 0.5)),
        (0.0, 0.0, 5.0, True, 0.5, (0.1, np.inf, np.inf)),
        (0.0, 0.0, 0.1, False, 0.0, (0.0, 0.0, np.inf)),
    ],
)
def test_margins_are_shares_of_what_is_allowed(lowest, number, highest, at_least, limit, expected):
    claim = {"lowest": lowest, "number": number, "highest": highest, "limit": limit, "at_least": at_least}
    assert shares(claim) == pytest.approx(expected)


def test_command_writes_tables_figures_and_page(tmp_path, monkeypatch):
    """With every setting as if it had been flown like the published one, and one picture of all drawn."""
    drawn = published_figures.draw
    monkeypatch.setattr(
        published_figures, "draw", lambda view, *of: drawn(view, *of) if view.name == "fig-3" else b"picture"
    )
    as_flown = [claim.number(flights_of()) for claim in MEASURED]
    row = [*as_flown, *as_flown, 4.0]
    monkeypatch.setattr(
        reproduction, "row_of", lambda studied: row if studied[0] == reproduction.NUMBERS else [0.0]
    )
    monkeypatch.setattr("beaver_ftc.studies.reproduce.reproduction.fly_case", lambda case: flown(case.name))
    done = CliRunner().invoke(
        app, ["reproduce", "--workers", "1", "--out", str(tmp_path), "--format", "json"]
    )
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert document["passed"] is True
    assert document["counts"][claims.NOT_BORNE_OUT] == len(NOT_BORNE_OUT)
    assert document["counts"][claims.CANNOT_BE_JUDGED] == len(CLAIMS) - len(NOT_BORNE_OUT)
    folder = tmp_path / "reproduction"
    pictures = {view.name for view, _, _ in FIGURES} | {"sensitivity"}
    assert {path.stem for path in (folder / "figures").iterdir()} == pictures
    page = (folder / "reproduction.html").read_text()
    assert page.count("<img") == len(pictures)
    assert page.count("✗ not borne out</td>") == len(NOT_BORNE_OUT)
    assert not re.search(r"""(src|href)\s*=\s*["'](?!data:)""", page)
    assert len(page) < 5e6
    text = (folder / "reproduction.md").read_text()
    assert all(f"| {claim.statement} |" in text for claim in CLAIMS)
    assert all(f"figures/{view.name}.png" in text for view, _, _ in FIGURES)


def test_what_counts_as_good_and_taken_over_is_the_same_everywhere():
    limits = {claim.source.split(":")[0]: claim.limit for claim in MEASURED}
    assert limits["'good', 'acceptable', 'satisfactory' tracking"] == measures.GOOD
    assert limits["'reallocated'"] == measures.TAKEN_OVER


def test_cases_that_are_shown_say_where():
    assert {case.shown_in for case in PUBLISHED} >= {"Fig. 2a", "Fig. 2b", "Fig. 3, 4, 5", "Fig. 6", "Fig. 7"}


@pytest.mark.parametrize(
    ("others", "left"),
    [
        ({}, {"fdi.options.a", "control.options.b"}),
        ({"fdi.scheme": "another"}, {"control.options.b"}),
        ({"control.law": "another"}, {"fdi.options.a"}),
        ({"fdi.scheme": "another", "control.law": "another"}, set()),
    ],
)
def test_options_go_with_the_published_scheme_and_law_that_have_them(others, left):
    options = {"fdi.options.a": 1.0, "control.options.b": 2.0}
    assert cases._apt({**options, "rate_hz": 50, **others}).keys() == {"rate_hz", *others, *left}
