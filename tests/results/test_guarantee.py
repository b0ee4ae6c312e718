"""What is said to be certain is so: each alarm against the guarantee of who raises it, or none is said."""

import pytest

import beaver_ftc as bf

LOSS = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.6, "at_s": 2.0}


def flown(faults=(LOSS,), changes=(), fdi=None, **keys):
    return bf.fly({
        "name": "certain", "duration_s": 6.0, "rate_hz": 50, "faults": list(faults), "fdi": fdi or {},
        "reference": {"q": [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.4}}]},
        "changes": list(changes), **keys,
    }, log=False)  # fmt: skip


@pytest.mark.parametrize("keys", [
    {}, {"fdi": {"authority": "worst-case", "statistical": {}}}, {"fdi": {"statistical": {}}},
    {"fdi": {"fault_class": "all"}}, {"substeps": 3},
    {"faults": [{**LOSS, "end_s": 4.0}]}, {"faults": [{**LOSS, "at_s": 3.0}, {**LOSS, "at_s": 2.003}]},
    {"changes": [{"at_s": 1.5, "law": "nominal"}]}, {"changes": [{"at_s": 2.5, "law": "nominal"}]},
])  # fmt: skip
def test_it_is_said_where_the_worst_case_counts_and_kept(keys):
    flight = flown(**keys)
    found = flight.metrics["detection"]
    assert 0.0 <= found["delay_s"] <= found["guaranteed_delay_s"] < 1.0
    assert "certain within" in str(flight)


@pytest.mark.parametrize(("change", "begins_s"), [
    ({"scheme": "adaptive-estimators"}, 3.0), ({"declared_sensors": "ideal"}, 3.0),
    ({"scheme": "adaptive-estimators", "law": "nominal"}, 3.0),
])  # fmt: skip
def test_of_a_diagnosis_begun_anew_it_counts_what_that_has_seen(change, begins_s):
    """The fault was certain long before, to the diagnosis that was replaced."""
    found = flown(changes=[{"at_s": begins_s, **change}]).metrics["detection"]
    assert found["time_s"] > begins_s
    assert begins_s - LOSS["at_s"] < found["guaranteed_delay_s"] < 2.0
    assert found["delay_s"] <= found["guaranteed_delay_s"]


@pytest.mark.parametrize("keys", [
    {"fdi": {"authority": "statistical", "statistical": {}}},
    {"fdi": {"scheme": "none"}}, {"fdi": {"scheme": "observer-constant"}},
    {"changes": [{"at_s": 1.0, "scheme": "observer-constant"}]},
    {"changes": [{"at_s": 1.0, "scheme": "none"}]},
    {"sensors": "tactical-grade"}, {"changes": [{"at_s": 1.0, "sensors": "tactical-grade"}]},
    {"uncertainty": {"coefficients": {"Cm_alpha": 1.2}}},
    {"faults": [{"sensor": "alpha", "type": "bias", "magnitude": 5.0, "at_s": 1.0}, LOSS]},
])  # fmt: skip
def test_nobody_is_bound_by_another_s_guarantee(keys):
    flight = flown(**keys)
    assert flight.metrics["detection"]["guaranteed_delay_s"] is None
    assert "certain within" not in str(flight)
