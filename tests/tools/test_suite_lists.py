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


def test_a_promise_without_a_test_and_a_test_that_is_not_there_are_said():
    table = {
        "kept": {"says": "a", "tests": ["tests/test_a.py::test_one"]},
        "empty": {"says": "b", "tests": []},
        "gone": {"says": "c", "tests": ["tests/test_a.py::test_one", "tests/test_a.py::test_gone"]},
        "by night": {"says": "d", "tests": ["tests/test_b.py::test_dear"]},
    }
    found = {"tests/test_a.py::test_one", "tests/test_b.py::test_dear"}
    assert list(promises.doubts(table, found, lists=(("tests/test_b.py",), ()))) == [
        "empty: no test of every day holds it",
        "gone: no such test: tests/test_a.py::test_gone",
        "by night: no test of every day holds it",
    ]


def test_what_runs_by_day_is_left_out_of_what_the_night_runs():
    lists = (("tests/test_a.py", "tests/test_b.py::test_c[1]"), ("tests/test_a.py::test_d",))
    names = ["tests/test_a.py::test_c", "tests/test_a.py::test_d", "tests/test_b.py::test_c[10]"]
    assert [promises.is_at_night(name, lists) for name in names] == [True, False, False]


def test_tests_are_found_in_files_and_classes():
    assert "tests/tools/test_suite_lists.py::test_tests_are_found_in_files_and_classes" in names()
    assert "tests/test_published_bars.py::TestElevatorLoss::test_tracking_is_recovered" in names()
