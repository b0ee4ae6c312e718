"""Which losses are told from which other surface: by hand, by properties, and against flights."""

from math import inf

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import MemoryLog
from beaver_ftc.studies.detectability.certain import Excitation, excitation, judge, pairs_of
from beaver_ftc.studies.detectability.isolability import loss_limits
from flying import loss, scenario
from samples import samples

FAULTS = ("aileron", "elevator", "rudder")


def test_a_surface_that_tells_in_every_third_frame():
    """Of frames that exclude from 0.4, never, never, 0.8, never, never, 0.4, ..., two are to be enough."""
    least = np.array([0.4, inf, inf, 0.8, inf, inf] * 3 + [0.4])
    found = loss_limits(least, 2, 0.1)
    assert found["magnitude"] is None  # two frames of nothing
    assert found["longest_s"] == pytest.approx(0.3)
    found = loss_limits(least, 3, 0.1)
    assert (found["magnitude"], found["magnitude_median"]) == (0.8, 0.8)  # 0.4 in 8 of 17 instants
    # struck with the frame that tells, one before, two before: one, two, three frames
    assert (found["longest_s"], found["median_s"]) == (pytest.approx(0.3), pytest.approx(0.2))


@given(st.lists(st.one_of(st.just(inf), st.floats(0.01, 1.0)), min_size=4, max_size=30), st.integers(1, 4))
def test_a_total_loss_takes_no_longer_than_the_window_exactly_where_some_loss_is_certain(least, frames):
    found = loss_limits(np.array(least), frames, 1.0)
    soon = found["longest_s"] is not None and found["longest_s"] <= frames
    assert (found["magnitude"] is not None) == soon
    if found["median_s"] is not None and found["longest_s"] is not None:
        assert found["median_s"] <= found["longest_s"]


@settings(max_examples=samples(30))
@given(st.lists(st.tuples(*[st.sampled_from([-4.0, -2.0, 0.0, 0.5, 1.0, 3.0])] * 9), min_size=2, max_size=4))
def test_a_fault_that_is_isolated_is_told_from_every_other(moments):
    """`judge` says of a fault no more than each of its pairs."""
    z = np.array(moments).reshape(-1, 3, 3)
    seen = Excitation({name: z[:, k] for k, name in enumerate(FAULTS)}, np.full((len(z), 3), 0.5), 0.5)
    rows = pairs_of(seen)
    for fault in FAULTS:
        own = [row["magnitude"] for row in rows if row["fault"] == fault]
        isolated = judge(seen, fault)["isolated"]
        assert isolated is None or (None not in own and isolated >= max(own))


def test_another_surface_is_excluded_no_later_than_the_map_says():
    """The map follows from the healthy flight; a total loss must agree where it strikes."""
    flight = scenario(duration_s=6)
    row = next(r for r in pairs_of(excitation(flight)) if (r["fault"], r["other"]) == ("elevator", "aileron"))
    assert row["longest_s"] is not None
    for struck_s in (2.0, 3.1, 4.3):
        log = MemoryLog()
        fly(flight.with_({"faults": [loss("elevator", 1.0, struck_s)]}), log)
        excluded = log.rows[:, log.columns.index("fie_aileron_excluded")]
        told_s = log.rows[np.flatnonzero(excluded)[0], log.columns.index("t_s")]
        assert told_s - struck_s <= row["longest_s"] + 0.01 + 1e-9
