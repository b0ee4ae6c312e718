"""The reproduction of made flights, whole: its statements, document, pages, and what each figure is of."""

from dataclasses import asdict
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.studies.reproduce import claims, reproduction
from beaver_ftc.studies.reproduce.cases import BESIDE, PUBLISHED, VARIANTS, Changed, Flown
from beaver_ftc.studies.reproduce.choices import CHOICES, scenario
from beaver_ftc.studies.reproduce.claims import CLAIMS
from beaver_ftc.studies.reproduce.published_figures import FIGURES, figures_of, margins_figure
from kept import page, picture

T_S = np.arange(3001) * 0.01


def flown(name="elevator", fault="elevator", departure=None, detected_s=12.2, until_s=30.0):
    """A log in which each signal is a wave of its own, and the estimators go one after the other."""
    t = T_S[until_s + 1e-9 >= T_S]
    log = {"t_s": t, "detected": (t >= detected_s - 1e-9).astype(float)}
    struck = t >= 12.0
    for i, axis in enumerate("pqr", 1):
        rate = 0.01 * i * np.sin(t)
        log |= {
            f"{axis}_rad_s": rate,
            f"{axis}_model_rad_s": rate + 0.002 * i * (1 + struck),
            f"{axis}_residual_rad_s": 0.001 * i * np.cos(t) * (1 + 5 * struck),
            f"{axis}_threshold_rad_s": 0.004 + 0 * t,
        }
        for j, surface in enumerate(("aileron", "elevator", "rudder"), 1):
            log |= {
                f"fie_{surface}_{axis}_residual_rad_s": -0.001 * j * np.sin(i * t) * struck,
                f"fie_{surface}_{axis}_lower_rad_s": -0.002 - 0.001 * i + 0 * t,
                f"fie_{surface}_{axis}_upper_rad_s": 0.003 + 0.001 * i + 0 * t,
            }  # fmt: skip
    for surface, out_s in (("aileron", 12.25), ("elevator", 14.0), ("rudder", 12.3)):
        log[f"fie_{surface}_excluded"] = ((t >= out_s - 1e-9) & (surface != fault)).astype(float)
    for i, surface in enumerate(("aileron", "elevator", "rudder", "flap"), 1):
        log |= {f"{surface}_{what}_rad": 0.01 * i * np.sin(i * t) for what in ("cmd", "effective")}
    named = None if fault is None else {"fault": fault, "time_s": 12.31, "estimate": -0.387}
    document = {
        "scenario": name, "departure": departure, "fault": {"at_s": 12.0}, "false_alarm": False,
        "detection": {"delay_s": 0.2, "time_s": detected_s},
        "isolation": named or {"fault": "unanticipated", "time_s": 14.0, "estimate": None},
        "supervisor": [{"mode": "nominal", "time_s": 0.0}, {"mode": "adaptive", "time_s": detected_s + 0.01}],
    }  # fmt: skip
    return Flown(document, log)


@pytest.fixture
def flights():
    every = {case.name: flown(case.name) for case in (*PUBLISHED, *BESIDE)}
    lost = {"time_s": 14.567, "signal": "alpha_rad"}
    every["unanticipated-nominal"] = flown("unanticipated-nominal", None, lost, until_s=14.0)
    every |= {
        name: flown(name, None)
        for name in ("unanticipated", "unanticipated-sharpened", "unanticipated-interval")
    }
    every |= {name: flown(name, name.split("-")[0]) for name in ("aileron", "rudder", "aileron-sharpened")}
    return every


def test_every_statement_of_made_flights(flights, changed):
    assert not changed([[claim.statement, claim.measure(flights), claim.remark(flights)] for claim in CLAIMS])


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


NEVER = SimpleNamespace(
    metrics={"detection": {"delay_s": None, "time_s": None}, "supervisor": [], "departure": {},
             "isolation": {"fault": None, "estimate": None}},
    excluded_at_s=lambda name: np.inf, named_s=lambda name: 0.0,
)  # fmt: skip


def test_what_never_happens_is_infinite(flights):
    never = {"elevator": NEVER, "unanticipated": NEVER}
    assert claims._detection("elevator", never) == np.inf
    assert claims._isolation("elevator", never) == np.inf
    assert claims._last_to_go(never) == np.inf
    assert claims._adaptive_after(never) == np.inf
    assert claims._said_theta("elevator", never) == ""
    assert claims._sharpened("elevator", never) == ""
    assert claims._last_standing(never) == "at no time is a known fault left alone"
    still = flown()
    still.log["flap_cmd_rad"] = np.zeros_like(T_S)
    assert claims._share_of_elevator({"elevator": still}) == np.inf
    assert claims._share_of_elevator({"elevator": flown(until_s=14.9)}) == np.inf
    lost = flown(departure={"time_s": 20.0})
    assert claims._tracking("elevator", "q", {"elevator": lost}) == np.inf
    both = {"unanticipated": flown(fault=None), "unanticipated-interval": flown(fault=None)}
    assert not claims._last_standing(both).endswith("never names it")
    assert claims._last_standing(both | {"unanticipated-interval": NEVER}).endswith(
        "the interval test never names it"
    )
    assert claims._lost({"unanticipated-nominal": flown()}) == "tracking lost, aircraft kept"


@pytest.mark.parametrize(("at_least", "holds"), [(False, [True, True, False]), (True, [False, True, True])])
def test_a_reading_holds_up_to_its_limit(at_least, holds):
    reading = claims.Reading("number", "s", 2.0, at_least)
    assert [reading.holds(number) for number in (1.9, 2.0, 2.1)] == holds


@pytest.fixture
def document(flights):
    well = [c.reading.limit * (2.0 if c.reading.at_least else 0.5) for c in CLAIMS]
    numbers = [[number * (1 + j / 50) for number in well] for j, _ in enumerate(VARIANTS)]
    numbers[3][4], numbers[5][0], numbers[7][1] = np.inf, 0.15, 1.5
    found = reproduction.document_of(flights, numbers)
    assert [case["metrics"] for case in found["cases"]] == [flown.metrics for flown in flights.values()]
    return found | {"versions": {"ours": "1"}}


def test_the_document_and_its_pages(document, changed, tmp_path):
    assert not changed(
        {key: value for key, value in document.items() if key not in ("cases", "choices", "sensitivity")}
    )
    assert not changed(
        [(row["variant"], row["missed"]) for row in document["sensitivity"]],
        "variants",
    )
    assert not changed(reproduction.as_text(document, "out").splitlines(), "text")
    (tmp_path / "figures").mkdir()
    for name in (*(view.name for view, _, _ in FIGURES), "sensitivity"):
        (tmp_path / "figures" / f"{name}.png").write_bytes(name.encode())
    assert not changed(page(reproduction.as_html(document, tmp_path)), "page")
    text = reproduction.as_markdown(document, "pictures")
    assert text.count("](pictures/") == len(FIGURES) + 1
    assert text.startswith("# ")


def test_how_far_each_statement_is_from_its_limit(document, changed):
    figure = margins_figure(document)
    assert not changed(picture(figure))
    assert figure.get_size_inches().tolist() == [12.0, pytest.approx(0.6 + 0.28 * len(CLAIMS))]


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
    groups = {"published": PUBLISHED, "beside": BESIDE, "variants": VARIANTS}
    assert not changed(
        {these: [(c.name, c.changes, c.shown_in) for c in cases] for these, cases in groups.items()}
    )
    assert not changed([asdict(choice) for choice in CHOICES], "choices")
    assert not changed(
        scenario("x", {"rate_hz": 50.0}).model_dump(mode="json", exclude_defaults=True), "scenario"
    )


def test_numbers_of_a_variant_are_of_its_own_flights(monkeypatch):
    asked = []
    monkeypatch.setattr(
        reproduction, "fly_case", lambda case, changes=None: asked.append((case.name, changes)) or flown()
    )
    found = reproduction.numbers_of(Changed("half", {"rate_hz": 50.0}, ""))
    assert asked == [(case.name, {"rate_hz": 50.0}) for case in PUBLISHED]
    assert len(found) == len(CLAIMS)
    asked.clear()
    assert list(reproduction.fly_published()) == [case.name for case in (*PUBLISHED, *BESIDE)]
    assert {changes for _, changes in asked} == {None}
