"""The bound a flight needed, when it was exceeded, and what to declare."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.studies.mismatch.bound import (
    guarantee_with,
    recommend,
    recommended_for,
    rounded_up,
    settle,
    tally_of_flight,
    with_bound,
)
from beaver_ftc.studies.mismatch.sources import SOURCES
from beaver_ftc.studies.mismatch.split import Stretch, Tally
from flying import loss, scenario

CONSTANT = np.array([0.02, 0.02, 0.02])


def stretch(t_s, eta, fault=0.0, eta_bar=0.03, source="sinusoids"):
    """A stretch whose uncertainty on p is `eta` (n,), all of it from one source."""
    eta = np.asarray(eta, float)
    values = np.column_stack([eta, 0 * eta, 0 * eta])
    contributions = {name: np.zeros_like(values) for name in SOURCES}
    contributions[source], contributions["fault"] = values, values * 0.0 + fault
    total = values + contributions["fault"]
    place = np.column_stack([45.0 + eta, 1000.0 + eta, 0.1 + eta])
    return Stretch(np.asarray(t_s), total, contributions, {}, np.full_like(values, eta_bar), place)


def kept(*stretches):
    found = Tally(CONSTANT, 0.1)
    for each in stretches:
        found.add(each)
    return found


def test_the_smallest_constant_leaves_the_rest_of_the_bound_as_it_is():
    """eta_bar 0.03 = 0.01 of inertia + 0.02 constant: |eta| = 0.05 needs a constant of 0.04."""
    found = kept(stretch([0.0, 0.1], [0.01, -0.05])).bounds[0]
    assert found.smallest_constant_rad_s2 == pytest.approx(0.04)
    assert found.worst_ratio == pytest.approx(0.05 / 0.03)
    assert found.worst_at_s == 0.1


def test_a_fault_is_no_uncertainty():
    found = kept(stretch([0.0, 0.1], [0.01, 0.01], fault=9.0)).bounds[0]
    assert found.smallest_constant_rad_s2 == 0.0
    assert found.exceeded_frames == 0


def test_stays_above_the_bound_are_timed_also_across_stretches():
    t = np.arange(10) / 10
    eta = np.array([0, 0.04, 0.05, 0.04, 0, 0, 0.06, 0, 0, 0.04])
    whole = kept(stretch(t, eta)).bounds[0]
    assert [(round(s["start_s"], 9), round(s["end_s"], 9)) for s in whole.exceedances] == [
        (0.1, 0.4),
        (0.6, 0.7),
        (0.9, 1.0),
    ]
    assert whole.exceedances[0]["peak_ratio"] == pytest.approx(0.05 / 0.03)
    assert whole.exceedances[0]["peak_s"] == pytest.approx(0.2)
    peak = whole.exceedances[0]
    assert (peak["airspeed_mps"], peak["altitude_m"], peak["alpha_rad"]) == pytest.approx(
        (45.05, 1000.05, 0.15)
    )
    assert (whole.exceeded_frames, whole.stays) == (5, 3)
    for cut in range(1, 10):
        parts = kept(stretch(t[:cut], eta[:cut]), stretch(t[cut:], eta[cut:])).bounds[0]
        assert parts.exceedances == whole.exceedances
        assert parts.stays == whole.stays


def test_a_stay_names_its_source():
    found = kept(stretch([0.0], [0.05], source="engine")).bounds[0]
    assert found.exceedances[0]["source"] == "engine"


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
    needed = [b.smallest_constant_rad_s2 for b in tally_of_flight(with_constant(CONSTANT))[0].bounds]
    covered, flown = tally_of_flight(with_constant([1.000001 * c for c in needed]))
    assert all(bound.exceeded_frames == 0 for bound in covered.bounds)
    assert not flown.false_alarm
    short, _ = tally_of_flight(with_constant([0.99 * c for c in needed]))
    assert all(bound.exceeded_frames > 0 for bound in short.bounds)


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


def test_the_recommended_bound_covers_the_flight_it_makes():
    """With the published bound a wrong mass alarms and another law flies on; without, it needs more."""
    case = scenario(design_model={"mass": 1.1}, faults=[loss(at_s=6)], duration_s=12)
    kept, flown = tally_of_flight(case)
    assert flown.false_alarm
    constant, settled = settle([case], [kept])
    assert settled
    again, flown_with_it = tally_of_flight(with_bound(case, constant))
    assert not again.exceeded
    assert not flown_with_it.false_alarm


def test_no_bound_is_recommended_under_which_a_flight_then_raises_a_false_alarm():
    """A calm flight needs little; the published case, flown with as little, would alarm before its fault."""
    calm = scenario(duration_s=6, uncertainty={})
    kept, _ = tally_of_flight(calm)
    needed = recommend([kept])
    assert guarantee_with(needed, calm)["false_alarm"]
    found = recommended_for([calm], [kept])
    assert found["guarantee"]["recommended"]["false_alarm"] is False
    assert found["recommended"]["settled"]
    assert found["recommended"]["runs"] == 1
    assert found["recommended"]["coverage"] == 1 / 2
    again, flown = tally_of_flight(with_bound(calm, found["recommended"]["constant_rad_s2"]))
    assert not again.exceeded
    assert not flown.false_alarm
