"""What was chosen by flights is claimed on others."""

import json
import re
from pathlib import Path

import pytest
from tools.docs.tables.chosen import (
    BETTER_DRAWS,
    CONSTANT_HEAD,
    RATIO_DRAWS,
    TUNED_DRAWS,
    _said,
    choices,
    chosen_constants,
    chosen_flights,
    draws_of,
)

from beaver_ftc.diagnosis.rivals import TUNED_FILE
from beaver_ftc.studies.reproduce.cases import PUBLISHED, keys_of
from beaver_ftc.studies.reproduce.choices import scenario
from beaver_ftc.studies.reproduce.reproduction import SETTINGS
from tools import gains

ROOT = Path(__file__).parents[2]
CHOICES = choices()


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: choice["constant"])
def test_no_claim_is_of_flights_that_a_constant_was_chosen_on(choice):
    on, claimed = draws_of(choice["flights"]), draws_of(choice["results"])
    assert not on & claimed
    assert bool(on) == bool(claimed)


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: choice["constant"])
def test_what_was_chosen_is_where_the_table_says(choice):
    file = ROOT / choice["where"]
    text = file.read_text()
    for name in re.findall(r"`([A-Za-z_]+)`", choice["constant"]):
        assert name in text, name


def test_the_sets_of_the_benchmark_are_read_and_apart():
    tuned = CHOICES[0]
    seeds = [seed for _, seed in sorted(draws_of(tuned["results"]))]
    assert len(seeds) > 15
    sets = {*range(201, 206), *range(211, 217)}
    flown = {seed + 1000 * draw for seed in sets for draw in TUNED_DRAWS}
    assert {seed for _, seed in draws_of(tuned["flights"])} == flown


def test_the_draws_of_tuned_values_are_listed_and_apart_from_those_of_the_ratio():
    last = [
        again["draw"] + again["judged"]
        for row in json.loads(TUNED_FILE.read_text())["methods"]
        for again in row.get("again", [])
    ]
    assert max(last, default=0) <= max(TUNED_DRAWS)
    drawn = [*RATIO_DRAWS, *BETTER_DRAWS, *TUNED_DRAWS]
    assert len({*drawn}) == len(drawn)


def test_no_flight_of_the_reproduction_is_one_that_its_gains_were_chosen_on():
    def key(flown):
        return flown.initial.airspeed_mps, *(
            (fault.type, getattr(fault, "actuator", None), getattr(fault, "magnitude", None), fault.at_s)
            for fault in flown.faults
        )

    tried = {key(scenario("x", changes)) for changes in (*gains.LOSSES, *gains.UNKNOWN)}
    flown = {
        key(scenario("x", keys_of(case, {k: v for k, v in setting.changes.items() if "options" not in k})))
        for setting in SETTINGS
        for case in PUBLISHED
    }
    assert len(tried) == 5
    assert not tried & flown
    assert not {airspeed for airspeed, *_ in tried} & {airspeed for airspeed, *_ in flown}


def test_a_row_says_its_constant_its_flights_and_its_results():
    """Under the same number and name in both tables."""
    head, _, first, *_ = chosen_constants().splitlines()
    assert head == "| " + " | ".join(CONSTANT_HEAD) + " |"
    assert first.startswith("| 1 | tuned parameters | all values in `grades` |")
    assert "| 201 to 205, 211 to 216 |" in chosen_flights().splitlines()[2]
    assert chosen_flights().splitlines()[2].endswith("| 101 to 111, 301 to 312 |")
    assert len(chosen_constants().splitlines()) == len(chosen_flights().splitlines())
    assert _said({"drawn_by": "x", "seeds": [3, 1, 2, 9]}) == "1 to 3, 9"
    assert _said({"says": "none"}) == "-"
