"""Timing side by side: order, preparation, and the figures made of it."""

import gc
import statistics

import numpy as np
import pytest

from beaver_ftc.studies.bench.contenders import interleave, quartiles


class Clock:
    """Time passes only while someone flies."""

    def __init__(self):
        self.ns = 0

    def __call__(self):
        return self.ns


class Runner:
    def __init__(self, name, us_a_frame, clock, diary):
        self.name, self.us_a_frame, self.clock, self.diary = name, us_a_frame, clock, diary

    def prepare(self):
        self.diary.append(f"prepare {self.name}")
        self.clock.ns += 10**9  # must not be counted

    def fly(self, frames):
        assert not gc.isenabled(), "a collection would be charged to whoever flies just then"
        self.diary.append(self.name)
        self.clock.ns += round(1000 * self.us_a_frame * frames)


def test_each_is_prepared_then_timed_in_an_order_that_turns_round():
    clock, diary = Clock(), []
    us = interleave([Runner("a", 2.0, clock, diary), Runner("b", 5.0, clock, diary)], 2, 100, clock)
    assert diary == ["prepare a", "a", "prepare b", "b", "prepare b", "b", "prepare a", "a"]
    assert us == pytest.approx(np.array([[2.0, 5.0], [2.0, 5.0]]))
    assert gc.isenabled()


def test_median_and_quartiles():
    values = np.array([9.0, 1.0, 4.0, 2.0, 7.0])
    assert quartiles(values) == statistics.quantiles(values.tolist(), n=4, method="inclusive")
    assert quartiles(values) == [2.0, 4.0, 7.0]
