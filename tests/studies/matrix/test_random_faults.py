"""Random faults of every type on the truth: none is named wrongly, none is imagined."""

import numpy as np

from beaver_ftc.loop.loop import fly
from beaver_ftc.results.metrics import measure
from beaver_ftc.studies.matrix.fault_matrix import verdict
from flying import scenario
from samples import samples

FAULTS = samples(300)


def drawn(rng, at_s):
    """A fault of any type, abrupt or incipient, lasting or not."""
    kind, more = (
        ("loss_of_effectiveness", {"magnitude": rng.uniform(0.2, 1)}),
        ("stuck", {"position_deg": rng.uniform(-10, 10)} if rng.random() < 0.7 else {}),
        ("hardover", {"direction": int(rng.choice([-1, 1]))}),
        ("float", {}),
        ("bias", {"bias_deg": rng.uniform(-5, 5)}),
        ("rate_limit", {"scale": rng.uniform(0.005, 0.1)}),
        ("oscillatory", {"amplitude_deg": rng.uniform(0.3, 4), "frequency_rad_s": rng.uniform(1, 12)}),
    )[rng.integers(7)]
    if kind in ("loss_of_effectiveness", "bias", "oscillatory") and rng.random() < 0.3:
        more |= {"profile": "incipient", "kappa_per_s": rng.uniform(0.1, 5)}
    if rng.random() < 0.2:
        more["end_s"] = at_s + rng.uniform(1, 8)
    surface = ("aileron", "elevator", "rudder", "flap")[rng.integers(4)]
    return {"type": kind, "actuator": surface, "at_s": at_s, **more}


def conditions(rng):
    """Frames, flight condition and references of a random flight."""
    return {
        "rate_hz": int(rng.choice([50, 100])),
        "substeps": int(rng.choice([1, 1, 3])),
        "initial": {"airspeed_mps": rng.uniform(35, 52), "altitude_m": rng.uniform(0, 3000)},
        "reference": {
            axis: [{"sine": {"amplitude_deg_s": rng.uniform(0, 4), "frequency_hz": rng.uniform(0.1, 0.6)}}]
            for axis in "pqr"
        },
    }


def flight_of(rng, repaired=False, **more):
    at_s = 2 + rng.integers(0, 800) / 100
    fault = drawn(rng, at_s)
    if repaired:
        fault["end_s"] = at_s + rng.uniform(1, 8)
    return scenario(
        duration_s=at_s + 14,
        **conditions(rng),
        uncertainty={
            "inertia_coupling": dict(zip("pqr", rng.uniform(-0.25, 0.25, 3), strict=True)),
            "sinusoid": {
                axis: {"amplitude_rad_s2": rng.uniform(0, 0.02), "frequency_rad_s": rng.uniform(0.5, 30)}
                for axis in "pqr"
            },
        },
        faults=[fault],
        fdi={"fault_class": "all"},
        control={"law": "fault-tolerant" if rng.random() < 0.8 else "nominal"},
        **more,
    )


def flown(flights, **more):
    """(what was named wrongly, how many surfaces were named) in so many random flights."""
    rng = np.random.default_rng(77)
    wrong = []
    named = 0
    for _ in range(flights):
        flight = fly(flight_of(rng, **more))
        fault = flight.scenario.faults[0]
        said = verdict(measure(flight), fault.actuator, fault.type)
        named += said in ("named", "surface")
        if said == "WRONG":
            wrong.append((fault, flight.isolated, flight.isolation_type, flight.candidates))
    return wrong, named


def test_none_is_named_wrongly_and_none_is_imagined():
    wrong, named = flown(FAULTS)
    assert wrong == []
    assert named >= FAULTS / 2


def test_nor_by_servos_that_bring_repaired_surfaces_back():
    """The return belongs to no type: the verdict before the repair stands."""
    wrong, named = flown(FAULTS, repaired=True, actuators="servo")
    assert wrong == []
    assert named >= FAULTS / 2
