"""The reproduction of made flights, whole: its statements, document, pages, and what each figure is of."""

from dataclasses import asdict, replace
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.results.model import Metrics
from beaver_ftc.studies.reproduce import beside, cases, measures, reproduction, truth_and_design, words
from beaver_ftc.studies.reproduce.cases import (
    BEYOND,
    CASES,
    OURS,
    PUBLISHED,
    VARIANTS,
    Changed,
    Flown,
    keys_of,
)
from beaver_ftc.studies.reproduce.choices import CHOICES, scenario
from beaver_ftc.studies.reproduce.claims import ABLATIONS, CLAIMS, MEASURED
from beaver_ftc.studies.reproduce.published_figures import FIGURES, figures_of, margins_figure
from kept import page, picture

T_S = np.arange(3001) * 0.01


def flown(name="elevator", fault="elevator", departure=None, detected_s=12.2, until_s=30.0):
    """A log in which each signal is a wave of its own, and the estimators go one after the other."""
    t = T_S[until_s + 1e-9 >= T_S]
    log = {"t_s": t, "detected": (t >= detected_s - 1e-9).astype(float)}
    air = {"alpha_rad": 0.05, "beta_rad": 0.0, "airspeed_mps": 45.0, "qdyn_pa": 1000.0, "dpt": 0.1}
    log |= {signal: value + 0.0 * t for signal, value in air.items()}
    struck = t >= 12.0
    for i, axis in enumerate("pqr", 1):
        rate = 0.01 * i * np.sin(t)
        log |= {
            f"{axis}_rad_s": rate,
            f"{axis}_model_rad_s": rate + 0.002 * i * (1 + struck),
            f"{axis}_residual_rad_s": 0.001 * i * np.cos(t) * (1 + 5 * struck),
            f"{axis}_threshold_rad_s": 0.004 + 0 * t,
            f"{axis}_network_rad_s2": 0.02 * i * np.sin(t) * struck,
            f"{axis}_design_rad_s2": 0.01 * i * np.cos(t + 0.1),
            f"{axis}_eta_bar_rad_s2": 0.02 + 0 * t,
        }
        for j, surface in enumerate(("aileron", "elevator", "rudder"), 1):
            log |= {
                f"fie_{surface}_{axis}_residual_rad_s": -0.001 * j * np.sin(i * t) * struck,
                f"fie_{surface}_{axis}_lower_rad_s": -0.002 - 0.001 * i + 0 * t,
                f"fie_{surface}_{axis}_upper_rad_s": 0.003 + 0.001 * i + 0 * t,
            }  # fmt: skip
    for surface, out_s in (("aileron", 12.25), ("elevator", 14.0), ("rudder", 12.3)):
        log[f"fie_{surface}_excluded"] = ((t >= out_s - 1e-9) & (surface != fault)).astype(float)
        log[f"{surface}_effectiveness_estimate"] = 1.0 - 0.4 * struck * (surface == fault)
        log[f"{surface}_effectiveness_used"] = 1.0 + 0.1 * struck * (surface == "rudder" == fault)
    for i, surface in enumerate(("aileron", "elevator", "rudder", "flap"), 1):
        log |= {f"{surface}_{what}_rad": 0.01 * i * np.sin(i * t) for what in ("cmd", "effective")}
    right = {"fault": fault, "time_s": 12.31, "delay_s": 0.31, "correct": fault == name}
    other = {"fault": "unanticipated", "time_s": 14.0, "delay_s": 2.0, "correct": True}
    document = {
        "scenario": name, "departure": departure, "fault": {"at_s": 12.0}, "false_alarm": False,
        "detection": {"delay_s": 0.2, "time_s": detected_s},
        "isolation": right if fault else other,
        "supervisor": [
            {"mode": "nominal", "time_s": 0.0}, {"mode": "adaptive", "time_s": detected_s + 0.01},
            {"mode": "reallocated", "time_s": 12.32},
        ],
        "flight": {"scheme": f"{name}'s scheme", "law": f"{name}'s law"},
        "tracking": {
            "pre_fault_rms_deg_s": {"p": 0.1, "q": 0.2, "r": 0.3},
            "post_fault_rms_deg_s": {"p": 0.4, "q": 0.5, "r": 0.6} if fault else None,
            "surface_travel_deg": {"aileron": 10.0, "elevator": 20.0},
            "surface_energy_deg2_s": {"aileron": 100.0, "elevator": 200.0},
        },
    }  # fmt: skip
    return Flown(Metrics.of(document), log, scenario("made", keys_of(CASES[fault or "elevator"], {})))


@pytest.fixture
def flights():
    every = {case.name: flown(case.name) for case in PUBLISHED}
    lost = {"time_s": 14.567, "signal": "alpha_rad"}
    every["unanticipated-nominal"] = flown("unanticipated-nominal", None, lost, until_s=14.0)
    every |= {name: flown(name, None) for name in ("unanticipated", "unanticipated-network")}
    return every | {name: flown(name, name) for name in ("aileron", "rudder")}


def test_every_measure_of_made_flights(flights, changed):
    assert not changed([[claim.statement, claim.number(flights)] for claim in MEASURED])


def test_what_a_flight_says_of_itself(changed):
    found = flown("unanticipated", None)
    assert not changed({
        **{f"before {axis}": found.before_deg_s(axis) for axis in "pqr"},
        **{f"after {axis}": found.after_deg_s(axis) for axis in "pqr"},
        "closest before": found.closest_before_fault(),
        **{f"closest {name}": found.closest(name) for name in ("aileron", "elevator", "rudder")},
        **{f"out {name}": found.excluded_at_s(name) for name in ("aileron", "elevator", "rudder")},
        **{f"named {name}": found.named_s(name) for name in ("aileron", "elevator", "rudder")},
    })  # fmt: skip
    assert found.before_deg_s("q") == pytest.approx(np.degrees(0.004))
    assert found.after_deg_s("r") == pytest.approx(np.degrees(0.012))
    assert found.named_s("elevator") == pytest.approx(14.0 - 12.3)
    assert flown().excluded_at_s("elevator") == np.inf
    assert flown().rms_deg_s("p", 40.0) == np.inf
    assert found.between(0.1, 0.13).nonzero()[0].tolist() == [10, 11, 12]


def but(found, **changes):
    """The same flight, but for this in its metrics."""
    return replace(found, metrics=Metrics.of(found.metrics.document() | changes))


def without_alarm():
    """A flight in which nothing is ever detected."""
    found = flown()
    silent = {
        name: 0.0 * column
        for name, column in found.log.items()
        if name == "detected" or name.startswith("fie_") or name.endswith("_residual_rad_s")
    }
    metrics = found.metrics.document() | {
        "detection": {"delay_s": None, "time_s": None}, "supervisor": [],
        "isolation": {"fault": None, "time_s": None},
    }  # fmt: skip
    return replace(found, metrics=Metrics.of(metrics), log=found.log | silent)


@pytest.mark.parametrize(
    "name",
    ["detection", "isolation", "in_charge", "reallocation", "activated_near_10", "alarm_lag", "last_to_go",
     "conclusion_lag", "exclusion_lag", "activation"],
)  # fmt: skip
def test_what_never_happens_is_infinite(name):
    assert measures.MEASURES[name].of({"elevator": without_alarm()}, "elevator") == np.inf


@pytest.mark.parametrize(("at_s", "apart_s"), [(9.25, 0.75), (11.5, 1.5)])
def test_how_far_from_10_s_the_adaptive_law_takes_over_has_no_sign(at_s, apart_s):
    supervisor = [SimpleNamespace(mode="degraded", time_s=3.0), SimpleNamespace(mode="adaptive", time_s=at_s)]
    flight = SimpleNamespace(metrics=SimpleNamespace(supervisor=supervisor))
    assert measures.activated_near_10({"elevator": flight}, "elevator") == apart_s


def test_the_laws_changes_are_counted_from_the_alarm_and_from_the_name():
    changes = (("adaptive", 12.625), ("reallocated", 14.0), ("adaptive", 20.0))
    metrics = SimpleNamespace(
        supervisor=[SimpleNamespace(mode=mode, time_s=at_s) for mode, at_s in changes],
        detection=SimpleNamespace(time_s=12.25), isolation=SimpleNamespace(time_s=13.25),
    )  # fmt: skip
    flight = {"elevator": SimpleNamespace(metrics=metrics)}
    assert measures.in_charge(flight, "elevator") == 0.375
    assert measures.reallocation(flight, "elevator") == 0.75


def test_what_is_counted_without_an_alarm():
    never = {"elevator": without_alarm()}
    counted = ("detected", "isolated", "handled", "decisions", "order", "residuals", "generalised")
    assert [measures.MEASURES[name].of(never, "elevator") for name in counted] == [0.0] * 7
    assert measures.estimators(never, "elevator") == 1
    assert measures.left(never, "elevator") == 3
    assert measures.named(never, "elevator") == 0.0


def test_an_aircraft_that_is_lost_tracks_nothing(flights):
    lost = {"elevator": flown(departure={"time_s": 20.0}), "elevator-nominal": flown()}
    for measure in (measures.worst_tracking, measures.learning, measures.beside_nominal):
        assert measure(lost, "elevator") == np.inf
    assert measures.healthy_tracking(lost, "elevator") == measures.unapproximated(lost, "elevator") == np.inf
    assert measures.tracking(lost, "elevator", "q") == np.inf


@pytest.mark.parametrize(
    ("turned_s", "rudder_out_s", "frames"),
    [(12.5, 12.3, 0), (12.5, 12.6, 10), (12.1, 12.6, 40), (31.0, 12.6, np.inf)],
)  # fmt: skip
def test_an_estimator_is_late_from_the_alarm_and_a_mismatch_beyond_1_on(turned_s, rudder_out_s, frames):
    """The elevator stands still, without any effect, until it turns; the alarm is at 12.2 s."""
    found = flown()
    found.log["elevator_cmd_rad"] = 0.2 * (found.log["t_s"] >= turned_s - 1e-9)
    found.log["fie_rudder_excluded"] = (found.log["t_s"] >= rudder_out_s - 1e-9).astype(float)
    assert measures.after_mismatch({"elevator": found}, "elevator") == frames
    assert measures.after_mismatch({"elevator": without_alarm()}, "elevator") == np.inf


def test_body_rates_without_damping_are_the_slower_ones(monkeypatch):
    """Poles of 2, 3 and 4 1/s beside one of 0.5 1/s."""
    states = ("p", "alpha", "q", "r")
    linear = SimpleNamespace(states=states, A=np.diag([-2.0, -0.5, -3.0, 4.0]))
    monkeypatch.setattr(measures, "trimmed", lambda flown: (None, None))
    monkeypatch.setattr(measures, "differences", lambda plant, point: linear)
    assert measures.separation({"healthy": flown()}, "healthy") == pytest.approx(4.0)


def test_a_flap_that_stands_still_carries_nothing():
    still = flown()
    still.log["flap_cmd_rad"] = np.zeros_like(T_S)
    assert measures.share_of_elevator({"elevator": still}, "elevator") == np.inf
    assert measures.share_of_elevator({"elevator": flown(until_s=14.9)}, "elevator") == np.inf
    assert measures.decisions({"elevator": still}, "elevator") == 1.0


def test_an_estimator_that_is_left_out_has_neither_residuals_nor_an_exclusion():
    found = flown()
    found.log["fie_rudder_excluded"][:] = 1.0
    assert not found.has("rudder")
    assert found.has("aileron")
    assert found.excluded_at_s("rudder") == np.inf
    assert not found.residuals_of("rudder").any()
    assert found.closest("rudder") == 0.0
    assert measures.estimators({"elevator": found}, "elevator") == 3
    assert measures.residuals({"elevator": found}, "elevator") == 6


@pytest.mark.parametrize(("at_least", "holds"), [(False, [True, True, False]), (True, [False, True, True])])
def test_a_claim_holds_up_to_its_limit(at_least, holds):
    claim = MEASURED[0]
    claim = claim._replace(limit=2.0, measure=claim.measure._replace(at_least=at_least))
    assert [claim.holds(number) for number in (1.9, 2.0, 2.1)] == holds


TESTED = [i for i, c in enumerate(MEASURED) if c.testable and not c.because and not c.measure.at_least]
AS_WELL, NOT_THERE, AT_GAIN, AS_WELL_THERE = TESTED[:4]


@pytest.fixture
def document(flights):
    """Statements that hold everywhere, but for a few, and fail without their mechanism, but for one."""
    well = [c.limit * (2.0 if c.measure.at_least else 0.5) for c in MEASURED]
    ill = [-1.0 if c.measure.at_least else 2.0 * c.limit + 1.0 for c in MEASURED]
    rows = {setting.name: [*well, *ill, 3.0] for setting in reproduction.SETTINGS}
    for row in rows.values():
        row[len(MEASURED) + AS_WELL] = well[AS_WELL]
    rows[VARIANTS[3].name][NOT_THERE], rows[BEYOND[5].name][0] = np.inf, 0.15
    rows["control network_gain halved"][AT_GAIN] = np.inf
    rows["no integral action"][len(MEASURED) + AS_WELL_THERE] = well[AS_WELL_THERE]
    alarms = [[float(i in (3, 30, 31))] for i in range(54)]
    both = {
        (case.name, whose): flown(f"{case.name} {whose}", None if case is beside.HEALTHY else case.name)
        for case in beside.SHOWN
        for whose in beside.WHOSE
    }
    both["rudder", "paper"].metrics.tracking.surface_travel_deg["aileron"] = 1.0
    both["elevator", "ours"] = but(both["elevator", "ours"], detection={"delay_s": None, "time_s": 12.2})
    both["unanticipated", "paper"] = flown("lost", None, {"time_s": 20.0})
    designs = [(without_alarm(), flown()), (flown(), flown()), (without_alarm(), without_alarm())]
    designs[1] = flown(), but(flown(), false_alarm=True)
    every = reproduction.Flights(flights, both, designs)
    found = reproduction.document_of(every, [*rows.values(), *alarms])
    assert [case["metrics"] for case in found["cases"]] == [
        flown.metrics.document() for flown in flights.values()
    ]
    return found | {"versions": {"ours": "1"}}


def test_the_document_and_its_pages(document, changed, tmp_path):
    assert not changed(
        {key: value for key, value in document.items() if key not in ("cases", "choices", "sensitivity")}
    )
    assert not changed(
        [(row["variant"], row["missed"]) for row in document["sensitivity"] if row["missed"]],
        "variants",
    )
    assert not changed(words.as_text(document, "out").splitlines(), "text")
    (tmp_path / "figures").mkdir()
    for name in (*(view.name for view, _, _ in FIGURES), "sensitivity"):
        (tmp_path / "figures" / f"{name}.png").write_bytes(name.encode())
    assert not changed(page(words.as_html(document, tmp_path)), "page")
    text = words.as_markdown(document, "pictures")
    assert text.count("](pictures/") == len(FIGURES) + 1
    assert text.startswith("# ")


def test_the_document_says_what_failed(document):
    by_statement = {claim["statement"]: claim for claim in document["claims"]}
    as_well, not_there, at_gain, as_well_there = (
        by_statement[MEASURED[i].statement] for i in (AS_WELL, NOT_THERE, AT_GAIN, AS_WELL_THERE)
    )
    assert as_well["verdict"] == "cannot be judged"
    assert not_there["verdict"] == at_gain["verdict"] == as_well_there["verdict"] == "borne out"
    settings = len(reproduction.ELSEWHERE)
    assert (not_there["held_in"], not_there["borne_out_in"]) == (settings - 1, settings - 1)
    assert (as_well_there["held_in"], as_well_there["borne_out_in"]) == (settings, settings - 1)
    told = {row["variant"]: row for row in document["sensitivity"]}["no integral action"]["also_without"]
    assert [one["statement"] for one in told] == [MEASURED[AS_WELL_THERE].statement]
    tested = sum(c.testable for c in MEASURED)
    assert document["testable"] == {
        "statements": tested, "hold": tested - 1, "elsewhere": tested - 4, "do_not": 0, "unsettled": 1,
    }  # fmt: skip
    assert document["construction"]["statements"] == len(MEASURED) - tested
    assert document["background"] == len(CLAIMS) - len(MEASURED)
    assert document["adaptation"] == {"flights": 4 * (settings + 1), "same": 3 * (settings + 1)}
    assert document["beside"]["false_alarms"] == {"paper": 1, "ours": 2}
    better = {(row["case"], row["quantity"]) for row in document["beside"]["paper_better"]}
    assert better == {("rudder", "surface travel"), ("elevator", "detection after")}
    assert [row["alarm_s"] for row in document["truth_and_design"]["designs"]] == [None, 12.2, None]
    (halved,) = (row for row in document["gains"] if row["key"] == "control.options.network_gain")
    assert [missed["statement"] for missed in halved["halved"]] == [MEASURED[AT_GAIN].statement]
    assert halved["doubled"] == []
    assert document["passed"]
    assert sum(document["counts"].values()) == len(CLAIMS)


def test_how_far_each_statement_is_from_its_limit(document, changed):
    figure = margins_figure(document)
    assert not changed(picture(figure))


def test_each_figure_has_its_panels(changed):
    assert not changed([(asdict(view), case, span) for view, case, span in FIGURES])


def test_figures_are_drawn_of_their_case_and_span(flights, document, changed, monkeypatch):
    asked = []
    module = "beaver_ftc.studies.reproduce.published_figures"
    monkeypatch.setattr(f"{module}.draw", lambda *given: asked.append(given) or given[0].name)
    monkeypatch.setattr(f"{module}.margins_figure", lambda given: "margins")
    found = figures_of(document, flights)
    assert found == {
        **{f"{view.name}.png": view.name for view, _, _ in FIGURES},
        "sensitivity.png": "margins",
    }
    assert not changed([
        (view.name, title, series["t_s"][[0, -1]], sorted(series)[:3], series["q_error_rad_s"].sum(), marks)
        for view, series, marks, title in asked
    ])  # fmt: skip


def test_the_cases_and_the_choices(changed):
    groups = {"published": PUBLISHED, "variants": VARIANTS, "ablations": ABLATIONS}
    assert not changed(
        {these: [(c.name, c.changes, c.shown_in) for c in cases] for these, cases in groups.items()}
        | {"ours": OURS, "beyond": [(c.name, c.changes) for c in BEYOND]}
    )
    assert not changed([asdict(choice) for choice in CHOICES], "choices")
    assert not changed(
        scenario("x", {"rate_hz": 50.0}).model_dump(mode="json", exclude_defaults=True), "scenario"
    )


def test_numbers_of_a_setting_are_of_its_own_flights_each_flown_once(monkeypatch):
    asked = []
    monkeypatch.setattr(cases, "_fly", lambda name, keys: asked.append(repr(sorted(keys.items()))) or flown())
    found = reproduction.row_of((reproduction.NUMBERS, Changed("half", {"rate_hz": 50.0}, "")))
    assert len(found) == 2 * len(MEASURED) + 1
    assert all("('rate_hz', 50.0)" in keys for keys in asked)
    assert len(set(asked)) == len(asked)
    assert not any(
        "'magnitude': 0.01" in keys or "lqr" in keys for keys in asked
    )  # not borne out as published
    without = {repr((key, value)) for a in ABLATIONS for key, value in a.changes.items() if key != "faults"}
    built = {
        "('fdi.options.dead_zone', 0)",
        "('fdi.options.projection', 0)",
        "('control.options.projection', 0)",
    }
    flown_without = {change for change in without if any(change in keys for keys in asked)}
    refuted = {repr(*reproduction.WITHOUT[name].changes.items()) for name in ("engine", "damping")}
    assert without - flown_without == built | refuted


def test_what_is_flown_to_be_shown(monkeypatch):
    asked = []
    for module in (reproduction, beside, truth_and_design):
        monkeypatch.setattr(
            module, "fly_case", lambda case, changes=None: asked.append((case.name, changes)) or case.name
        )
    flights = reproduction.fly_published()
    assert list(flights.published) == [case.name for case in PUBLISHED]
    assert list(flights.beside.items())[:2] == [
        (("fault-free", "paper"), "fault-free"), (("fault-free", "ours"), "fault-free"),
    ]  # fmt: skip
    assert asked[len(PUBLISHED) + 1] == ("fault-free", OURS)
    assert flights.designs == [("fault-free", "elevator")] * 3


def test_the_paper_does_better_where_a_reader_would_see_it():
    """By more than MATTERS of ours, where ours has none, and never in a flight that was lost."""
    keys = [quantity.key for quantity in beside.QUANTITIES]

    def row(departed=False, **values):
        return {"case": "loss", "departed": departed} | dict.fromkeys(keys) | values

    ours, little, enough = 2.0, 2.0 * (1.0 - 0.9 * beside.MATTERS), 2.0 * (1.0 - 1.1 * beside.MATTERS)
    for key in keys:
        for paper, known, better in (
            (little, ours, False), (enough, ours, True), (ours, enough, False), (3.0, None, True),
            (None, ours, False), (None, None, False),
        ):  # fmt: skip
            found = beside._better([row(**{key: paper}), row(**{key: known})])
            assert [(one["paper"], one["ours"]) for one in found] == ([(paper, known)] if better else [])
            assert beside._better([row(departed=True, **{key: paper}), row(**{key: known})]) == []


def test_the_slower_of_the_others_is_what_an_exclusion_lags_by(flights):
    """Beyond 0.004, 0.005, 0.006 rad/s a residual leaves its bounds: each exclusion is held against that."""
    log = {name: column.copy() for name, column in flights["elevator"].log.items()}
    for surface, beyond_s in (("aileron", 12.2), ("rudder", 12.27)):
        log[f"fie_{surface}_q_residual_rad_s"] = 0.02 * (log["t_s"] >= beyond_s - 1e-9)
        for axis in "pr":
            log[f"fie_{surface}_{axis}_residual_rad_s"] *= 0.0
    found = replace(flights["elevator"], log=log)
    assert measures.exclusion_lag({"elevator": found}, "elevator") == pytest.approx(5.0)  # 0.05 s, not 0.03
