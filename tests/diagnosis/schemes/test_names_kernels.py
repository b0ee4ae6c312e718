"""What a flight remembers of the names that its diagnosis has given, and taken back."""

from itertools import groupby

from hypothesis import given
from hypothesis import strategies as st
from kernels import new_fdi

from beaver_ftc.diagnosis.conclusion import (
    MAX_WITHDRAWN,
    SENSOR_BROKEN,
    TYPES_REFUTED,
    reset_conclusion,
    update_interval,
)
from beaver_ftc.diagnosis.state import NOT_ISOLATED

ELEVATOR, FLAP = 1, 3


def nameless():
    fdi = new_fdi()
    fdi["verdict"]["from_s"], fdi["verdict"]["isolated_estimator"] = -1.0, NOT_ISOLATED
    fdi["isolation"]["estimator"]["surface"][:4] = range(4)
    return fdi


def spells(named):
    """(from, to) of each run of frames with a name that has ended, by frame numbers."""
    runs, k = [], 0
    for is_named, frames in groupby(named):
        length = len(list(frames))
        if is_named and k + length < len(named):
            runs.append((k, k + length))
        k += length
    return runs


@given(st.lists(st.tuples(st.booleans(), st.booleans()), max_size=200))
def test_every_spell_of_a_name_is_kept_and_of_too_many_the_latest(frames):
    conclusion = nameless()["verdict"]
    for k, named in enumerate(frames):
        for s, is_named in zip((ELEVATOR, FLAP), named, strict=True):
            update_interval(conclusion, s, is_named, float(k), -1, SENSOR_BROKEN)
    expected = sorted(
        (to, s, start)
        for s, column in zip((ELEVATOR, FLAP), zip(*frames, strict=True), strict=False)
        for start, to in spells(column)
    )
    assert conclusion["n_gone"] == len(expected)
    if len(expected) > MAX_WITHDRAWN:
        expected = [*expected[: MAX_WITHDRAWN - 1], expected[-1]]
    kept = conclusion["gone"][: len(expected)]
    assert [(one["to_s"], one["surface"], one["from_s"]) for one in kept] == expected


@given(st.lists(st.sampled_from([None, -1, 3, 5]), max_size=60))
def test_every_spell_of_a_type_is_kept_unless_the_name_ends_with_it(frames):
    """None: no name. A type that ends with its name is kept with the name."""
    conclusion = nameless()["verdict"]
    reset_conclusion(conclusion)
    for k, kind in enumerate(frames):
        open_or_kind = -1 if kind is None else kind
        update_interval(conclusion, FLAP, kind is not None, float(k), open_or_kind, TYPES_REFUTED + k % 2)
    ends, start = [], 0
    for k in range(1, len(frames)):
        if frames[k] != frames[k - 1]:
            ends.append((start, k, frames[k - 1], frames[k]))
            start = k
    of_types = [(a, b, kind) for a, b, kind, then in ends if kind in (3, 5) and then is not None]
    of_names = [(b, kind) for _, b, kind, then in ends if then is None and kind is not None]
    assert conclusion["n_gone_types"] == len(of_types)
    kept = conclusion["withdrawn_types"][: min(len(of_types), MAX_WITHDRAWN)][:-1]
    assert [(t["from_s"], t["to_s"], t["fault_type"]) for t in kept] == of_types[: len(kept)]
    names = conclusion["gone"][: min(len(of_names), MAX_WITHDRAWN)][:-1]
    assert [(n["to_s"], n["fault_type"]) for n in names] == of_names[: len(names)]
    assert all(one["reason"] == TYPES_REFUTED + one["to_s"] % 2 for one in (*kept, *names))
