"""What was chosen by flights is claimed on others."""

import json
import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from tools.docs.tables.benchmark import TUNING
from tools.docs.tables.chosen import (
    BETTER_DRAWS,
    CONSTANT_HEAD,
    ORIGINS,
    RATIO_DRAWS,
    TUNED_DRAWS,
    _constants,
    _flights,
    _others,
    _said,
    choices,
    draws_of,
    not_chosen_constants,
)

from beaver_ftc.studies.reproduce.cases import PUBLISHED, keys_of
from beaver_ftc.studies.reproduce.choices import scenario
from beaver_ftc.studies.reproduce.reproduction import SETTINGS
from tools import gains

ROOT = Path(__file__).parents[2]
CHOICES, NOT_CHOSEN = choices(), not_chosen_constants()


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


@pytest.mark.parametrize("file", NOT_CHOSEN)
def test_each_number_of_the_diagnosis_of_logs_was_chosen_or_has_an_origin(file):
    module, assigned = (
        import_module(f"beaver_ftc_logs.{Path(file).stem}"),
        r"^(_?[A-Z][A-Z\d_, ]+?)(?:: .*)? = (?!range)",
    )
    names = {
        name
        for line in re.findall(assigned, (ROOT / file).read_text(), re.MULTILINE)
        for name in line.split(", ")
    }
    numbers = {name for name in names if np.asarray(getattr(module, name)).dtype.kind in "if"}
    chosen = {
        name
        for choice in CHOICES
        if choice["where"] == file
        for name in re.findall(r"`(\w+)`", choice["constant"])
    }
    assert len(numbers) > 4
    assert numbers - chosen == set(NOT_CHOSEN[file])
    assert all(origin.partition(":")[0] in ORIGINS for origin in NOT_CHOSEN[file].values())


def test_a_constant_that_was_not_chosen_has_its_value_of_the_code_and_its_origin():
    rows = _others().splitlines()
    assert (
        "| `_RANGE_QUANTILES` | 0.001, 0.999 | judged | one sample in 500 is an outlier | trust.py |" in rows
    )
    assert len(rows) == 2 + sum(map(len, NOT_CHOSEN.values()))


def test_no_page_prints_logs_that_a_constant_was_chosen_on():
    chosen = {seed for choice in CHOICES for by, seed in draws_of(choice["flights"]) if by == "own_logs"}
    command = r"printed: python -m benchmarks\.(?:own_logs|wrong_columns) .*?--seed (\d+)"
    pages = [path.read_text() for path in (ROOT / "docs").rglob("*.md")]
    printed = {int(seed) for page in pages for seed in re.findall(command, page)}
    assert printed
    assert not printed & chosen


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
        for row in json.loads(TUNING.read_text())["methods"]
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
    head, _, first, *_ = _constants().splitlines()
    assert head == "| " + " | ".join(CONSTANT_HEAD) + " |"
    assert first.startswith("| 1 | tuned parameters | all values in `grades` |")
    assert "| 201 to 205, 211 to 216 |" in _flights().splitlines()[2]
    assert _flights().splitlines()[2].endswith("| 101 to 111, 301 to 312 |")
    assert len(_constants().splitlines()) == len(_flights().splitlines())
    assert _said({"drawn_by": "x", "seeds": [3, 1, 2, 9]}) == "1 to 3, 9"
    assert _said({"says": "none"}) == "-"
