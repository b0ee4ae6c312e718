"""What makes a study another one than that whose flights are there."""

import pytest

from beaver_ftc.studies.engine.identity import differences


@pytest.mark.parametrize(
    ("then", "now", "differ"),
    [
        ({"a": 1, "b": 2}, {"a": 1, "b": 2}, []),
        ({"a": 1, "b": 2}, {"a": 1}, ["b"]),
        ({"a": 1}, {"a": 1, "b": 2}, ["b"]),
        ({"a": 1, "c": 0}, {"a": 2, "b": 2}, ["a", "b", "c"]),
    ],
)
def test_keys_that_changed_came_or_went_are_named(then, now, differ):
    assert sorted(differences(then, now)) == differ
