"""What the diagnosis of every type says it has found: the record's verdict in words, case by case."""

import numpy as np
import pytest
from kernels import put

from beaver_ftc.diagnosis.schemes import fdi_dtype
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH_GROUP
from beaver_ftc.diagnosis.types import verdict
from beaver_ftc.diagnosis.types.registry import TYPE_NAMES, TYPES
from fault_kinds import BIAS, CONSTANT_LOSS, FLOAT, STUCK
from telling import apart, fill

SURFACES = ("aileron", "elevator", "rudder", "flap")
AILERON, ELEVATOR, RUDDER, FLAP = range(4)
POSITION_OF = (4, 5, 6, 7)


def new(left=None, detected=1, pairs=0, verdict=NOT_ISOLATED, **fields):
    """A record in which these types are left, {surface: kinds}; other surfaces are excluded."""
    fdi = np.zeros(1, fdi_dtype(4))[0]
    fdi["verdict"]["detected"], fdi["verdict"]["isolated_estimator"], fdi["verdict"]["fault_type"] = (
        detected,
        verdict,
        -1,
    )
    fdi["verdict"]["isolated_at_s"], fdi["types"]["pair"]["enabled"] = 12.5, pairs
    fdi["types"]["pair"]["first_pitch"] = -1
    fdi["layout"]["position"], fdi["isolation"]["estimator"]["surface"][4:8] = POSITION_OF, range(4)
    fdi["layout"]["group"] = 1 - PITCH_GROUP
    fdi["layout"]["group"][[ELEVATOR, FLAP]] = PITCH_GROUP
    (
        fdi["types"]["surface"]["not_at_position"],
        fdi["types"]["surface"]["sets"]["excluded"],
    ) = 1, 1
    (
        fdi["types"]["surface"]["status"]["fault_type"],
        fdi["types"]["surface"]["status"]["typed_at_s"],
    ) = -1, -1.0
    for s, kinds in (left or {}).items():
        fdi["types"]["surface"]["not_at_position"][s] = 0
        fdi["types"]["surface"]["sets"]["excluded"][s][list(kinds)] = 0
    put(fdi, **fields)
    return fdi


def said(*kinds):
    return [TYPE_NAMES[kind] for kind in kinds]


def test_what_is_open_is_each_type_of_each_surface_that_is_possible():
    found = verdict.fault_finding_dict(new({AILERON: [STUCK, BIAS], RUDDER: [CONSTANT_LOSS]}), SURFACES)
    expected = [f"aileron:{kind}" for kind in said(*sorted((STUCK, BIAS)))] + said(CONSTANT_LOSS)
    assert found["candidates"] == (*expected[:-1], f"rudder:{expected[-1]}")
    assert found["isolated"] is None


def test_one_fault_is_told_with_its_instant_and_what_it_may_be():
    fdi = new({ELEVATOR: [STUCK, FLOAT]}, verdict=POSITION_OF[ELEVATOR])
    found = verdict.fault_finding_dict(fdi, SURFACES)
    assert (found["isolated"], found["isolation_type"]) == ("elevator", None)
    assert (found["isolation_time_s"], found["type_time_s"]) == (12.5, None)
    assert set(found["candidates"]) == set(said(STUCK, FLOAT))
    assert found["estimate"] is None
    assert found["frequency_rad_s"] is None
    fdi["verdict"]["fault_type"], fdi["verdict"]["typed_at_s"] = 0, 14.0
    found = verdict.fault_finding_dict(fdi, SURFACES)
    assert (found["isolation_type"], found["type_time_s"], found["candidates"]) == (
        TYPE_NAMES[0],
        14.0,
        (TYPE_NAMES[0],),
    )


@pytest.mark.parametrize("s", [AILERON, RUDDER, FLAP])
def test_a_parameter_is_said_of_its_own_surface_and_type(s):
    """Of records in which every number is another: sets as they are, of a loss as theta, 1 of it less."""
    fdi = new()
    sets = fdi["types"]["surface"]
    for surface in range(4):
        fill(sets[surface], seed=surface + 1)
    apart(low=sets["sets"]["low"], high=sets["sets"]["high"])
    for kind, off in ((STUCK, 0.0), (BIAS, 0.0), (CONSTANT_LOSS, 1.0)):
        low, high = sets["sets"]["low"][s, kind] - off, sets["sets"]["high"][s, kind] - off
        assert TYPES[kind].estimate_parameter_interval(fdi, s, kind) == pytest.approx((low, high))
    middle = 0.5 * (sets["sets"]["low"][s, STUCK] + sets["sets"]["high"][s, STUCK])
    assert TYPES[STUCK].estimate_parameter(fdi, s, STUCK) == pytest.approx(middle)
