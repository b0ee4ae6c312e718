"""Random pairs of faults on the truth: no surface and no type is named wrongly, no true pair is excluded."""

import numpy as np
import pytest
from test_random_faults import conditions, drawn

from beaver_ftc.loop.loop import fly
from beaver_ftc.results.metrics import metrics
from flying import scenario
from samples import samples

PLANES = (("elevator", "flap"), ("aileron", "rudder"))
SURFACES = ("aileron", "elevator", "rudder", "flap")
FLIGHTS = samples(60)
FLAP_UP_DEG = -5.7  # its upper stop is at -5.73


def two_faults(rng, repaired):
    """On different surfaces, at once or one after the other."""
    at_s = 2 + rng.integers(0, 600) / 100
    later_s = at_s + (rng.uniform(0, 8) if rng.random() < 0.7 else 0.0)
    faults = [drawn(rng, at_s), drawn(rng, later_s)]
    others = [surface for surface in SURFACES if surface != faults[0]["actuator"]]
    faults[1]["actuator"] = others[rng.integers(3)]
    for fault in faults:
        if not repaired:
            fault.pop("end_s", None)
        if fault["actuator"] == "flap" and "position_deg" in fault:
            fault["position_deg"] = max(fault["position_deg"], FLAP_UP_DEG)
    return faults


def flight_of(rng, actuators, repaired):
    faults = two_faults(rng, repaired)
    return scenario(
        duration_s=faults[0]["at_s"] + 20,
        **conditions(rng),
        faults=faults,
        actuators=actuators,
        fdi={"fault_class": "all", "pairs": True},
    )


def mistakes(document, faults):
    """What is wrong with the verdict on these faults."""
    true = {fault.actuator: fault.type for fault in faults}
    named = {found["fault"]: found for found in document["isolation"]["faults"] if found["fault"]}
    wrong = [surface for surface in named if surface not in true]
    for surface in named.keys() & true.keys():
        kind = named[surface]["type"]
        left = named[surface]["candidates"]
        if (kind or true[surface]) != true[surface] or (left and true[surface] not in left):
            wrong.append((surface, kind, left))
    for plane in PLANES:
        hit = [surface for surface in plane if surface in true]
        if hit and not named.keys() & set(plane) and document["isolation"]["fault"] == "unanticipated":
            wrong.append((plane, "unanticipated"))
        if len(hit) == 1:
            wrong += excluded_in(document, plane, hit[0], true[hit[0]])
    return wrong + (["false alarm"] if document["false_alarm"] else [])


def excluded_in(document, plane, surface, kind):
    """Where a plane is open, the one fault in it must still be possible."""
    open_here = [
        found["candidates"]
        for found in document["isolation"]["faults"]
        if found["fault"] is None and "+".join(plane) in found["candidates"]
    ]
    return [left for left in open_here if surface not in left and f"{surface}:{kind}" not in left]


@pytest.mark.parametrize(("actuators", "repaired"), [("ideal", False), ("servo", True)])
def test_no_pair_is_named_wrongly_or_excluded(actuators, repaired):
    rng = np.random.default_rng(2024)
    wrong = []
    both = 0
    for _ in range(FLIGHTS):
        flight = fly(flight_of(rng, actuators, repaired))
        document = metrics(flight)
        found = mistakes(document, flight.scenario.faults)
        both += sum(found["fault"] is not None for found in document["isolation"]["faults"]) == 2
        if found:
            wrong.append((flight.scenario.faults, found))
    assert wrong == []
    assert both >= FLIGHTS / 4


def named(**keys):
    """{surface: (type, time, estimate in deg or as it is)} of a flight in which pairs are looked for."""
    flight = fly(scenario(duration_s=28, fdi={"fault_class": "all", "pairs": True}, **keys))
    found = metrics(flight)["isolation"]["faults"]
    return {
        one["fault"]: (
            one["type"],
            one["time_s"],
            one["estimate"] if one["estimate_deg"] is None else one["estimate_deg"],
        )
        for one in found
    }


def fault(actuator, kind, at_s, **more):
    return {"actuator": actuator, "type": kind, "at_s": at_s, **more}


AILERON_JAM = fault("aileron", "stuck", 8, position_deg=3)
RUDDER_BIAS = fault("rudder", "bias", 8, bias_deg=3)


@pytest.mark.parametrize("later_s", [0, 6])
def test_ailerons_and_rudder_at_once_and_one_after_the_other(later_s):
    """Two unknowns in two equations: both are named with their types, and their constants are right."""
    found = named(faults=[AILERON_JAM, {**RUDDER_BIAS, "at_s": 8 + later_s}])
    assert found["aileron"] == ("stuck", 8.02, pytest.approx(3, abs=0.1))
    assert found["rudder"] == ("bias", 8.02 + later_s, pytest.approx(3, abs=0.1))


def test_two_faults_of_pitch_at_once_stay_open():
    jam = fault("elevator", "stuck", 8, position_deg=0)
    flap = fault("flap", "stuck", 8, position_deg=5)
    flight = fly(scenario(duration_s=28, faults=[jam, flap], fdi={"fault_class": "all", "pairs": True}))
    assert flight.isolated is None
    assert "elevator+flap" in flight.candidates
