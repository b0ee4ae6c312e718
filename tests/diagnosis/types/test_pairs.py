"""Pairs of faults on the plant where the theory holds exactly, against an uncertainty that fights them."""

import numpy as np
import pytest
from design_plant import UNCERTAINTIES, DesignPlant
from hypothesis import strategies as st
from test_fault_types import SURFACES, TYPES

from beaver_ftc.diagnosis.types.findings import fault_finding_dict
from flying import flown

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
