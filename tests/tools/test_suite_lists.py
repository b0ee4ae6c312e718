"""The lists beside the tests name tests that there are."""

from functools import cache

import pytest

from tools import promises

NIGHT = [row for row in promises.rows() if "night" in row]


@cache
def names():
    return frozenset(promises.tests())


def function_of(name):
    return name.partition("[")[0]


@pytest.mark.parametrize("row", NIGHT, ids=lambda row: row["night"][0])
def test_what_the_night_runs_is_held_by_day_too(row):
    for name in row["night"] + row["day"]:
        assert any(each.startswith(function_of(name)) for each in names()), name
    assert row["day"]
    assert not [name for name in row["day"] if promises.is_at_night(name)]


def test_of_what_there_are_many_cases_there_is_such_a_test():
    for name in promises.thinned():
        assert any(each.startswith(name) for each in names()), name


def test_every_promise_has_tests_of_every_day():
    assert list(promises.doubts(promises.table(), names())) == []
