"""The reproduction of made flights, whole: its statements, document, pages, and what each figure is of."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from beaver_ftc.results.model import Metrics
from beaver_ftc.studies.reproduce import beside, reproduction, words
from beaver_ftc.studies.reproduce.cases import (
    BEYOND,
    CASES,
    PUBLISHED,
    VARIANTS,
    Flown,
    keys_of,
)
from beaver_ftc.studies.reproduce.choices import scenario
from beaver_ftc.studies.reproduce.claims import MEASURED
from beaver_ftc.studies.reproduce.published_figures import FIGURES
from kept import page

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


def test_each_figure_has_its_panels(changed):
    assert not changed([(asdict(view), case, span) for view, case, span in FIGURES])
