"""An aircraft flown again is as freshly loaded, to the bit, whatever was flown in it before."""

from contextlib import suppress

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import needs
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.loop import Loop
from beaver_ftc.plant import conditions
from beaver_ftc.plant.conditions import ready
from beaver_ftc.plant.true_aircraft import take_off
from beaver_ftc.scenario.schema import load
from beaver_ftc.scenario.truth import Truth
from samples import samples
from scenario.drawn import scenarios

FLIGHTS = st.deferred(
    lambda: st.sampled_from([one for one in scenarios() if one["rate_hz"] <= 200.0]).map(load)
)


def scenario_of(flight, duration_s=1.5):
    reference = {"q": [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 1.0}}]}
    return load({"name": "again", "duration_s": duration_s, "reference": reference, **flight})


def flown(scenario):
    """The log of a flight, and its loop, which is given back."""
    loop = Loop(scenario)
    log = np.concatenate([rows.copy() for rows in loop.chunks()])
    loop.release()
    return log


def flown_in_a_fresh_one(scenario, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(conditions, "_free", {})
        patch.setattr(conditions, "_trims", {})
        return flown(scenario)


@settings(
    max_examples=samples(25), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(before=st.lists(FLIGHTS, min_size=1, max_size=3), flight=FLIGHTS)
def test_the_log_is_the_same_to_the_bit(before, flight, monkeypatch):
    with suppress(BadInput):  # where there is no trim
        expected = flown_in_a_fresh_one(flight, monkeypatch)
        for other in before:
            with suppress(BadInput):
                flown(other)
        np.testing.assert_array_equal(flown(flight), expected)


def test_nor_does_a_lost_aircraft_leave_a_trace(monkeypatch):
    healthy = scenario_of({"faults": []})
    expected = flown_in_a_fresh_one(healthy, monkeypatch)
    lost = scenario_of(
        {"faults": [{"actuator": "elevator", "type": "hardover", "direction": 1, "at_s": 0.1}]}, 30
    )
    assert len(flown(lost)) < 3000, "it was to be lost"
    np.testing.assert_array_equal(flown(healthy), expected)


def test_nor_do_numbers_that_are_none(monkeypatch):
    healthy = scenario_of({"faults": []})
    expected = flown_in_a_fresh_one(healthy, monkeypatch)
    plant = conditions.borrowed(100.0, 1, healthy.airframe)
    for name in ("fcs/elevator-cmd-rad", "uncertainty/Cm_0-scale", "atmosphere/gust-north-fps"):
        plant.write(name, np.nan)
    plant.run()
    assert np.isnan(plant.read("accelerations/qdot-rad_sec2"))
    conditions.give_back(plant)
    loop = Loop(healthy)
    assert loop.plant is plant
    np.testing.assert_array_equal(np.concatenate([rows.copy() for rows in loop.chunks()]), expected)


def readable(plant):
    """Every property JSBSim lists, but for its count of frames, and what a wheel that has never touched the
    ground has in memory."""
    lines = plant.fdm.query_property_catalog("").splitlines()
    names = [line.split(" ")[0] for line in lines if "R" in line.rpartition("(")[2]]
    counted = ("simulation/frame", "atmosphere/randomseed", "/side_friction_coeff")
    return {name: plant.read(name) for name in names if not name.endswith(counted) and plant.has(name)}


def differing(one, other):
    """Names of properties that are not the same to the bit; not a number is the same as itself."""
    return {name for name in one if not np.array_equal(one[name], other[name], equal_nan=True)}


def test_every_property_of_jsbsim_is_as_in_a_fresh_one(monkeypatch):
    scenario = scenario_of({"faults": []})
    with monkeypatch.context() as patch:
        patch.setattr(conditions, "_free", {})
        fresh, trim = ready(Truth.of(scenario))
        take_off(fresh, scenario, trim)
        expected = readable(fresh)
    gusty = {
        "environment": {
            "turbulence": "dryden",
            "severity": "severe",
            "gust": {"at_s": 0.1, "velocity_mps": [9.0, 0.0, 0.0]},
        }
    }
    flown(scenario_of(gusty | {"faults": [{"actuator": "flap", "type": "float", "at_s": 0.2}]}))
    again, trim = ready(Truth.of(scenario))
    take_off(again, scenario, trim)
    assert again is not fresh
    assert len(expected) > 500
    assert differing(readable(again), expected) == set()
    for _ in range(20):
        fresh.run()
        again.run()
    assert differing(readable(again), readable(fresh)) == set()


def test_a_changed_model_is_loaded_anew(tmp_path, monkeypatch):
    aircraft = scenario_of({"faults": []}).airframe
    plant = conditions.borrowed(100.0, 1, aircraft)
    conditions.give_back(plant)
    monkeypatch.setattr(conditions, "_last_written_ns", lambda model, second: (1,))
    assert conditions.borrowed(100.0, 1, aircraft) is not plant


@needs.service("derive")
def test_an_aircraft_with_engines_flies_alike_whether_its_trim_is_known_or_searched_for(monkeypatch):
    flight = load({"name": "again", "aircraft": "jsbsim:c172p", "duration_s": 1.5})
    searched_for = flown_in_a_fresh_one(flight, monkeypatch)
    flown(flight)
    np.testing.assert_array_equal(flown(flight), searched_for)
