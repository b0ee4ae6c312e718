"""What a stop hides excludes nothing: every type of fault on a surface whose command is at its stop."""

from functools import cache
from math import degrees

import pytest

import beaver_ftc as bf
from given import given

GIVEN = given(__file__)

SURFACES = {"aileron": "p", "elevator": "q", "rudder": "r", "flap": None}
FAULTS = GIVEN["faults"]  # fmt: skip
# Beyond what the surface can do: for good, or now and then.
ORDERS = {
    "one stop": [{"step": {"amplitude_deg_s": 25, "start_s": 0.5}}],
    "other stop": [{"step": {"amplitude_deg_s": -25, "start_s": 0.5}}],
    "both stops": [{"square": {"amplitude_deg_s": 25, "frequency_hz": 0.15}}],
}


@cache
def trim_deg(surface):
    return degrees(bf.trim("fault-free").surfaces_rad[surface])


def flown(surface, commands, fault, rate_hz=50, substeps=1, sensors="ideal", bounds=None, room_deg=(-1, 2),
          actuators=None):  # fmt: skip
    axis, at = SURFACES[surface], trim_deg(surface)
    stops = [at + room_deg[0], at + room_deg[1]]
    if axis is None:  # nobody commands it: it stays where it is, at this stop or that
        stops = [0.0, 4.0] if commands == "one stop" else [-4.0, 0.0]
    return bf.fly({
        "name": "at-a-stop", "duration_s": 11.0, "rate_hz": rate_hz, "substeps": substeps, "sensors": sensors,
        "reference": {axis: ORDERS[commands]} if axis else {},
        "actuators": {**(actuators or {}), surface: {"travel_deg": stops, **(actuators or {})}},
        "fdi": {"fault_class": "all", "bounds": bounds or {}, "slowest_rate_deg_s": 0.5},
        "faults": [{"actuator": surface, "at_s": 2.0, **FAULTS[fault]}],
    }, log=False)  # fmt: skip


def is_possible(flight, surface, kind):
    """Whether the diagnosis has named surface and type, or left them open; or seen nothing."""
    said = flight.isolation
    if not flight.detection.detected:
        return True
    if said.fault is not None:
        return said.fault == surface and kind in (said.type, *said.candidates)
    return surface in said.candidates or f"{surface}:{kind}" in said.candidates


@pytest.mark.parametrize("commands", ORDERS)
@pytest.mark.parametrize("fault", FAULTS)
def test_the_true_surface_and_type_stay_possible(fault, commands):
    flights = {surface: flown(surface, commands, fault) for surface in SURFACES}
    assert any(flight.metrics["saturation_s"][surface] > 1.0 for surface, flight in flights.items())
    for surface, flight in flights.items():
        assert not flight.false_alarm
        assert is_possible(flight, surface, FAULTS[fault]["type"]), (surface, flight.isolation)


def test_a_swing_of_which_a_stop_hides_half_is_never_named_a_loss():
    scenario = {
        "name": "half-a-swing", "duration_s": 24, "actuators": {"aileron": {"travel_deg": [-3, 3]}},
        "reference": {"p": [{"step": {"amplitude_deg_s": 20, "start_s": 1}}]}, "fdi": {"fault_class": "all"},
        "faults": [{"type": "oscillatory", "actuator": "aileron", "amplitude_deg": 2, "frequency_rad_s": 6,
                    "at_s": 8}],
    }  # fmt: skip
    said = bf.fly(scenario, log=False).isolation
    assert (said.fault, said.type) == ("aileron", None)
    assert set(said.candidates) == {"loss_of_effectiveness", "oscillatory"}
