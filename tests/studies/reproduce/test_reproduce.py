import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from beaver_ftc.cli.main import app
from beaver_ftc.studies.reproduce import (
    beside,
    claims,
    published_figures,
    reproduction,
    truth_and_design,
    words,
)
from beaver_ftc.studies.reproduce.cases import (
    CASES,
    LazyFlights,
    fly_case,
)
from beaver_ftc.studies.reproduce.claims import ABLATIONS, CLAIMS, MEASURED
from beaver_ftc.studies.reproduce.judged import counted_apart
from beaver_ftc.studies.reproduce.published_figures import FIGURES

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
    assert claim.verdict(number, without, elsewhere) == verdict
    built = claim._replace(construction=True)  # of which no ablation is flown elsewhere
    assert built.verdict(1.0, 3.0, [(2.0, np.nan)]) == claims.STRONGER
    assert built.verdict(1.0, 3.0, [(2.1, np.nan)]) == claims.BORNE_OUT
    assert not built.is_borne_out(2.0, np.nan)


def test_what_is_true_by_construction_is_counted_apart():
    row = {"reason": "", "construction": True}
    counted = counted_apart([row | {"verdict": f"{word}borne out"} for word in ("", "not ", "not ")])
    assert counted["construction"] == {"statements": 3, "hold": 1}


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


@pytest.mark.parametrize("flown_by", beside.FLOWN_BY)
def test_no_false_alarm_at_the_corners_and_edges_of_the_published_uncertainty(flown_by):
    settings = [setting for asked, setting in beside.healthy_settings() if asked == flown_by]
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


def test_equation_2_as_printed_alarms_at_once_and_a_bound_that_covers_the_engine_does_not():
    whole, printed, covered = truth_and_design.document_of()["designs"]
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


def test_command_writes_tables_figures_and_page(tmp_path, monkeypatch, changed):
    """With every setting as if it had been flown like the published one, and one picture of all drawn."""
    drawn = published_figures.draw
    monkeypatch.setattr(
        published_figures, "draw", lambda view, *of: drawn(view, *of) if view.name == "fig-3" else b"picture"
    )
    as_flown = [claim.number(flights_of()) for claim in MEASURED]
    row = {"numbers": as_flown, "without": as_flown, "same": 4}
    monkeypatch.setattr(
        reproduction, "row_of", lambda studied: row if studied[0] == "numbers" else {"false alarm": 0.0}
    )
    monkeypatch.setattr("beaver_ftc.studies.reproduce.reproduction.fly_case", lambda case: flown(case.name))
    done = CliRunner().invoke(
        app, ["reproduce", "--workers", "1", "--out", str(tmp_path), "--format", "json"]
    )
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert not changed(document["claims"], relative=1e-3)
    assert document["passed"] is True
    assert document["counts"][claims.NOT_BORNE_OUT] == len(NOT_BORNE_OUT)
    assert document["counts"][claims.CANNOT_BE_JUDGED] == len(CLAIMS) - len(NOT_BORNE_OUT)
    assert "except" not in words.as_text(document, "out")
    folder = tmp_path / "reproduction"
    pictures = {view.name for view, _, _ in FIGURES} | {"sensitivity"}
    assert {path.stem for path in (folder / "figures").iterdir()} == pictures
    page = (folder / "reproduction.html").read_text()
    assert (page.count("<img"), page.count("✗ not borne out</td>")) == (len(pictures), len(NOT_BORNE_OUT))
    assert not re.search(r"""(src|href)\s*=\s*["'](?!data:)""", page)
    assert all(f"| {claim.statement} |" in (folder / "reproduction.md").read_text() for claim in CLAIMS)
