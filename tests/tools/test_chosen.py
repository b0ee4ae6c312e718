"""What was chosen by flights is claimed on others."""

import re
from pathlib import Path

import pytest
from tools.docs.tables.chosen import HEAD, _said, choices, chosen, draws_of

from beaver_ftc.studies.reproduce.cases import PUBLISHED, keys_of
from beaver_ftc.studies.reproduce.choices import scenario
from beaver_ftc.studies.reproduce.reproduction import SETTINGS
from tools import gains

ROOT = Path(__file__).parents[2]
CHOICES = choices()


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: choice["what"])
def test_no_claim_is_of_flights_that_a_constant_was_chosen_on(choice):
    on, claimed = draws_of(choice["flights"]), draws_of(choice["claims"])
    assert not on & claimed
    assert bool(on) == bool(claimed)


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: choice["what"])
def test_what_was_chosen_is_where_the_table_says(choice):
    file = ROOT / choice["where"]
    text = file.read_text()
    for name in re.findall(r"`([A-Za-z_]+)`", choice["what"]):
        assert name in text, name


def test_the_sets_of_the_benchmark_are_read_and_apart():
    tuned = CHOICES[0]
    seeds = [seed for _, seed in sorted(draws_of(tuned["claims"]))]
    assert len(seeds) > 15
    assert {seed for _, seed in draws_of(tuned["flights"])} == {*range(201, 206), *range(211, 217)}


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


def test_a_row_says_its_seeds():
    head, _, first, *_ = chosen().splitlines()
    assert head == "| " + " | ".join(HEAD) + " |"
    assert "| 201 to 205, 211 to 216 |" in first
    assert _said({"drawn_by": "x", "seeds": [3, 1, 2, 9]}) == "1 to 3, 9"
    assert _said({"says": "none"}) == "-"
