"""Compiled flights of covering arrays, beside the executable reference, column by column."""

from functools import cache
from itertools import islice

import pytest

from beaver_ftc.plugins import SERVICES, entries
from reference.comparison import differences
from reference.scenarios import scenarios
from samples import samples

SEED, PARTS = 1, 10
FLIGHTS = (
    samples(1000),
    samples(480),
    samples(240),
    samples(400),
)  # by day one covering array of 120, most of one of faults of all types, a part of one in gusts, of parity
DERIVES = "derive" in entries(SERVICES)  # without, no aircraft of the jsbsim package flies


@cache
def drawn(kind):
    return [*islice(scenarios(SEED, kind), FLIGHTS[kind])]


def differing(drawn):
    """A line for each difference."""
    flown = [one for one in drawn if DERIVES or not one["aircraft"].startswith("jsbsim:")]
    return [f"{one['name']}: {line}" for one in flown for line in differences(one)]


@pytest.mark.parametrize("part", range(PARTS))
def test_columns_alarm_and_names_are_those_of_the_pages(part):
    assert differing(drawn(0)[part::PARTS]) == []


@pytest.mark.parametrize("part", range(PARTS))
def test_types_and_candidates_are_those_of_the_page(part):
    assert differing(drawn(1)[part::PARTS]) == []


@pytest.mark.parametrize("part", range(PARTS))
def test_the_statistical_detector_in_gusts_is_that_of_the_page(part):
    assert differing(drawn(2)[part::PARTS]) == []


@pytest.mark.parametrize("part", range(PARTS))
def test_parity_directions_are_those_of_the_page(part):
    assert differing(drawn(3)[part::PARTS]) == []
