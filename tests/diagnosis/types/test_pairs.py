"""Pairs of faults on the plant where the theory holds exactly, against an uncertainty that fights them."""

import numpy as np
import pytest
from design_plant import UNCERTAINTIES, DesignPlant
from hypothesis import given, settings
from hypothesis import strategies as st
from test_fault_types import SURFACES, TYPES, shares, uncertainties

from beaver_ftc.diagnosis.types import registry as types
from beaver_ftc.diagnosis.types.findings import fault_finding_dict
from flying import flown
from samples import samples

AILERON, ELEVATOR, RUDDER = range(3)
kinds = st.sampled_from(list(TYPES))
starts = st.integers(0, 300)


def fly(seed, uncertainty, faults, frames=700, pairs=True):
    """faults: (surface, kind, first frame, share)."""
    positions = [(s, TYPES[kind][0](s, at, share, 0.02)) for s, kind, at, share in faults]
    (surface, position), *beside = positions
    plant = DesignPlant(
        seed=seed,
        rate_hz=50.0,
        surface=surface,
        position=position,
        beside=beside,
        fault_class="all",
        pairs=pairs,
    )
    return plant.fly(frames, uncertainty)


def check(plant, faults):
    """No surface named that is healthy, no type named or excluded wrongly."""
    true = {
        ("aileron", "elevator", "rudder")[s]: types.TYPE_NAMES[TYPES[kind][1]] for s, kind, _, _ in faults
    }
    for one in fault_finding_dict(plant.fdi, SURFACES)["faults"]:
        if one["isolated"]:
            assert one["isolated"] in true
            assert one["isolation_type"] in (true[one["isolated"]], None)
            assert true[one["isolated"]] in one["candidates"]


@settings(max_examples=samples(60), deadline=None)
@given(st.integers(0, 2**32), uncertainties, kinds, kinds, starts, starts, shares, shares)
def test_ailerons_and_rudder(seed, uncertainty, kind, other, at, later, share, other_share):
    faults = (AILERON, kind, at, share), (RUDDER, other, later, other_share)
    plant = fly(seed, uncertainty, faults)
    check(plant, faults)
    for surface, one, _, _ in faults:
        assert not plant.fdi["types"]["surface"][surface]["sets"]["excluded"][TYPES[one][1]]
    assert not plant.fdi["types"]["pair"]["lateral_outside"]


@settings(max_examples=samples(40), deadline=None)
@given(st.integers(0, 2**32), uncertainties, kinds, kinds, starts, starts, shares, shares)
def test_a_fault_in_each_plane(seed, uncertainty, kind, other, at, later, share, other_share):
    faults = (ELEVATOR, kind, at, share), (RUDDER, other, later, other_share)
    check(fly(seed, uncertainty, faults), faults)


@settings(max_examples=samples(40), deadline=None)
@given(st.integers(0, 2**32), uncertainties, kinds, st.integers(0, 2), starts, shares)
def test_one_fault_is_not_taken_for_two(seed, uncertainty, kind, surface, at, share):
    faults = ((surface, kind, at, share),)
    plant = fly(seed, uncertainty, faults)
    check(plant, faults)
    assert len(fault_finding_dict(plant.fdi, SURFACES)["faults"]) <= 1


def test_both_are_named_and_a_search_for_one_finds_neither():
    faults = (AILERON, "stuck", 30, 0.6), (RUDDER, "bias", 200, 0.8)
    plant = fly(4, UNCERTAINTIES["random"], faults)
    assert {one["isolated"] for one in fault_finding_dict(plant.fdi, SURFACES)["faults"]} == {
        "aileron",
        "rudder",
    }
    alone = fly(4, UNCERTAINTIES["random"], faults, pairs=False)
    assert fault_finding_dict(alone.fdi, SURFACES)["isolated"] == "unanticipated"


@pytest.mark.parametrize("thresholds", ["published", "interval"])
def test_what_the_estimators_suppose_is_there_in_the_frame_of_the_alarm(thresholds):
    """Without it, 0/0: where the surface was is not a number, and the law commands it."""
    flight, log = flown(
        duration_s=6,
        fdi={"fault_class": "all", "pairs": True, "thresholds": thresholds},
        control={"law": "fault-tolerant"},
        faults=[{"type": "hardover", "actuator": "elevator", "direction": 1, "at_s": 3}],
    )
    assert flight.isolated == "elevator"
    assert np.isfinite(log["elevator_cmd_rad"]).all()
