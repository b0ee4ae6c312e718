"""Compiled flights of covering arrays, beside the executable reference, column by column."""

from functools import cache
from itertools import islice

import pytest

from beaver_ftc.plugins import SERVICES, entries
from reference.comparison import differences
from reference.scenarios import scenarios
from samples import samples

SEED, FLIGHTS, PARTS = 1, samples(1000), 10  # by day one covering array of 124
DERIVES = "derive" in entries(SERVICES)  # without, no aircraft of the jsbsim package flies


@cache
def drawn():
    return [*islice(scenarios(SEED), FLIGHTS)]


@pytest.mark.parametrize("part", range(PARTS))
def test_columns_alarm_and_names_are_those_of_the_pages(part):
    flown = [one for one in drawn()[part::PARTS] if DERIVES or not one["aircraft"].startswith("jsbsim:")]
    different = {one["name"]: found for one in flown if (found := differences(one))}
    assert not different, "\n".join(f"{name}: {line}" for name, found in different.items() for line in found)
