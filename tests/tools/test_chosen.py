"""What was chosen by flights is claimed on others."""

import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from tools.docs.tables.chosen import (
    ORIGINS,
    choices,
    draws_of,
    not_chosen_constants,
)

ROOT = Path(__file__).parents[2]
CHOICES, NOT_CHOSEN = choices(), not_chosen_constants()


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: choice["constant"])
def test_no_claim_is_of_flights_that_a_constant_was_chosen_on(choice):
    on, claimed = draws_of(choice["flights"]), draws_of(choice["results"])
    assert not on & claimed
    assert bool(on) == bool(claimed)


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: choice["constant"])
def test_what_was_chosen_is_where_the_table_says(choice):
    text = "".join((ROOT / file).read_text() for file in choice["where"].split(", "))
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
        if file in choice["where"].split(", ")
        for name in re.findall(r"`(\w+)`", choice["constant"])
    }
    assert numbers
    assert numbers - chosen == set(NOT_CHOSEN[file])
    assert all(origin.partition(":")[0] in ORIGINS for origin in NOT_CHOSEN[file].values())


def test_no_page_prints_logs_that_a_constant_was_chosen_on():
    chosen = {seed for choice in CHOICES for by, seed in draws_of(choice["flights"]) if by == "own_logs"}
    command = r"printed: python -m benchmarks\.(?:own_logs|wrong_columns) .*?--seed (\d+)"
    pages = [path.read_text() for path in (ROOT / "docs").rglob("*.md")]
    printed = {int(seed) for page in pages for seed in re.findall(command, page)}
    assert printed
    assert not printed & chosen
