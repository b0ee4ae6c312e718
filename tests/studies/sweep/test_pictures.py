"""The figures and the page, on the dozen flights counted by hand and on tables that have nothing to show."""

import re

import numpy as np
import pytest

from beaver_ftc.scenario.sweeps import load_sweep_text
from beaver_ftc.studies.sweep.outcomes import worst_flights
from beaver_ftc.studies.sweep.pictures import (
    FIGURES,
    confusion_matrix,
    delay_distribution,
    detection_probability,
    magnitude_key,
    parallel_coordinates,
    write_figures,
)
from beaver_ftc.studies.sweep.summary import summarise
from beaver_ftc.studies.sweep.summary_page import render

from .counted import NOTHING, ROWS, SWEEP, flights_of, row

HEALTHY = row(0, **{"fault.actuator": None, "fault.type": None, "fault.at_s": None})
FAILED = {**row(0, "failed"), **NOTHING, "reason": "it <broke>"}


@pytest.fixture
def flights(tmp_path):
    return flights_of(ROWS, tmp_path)


def summary_of(flights):
    sweep = load_sweep_text(SWEEP)
    document = summarise(flights, sweep)
    worst = worst_flights(flights, sweep, "beaver-ftc sweep counted.yaml")
    return document | {"worst": worst, "expectations": [], "passed": True, "versions": {"jsbsim": "1"}}


def test_the_probability_curve_shows_the_share_detected(flights):
    figure = detection_probability(flights, summary_of(flights))
    assert magnitude_key(flights, summary_of(flights)) == "faults[0].magnitude"
    (curve,) = [line for line in figure.axes[0].lines if line.get_marker() == "o"]
    np.testing.assert_allclose(curve.get_ydata(), [6 / 9])  # nine faults are too few for two bins


def test_the_delay_curve_ends_at_the_share_detected(flights):
    figure = delay_distribution(flights, summary_of(flights))
    curve = figure.axes[0].lines[0]
    np.testing.assert_allclose(curve.get_xdata(), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    assert curve.get_ydata()[-1] == pytest.approx(6 / 9)


def test_the_matrix_has_its_counts_written_in(flights):
    figure = confusion_matrix(flights, summary_of(flights))
    written = [text.get_text().split("\n")[0] for text in figure.axes[0].texts]
    assert sorted(map(int, written))[-3:] == [1, 3, 4]
    assert sum(map(int, written)) == 11


def test_each_flight_is_a_line_and_never_is_at_the_top(flights):
    figure = parallel_coordinates(flights, summary_of(flights))
    lines = [line.get_ydata() for line in figure.axes[0].lines if len(line.get_ydata()) == 2]
    drawn = [y for y in lines if not np.array_equal(y, [0, 1])]  # those are the axes
    assert len(drawn) == 12
    assert sum(y[-1] == 1.0 for y in drawn) == 3


@pytest.mark.parametrize(
    "rows", [[HEALTHY], [FAILED], [row(0)], ROWS], ids=["healthy", "failed", "missed", "all"]
)
def test_whatever_the_flights_are_there_is_a_page(rows, tmp_path):
    flights = flights_of(rows, tmp_path)
    document = summary_of(flights)
    drawn = write_figures(flights, document, tmp_path / "figures")
    assert {path.stem for path in drawn} <= set(FIGURES)
    page = render(document, tmp_path)
    assert page.count("<img ") == len(drawn)
    assert "it <broke>" not in page
    assert not re.search(r'(src|href)="https?:', page)
