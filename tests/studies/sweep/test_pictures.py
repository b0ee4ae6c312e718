"""The figures and the page, on the dozen flights counted by hand and on tables that have nothing to show."""

import re

import pytest

from beaver_ftc.scenario.sweeps import load_sweep_text
from beaver_ftc.studies.sweep.outcomes import worst_flights
from beaver_ftc.studies.sweep.pictures import (
    FIGURES,
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
