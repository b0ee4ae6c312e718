"""The bound a flight needed, when it was exceeded, and what to declare."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.studies.mismatch.bound import (
    guarantee_with,
    recommended_for,
    rounded_up,
    split_flight,
    with_bound,
)
from beaver_ftc.studies.mismatch.sources import SOURCES
from beaver_ftc.studies.mismatch.split import Split
from beaver_ftc.studies.mismatch.tables import BOUNDS
from flying import loss, scenario

CONSTANT = np.array([0.02, 0.02, 0.02])


def flight_of(t_s, eta, fault=0.0, eta_bar=0.03, source="sinusoids"):
    """A flight whose uncertainty on p is `eta` (n,), all of it from one source."""
    eta = np.asarray(eta, float)
    values = np.column_stack([eta, 0 * eta, 0 * eta])
    contributions = {name: np.zeros_like(values) for name in SOURCES}
    contributions[source], contributions["fault"] = values, values * 0.0 + fault
    total = values + contributions["fault"]
    place = np.column_stack([45.0 + eta, 1000.0 + eta, 0.1 + eta])
    return Split(
        np.asarray(t_s), total, contributions, {}, np.full_like(values, eta_bar), CONSTANT, place, 0.1
    )


def test_the_smallest_constant_leaves_the_rest_of_the_bound_as_it_is():
    """eta_bar 0.03 = 0.01 of inertia + 0.02 constant: |eta| = 0.05 needs a constant of 0.04."""
    found = flight_of([0.0, 0.1], [0.01, -0.05]).bound(0)
    assert found["smallest_constant_rad_s2"] == pytest.approx(0.04)
    assert found["worst_ratio"] == pytest.approx(0.05 / 0.03)
    assert found["worst_at_s"] == 0.1


def test_a_fault_is_no_uncertainty():
    found = flight_of([0.0, 0.1], [0.01, 0.01], fault=9.0).bound(0)
    assert found["smallest_constant_rad_s2"] == 0.0
    assert found["exceeded_times"] == 0


def test_stays_above_the_bound_are_timed_and_name_their_source():
    eta = np.array([0, 0.04, 0.05, 0.04, 0, 0, 0.06, 0, 0, 0.04])
    found = flight_of(np.arange(10) / 10, eta, source="engine").bound(0)
    stays = [(stay["start_s"], stay["end_s"]) for stay in found["exceedances"]]
    assert np.ravel(stays) == pytest.approx([0.1, 0.4, 0.6, 0.7, 0.9, 1.0])
    peak = found["exceedances"][0]
    assert peak["source"] == "engine"
    keys = ("peak_ratio", "peak_s", "airspeed_mps", "altitude_m", "alpha_rad")
    assert [peak[key] for key in keys] == pytest.approx([0.05 / 0.03, 0.2, 45.05, 1000.05, 0.15])
    assert (found["exceeded_s"], found["exceeded_times"]) == (pytest.approx(0.5), 3)


def test_nothing_is_no_share_of_a_bound_of_nothing():
    found = flight_of([0.0, 0.1], [0.1, 0.0], eta_bar=0.0)
    assert found.shares(found.total)[:, 0].tolist() == [np.inf, 0.0]
    assert found.exceeded
    assert found.bound(0)["worst_ratio"] is None
    assert not flight_of([0.0], [0.01]).exceeded


def test_a_bound_of_zero_is_exceeded_most():
    reason_of = BOUNDS[-1][-1]
    assert (
        reason_of([{"peak_ratio": 2.0, "source": "engine"}, {"peak_ratio": None, "source": "sensors"}])
        == "sensors"
    )


@given(st.floats(1e-9, 1e3))
def test_rounding_up_goes_up_and_by_less_than_a_tenth_and_a_half(value):
    up = rounded_up(value)
    assert value * (1 - 1e-8) <= up <= value * 1.11
    assert float(f"{up:.1e}") == pytest.approx(up)


def with_constant(constant):
    bounds = {"constant_rad_s2": dict(zip("pqr", constant, strict=True))}
    return scenario(
        design_model={"engine_terms": False}, duration_s=8, control={"law": "nominal"}, fdi={"bounds": bounds}
    )


def test_the_smallest_constant_would_have_covered_the_run_and_less_would_not():
    """Under the nominal law the bound changes nothing in the flight: fly it again with what it needed."""
    needed = split_flight(with_constant(CONSTANT))[0].smallest_constant
    covered, flown = split_flight(with_constant(1.000001 * needed))
    assert not covered.exceeded
    assert not flown.false_alarm
    short, _ = split_flight(with_constant(0.99 * needed))
    assert all(short.bound(axis)["exceeded_times"] > 0 for axis in range(3))


def test_a_larger_bound_guarantees_the_published_case_later_or_never():
    case = scenario(faults=[loss()])
    found = [guarantee_with(dict.fromkeys("pqr", c), case) for c in (0.02, 0.1, 0.3, 20.0)]
    delays = [np.inf if g["guaranteed_delay_s"] is None else g["guaranteed_delay_s"] for g in found]
    assert delays == sorted(delays)
    assert delays[0] <= 0.1
    assert delays[-1] == np.inf
    assert not any(g["false_alarm"] for g in found)
    assert all(
        g["detection_delay_s"] is None or g["detection_delay_s"] <= d + 1e-9
        for g, d in zip(found, delays, strict=True)
    )


@pytest.mark.parametrize(
    "flown",
    [
        # needs little; the published case, with as little, would alarm
        {"duration_s": 6, "uncertainty": {}},
        # alarms with the declared bound, after which another law flies
        {"design_model": {"mass": 1.1}, "faults": [loss(at_s=6)], "duration_s": 12},
    ],
)
def test_the_recommended_bound_covers_the_flight_that_it_makes_and_the_published_case(flown):
    case = scenario(**flown)
    found = recommended_for([case], [split_flight(case)[0].smallest_constant])
    assert found["guarantee"]["recommended"]["false_alarm"] is False
    assert found["recommended"]["settled"]
    assert found["recommended"]["runs"] == 1
    assert found["recommended"]["coverage"] == 0.0  # a second flight may be the worst on each of three axes
    again, metrics = split_flight(with_bound(case, found["recommended"]["constant_rad_s2"]))
    assert not again.exceeded
    assert not metrics.false_alarm
