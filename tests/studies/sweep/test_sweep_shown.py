"""All that a sweep shows, of flights with every kind of key and end: summary, figures, page, worst."""

import pytest

from beaver_ftc.scenario.sweeps import load_sweep_text
from beaver_ftc.studies.sweep.outcomes import worst_flights
from beaver_ftc.studies.sweep.pictures import FIGURES
from beaver_ftc.studies.sweep.summary import summarise
from beaver_ftc.studies.sweep.summary_page import render, summary_text
from kept import page, picture

from .counted import ROWS, ROWS_OF_VARIOUS, SWEEP, VARIOUS, detected, flights_of, row

LEVELS = SWEEP.replace("uniform: [0.1, 1]", "linspace: [0.1, 1, 3]")
OF_LEVELS = [
    {**r, "faults[0].magnitude": (0.1, 0.55, 1.0)[i % 3]}
    for i, r in enumerate([*ROWS[:8], *(row(run) for run in range(8, 12))])
]
LATE = [*(detected(run, 0.1) for run in range(11)), detected(11, 2.1)]
SHOWN = {
    "various": (ROWS_OF_VARIOUS, VARIOUS),
    "levels": (OF_LEVELS, LEVELS),
    "late": (LATE, SWEEP),
}
SEARCH = {"objective": "delay", "run": 7, "score": 1.5, "history": [None, 1.0, 1.5, 1.5]}


@pytest.fixture(params=SHOWN)
def shown(request, tmp_path):
    rows, text = SHOWN[request.param]
    flights, sweep = flights_of(rows, tmp_path, text), load_sweep_text(text)
    return flights, summarise(flights, sweep), sweep


def test_the_summary(shown, changed):
    assert not changed(shown[1])


def test_every_figure(shown, changed):
    flights, summary, _ = shown
    summary = summary | {"search": SEARCH} if summary["sweep"] == "various" else summary
    drawn = {name: draw(flights, summary) for name, (_, draw) in FIGURES.items()}
    assert not changed({name: whole(figure) for name, figure in drawn.items() if figure is not None})


def whole(figure):
    """A picture, and the places that annotations are of."""
    places = [list(getattr(text, "xy", ())) for axes in figure.axes for text in axes.texts]
    return picture(figure) | {"places": places}


def test_the_worst_flights_the_page_and_the_text(shown, changed, tmp_path):
    flights, summary, sweep = shown
    found = {
        "name": "detection_rate",
        "expected": {"at_least": 0.9},
        "actual": 0.8,
        "of": 50,
        "passed": False,
    }
    worst = worst_flights(flights, sweep, "beaver-ftc sweep a.yaml")
    summary |= {
        "worst": worst,
        "expectations": [found],
        "passed": False,
        "folder": "runs/a",
        "search": SEARCH,
    }
    assert not changed(worst, "worst")
    assert not changed(summary_text(summary).splitlines(), "text")
    (tmp_path / "flights" / worst[0]["name"]).mkdir(parents=True)
    (tmp_path / "flights" / worst[0]["name"] / "metrics.json").write_text("{}")
    (tmp_path / "figures").mkdir()
    for name in FIGURES if len(flights) > 12 else ("search", "sensitivity"):
        (tmp_path / "figures" / f"{name}.png").write_bytes(name.encode())
    assert not changed(page(render(summary | {"versions": {"jsbsim": "1"}}, tmp_path)), "page")
