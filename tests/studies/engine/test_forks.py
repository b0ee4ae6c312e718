"""Pieces of work done by processes that inherit what this one has at the time; or by this one, in turn."""

import os
import signal
import time

import pytest

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.studies.engine import forks
from beaver_ftc.studies.engine.forks import Forks


@pytest.fixture
def two(monkeypatch):
    """Two cores, and a process that can be forked."""
    monkeypatch.setattr(forks, "cores", lambda: 2)
    monkeypatch.setattr(forks, "can_fork", lambda: True)


def counted(work):
    """A counter that each of five pieces takes on by 10, whoever does it, and `then_here` by 1."""
    counter, here = [0], os.getpid()

    def take_on(by):
        counter[0] += by
        return counter[0], os.getpid() == here

    for _ in range(5):
        work.submit(lambda: take_on(10), lambda: take_on(1))
    return work.results(), counter[0]


def test_a_piece_begins_with_what_this_process_has_done_instead_of_those_before_it(two):
    with Forks() as work:
        results, counter = counted(work)
    assert results == [(10, False), (11, False), (12, False), (13, False), (14, False)]
    assert counter == 5


@pytest.mark.parametrize(("wanted", "can"), [(False, True), (True, False)])
def test_this_process_does_what_no_other_may(two, monkeypatch, wanted, can):
    monkeypatch.setattr(forks, "can_fork", lambda: can)
    with Forks(wanted) as work:
        results, counter = counted(work)
    assert results == [(10, True), (20, True), (30, True), (40, True), (50, True)]
    assert counter == 50


def test_results_are_in_the_order_given_whoever_is_first_and_however_large(two):
    def late(k):
        time.sleep(0.05 * (3 - k))
        return [k] * 200_000  # more than a pipe holds

    with Forks() as work:
        for k in range(3):
            work.submit(lambda k=k: late(k))
        assert [(of[0], len(of)) for of in work.results()] == [(k, 200_000) for k in range(3)]


def test_what_a_piece_raises_is_raised_and_the_others_are_ended(two):
    began = time.monotonic()
    with Forks() as work:
        work.submit(lambda: time.sleep(60))
        work.submit(lambda: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            work.results()
    assert time.monotonic() - began < 30


def test_a_process_that_is_killed_is_missed(two):
    with Forks() as work:
        work.submit(lambda: os.kill(os.getpid(), signal.SIGKILL))
        with pytest.raises(SimulationFailed, match="has ended before it was done"):
            work.results()
