"""The mismatch as pictures: all that each of them shows, of small documents made by hand."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from beaver_ftc.results.log import ParquetLog
from beaver_ftc.results.model import Metrics
from beaver_ftc.results.style import marks
from beaver_ftc.studies.mismatch import charts
from beaver_ftc.studies.mismatch.linear import analyse, linear_document
from beaver_ftc.studies.mismatch.sources import SOURCES
from beaver_ftc.studies.mismatch.split import COLUMNS, ETA_BAR, FAULT, TOTAL, UNEXPLAINED, column
from flying import scenario
from kept import picture

PEAKS = {
    "p": {"sinusoids": 0.02, "fault": 0.5, "inertia": 0.005, "engine": 2e-5, "sensors": 0.0199e-3},
    "q": {"engine": 0.04, "actuators": 0.01, "sinusoids": 0.02, "coefficients": 0.03, "sensors": 0.004},
    "r": {"earth_rotation": 1e-6, "wind_turbulence": 0.003, "simplification": 0.002, "integration": 1e-4},
}
BOUND = 0.025
FLOWN = Metrics.of({
    "fault": {"at_s": 1.0}, "detection": {"time_s": 1.2}, "isolation": {"time_s": 1.5},
    "departure": {"time_s": 2.5},
})  # fmt: skip


@pytest.fixture
def found():
    """p within its bound but for the fault, q beyond it, r over no bound with what it has most of."""

    def of(axis, name):
        peak = PEAKS[axis].get(name, 0.0)
        return {"max": peak, "bound_share": None if name == "wind_turbulence" and peak else peak / BOUND}

    axes = {axis: {name: of(axis, name) for name in (*SOURCES, UNEXPLAINED)} for axis in "pqr"}
    axes["q"]["inertia"]["bound_share"] = charts.LEAST_SHARE  # just not shown
    axes["r"][UNEXPLAINED]["bound_share"] = 2 * charts.LEAST_SHARE
    return {"scenario": "case", "axes": axes}


@pytest.fixture
def frames(tmp_path, found):
    """Each column another wave, as high as the document says."""
    t = np.arange(0.0, 3.0, 0.05)
    columns = {"t_s": t}
    for axis, of in found["axes"].items():
        for i, (name, figures) in enumerate(of.items()):
            columns[column(axis, name)] = figures["max"] * np.sin((i + 1) * t)
        columns[column(axis, TOTAL)] = sum(columns[column(axis, name)] for name in of)
        columns[column(axis, ETA_BAR)] = BOUND + 0.001 * t
    with ParquetLog(tmp_path / "mismatch.parquet") as log:
        log.open(COLUMNS)
        log.write(np.column_stack([columns[name] for name in COLUMNS]))
    return tmp_path / "mismatch.parquet"


@pytest.fixture(scope="module")
def analysis():
    return analyse(
        scenario(design_model={"engine_terms": False}, uncertainty={"coefficients": {"Cm_q": 1.1}})
    )


def test_the_sources_over_the_bound(found, frames, changed):
    assert not changed(picture(charts.sources_figure(frames, found, marks(FLOWN))))


def test_only_sources_that_an_eye_can_tell_from_zero_are_drawn(found):
    assert charts.largest_sources(found, "p") == ["sinusoids", "inertia", "engine"]  # a thousandth is enough
    assert charts.largest_sources(found, "q") == ["engine", "coefficients", "sinusoids", "actuators"]
    assert charts.largest_sources(found, "r") == ["wind_turbulence", "simplification", "integration"]
    assert FAULT not in charts.SOURCE_LOOKS
    looks_of = charts.SOURCE_LOOKS.values()
    assert len(set(looks_of)) == len(charts.SOURCE_LOOKS) == len(SOURCES) - 1, "told apart in grey too"


def test_how_sources_and_models_are_drawn(changed):
    assert not changed({"sources": charts.SOURCE_LOOKS, "models": charts.MODEL_LOOKS})


def test_the_share_of_the_bound_of_each_source(found, changed):
    assert not changed(picture(charts.bound_figure(found)))
    for of in found["axes"].values():
        for figures in of.values():
            figures["bound_share"] = 0.0
    found["axes"]["p"]["engine"]["bound_share"] = 0.5
    assert not changed(picture(charts.bound_figure(found)), part="one source")
    found["axes"]["p"]["engine"]["bound_share"] = 0.0
    assert not changed(picture(charts.bound_figure(found)), part="nothing")


def test_flights_side_by_side(changed):
    def entry(name, ratios, why):
        worst = {f"{axis}_worst_ratio": ratio for axis, ratio in zip("pqr", ratios, strict=True)}
        return {"scenario": name, **worst, **{f"{axis}_dominant": why for axis in "pqr"}}

    flights = [
        entry("calm", (0.3, 0.0, 0.9), "sinusoids"),
        entry("wrong", (1.5, None, 1.0), "inertia_coupling"),
    ]
    assert not changed(picture(charts.comparison_figure(flights)))
    assert not changed(
        picture(charts.comparison_figure([entry("alone", (0.3, 0.4, 0.9), "engine")])), part="one"
    )
    many = [entry(f"flight {i}", (0.5, 0.6, 20.0), "engine") for i in range(4)]
    assert not changed(picture(charts.comparison_figure(many)), part="four")


@pytest.mark.parametrize("draw", [charts.linear_figure, charts.zeros_figure, charts.response_figure])
def test_the_linear_models_side_by_side(analysis, draw, changed):
    assert not changed(picture(draw(analysis, "case")))


def test_the_linear_models_in_numbers(analysis, changed):
    assert not changed(linear_document(analysis))


def test_the_map(changed):
    def entries(*ratios):
        places = [(V, h, axis) for h in (0.0, 1000.0) for V in (30.0, 45.5, 55.0) for axis in "pqr"]
        named = zip(places, ratios, strict=True)
        return [{"airspeed_mps": V, "altitude_m": h, "worst_ratio": ratio} for (V, h, _), ratio in named]

    ratios = [0.1 * (i + 1) ** 1.3 for i in range(18)]
    ratios[3:6], ratios[12] = [None] * 3, 0.0
    assert not changed(picture(charts.map_figure(entries(*ratios), "case")))
    assert not changed(picture(charts.map_figure(entries(*[None] * 18), "case")), part="no trim anywhere")
    assert not changed(picture(charts.map_figure(entries(*[0.5] * 18), "case")), part="all within")
    assert not changed(picture(charts.map_figure(entries(*[2.0] * 18), "case")), part="all beyond")


def test_every_picture_has_its_file(found, frames, analysis):
    made = charts.figures(frames.parent, found, FLOWN, analysis)
    assert {name: figure.get_suptitle().splitlines()[-1] for name, figure in made.items()} == {
        f"mismatch-{name}.png": "case" for name in ("sources", "bound", "linear", "zeros", "response")
    }
    assert all(isinstance(figure, Figure) for figure in made.values())
