"""What the autopilot takes from the aircraft's file: each number as the balance it stands for."""

from math import inf, radians

import numpy as np
import pytest
from scipy.optimize import root

from beaver_ftc.aircraft import load
from beaver_ftc.control import autopilot_setup
from beaver_ftc.control.autopilot_setup import AUTOPILOT
from beaver_ftc.control.envelope_protection import N_FLAP, N_QDYN
from beaver_ftc.control.level_flight import elevator_needed
from beaver_ftc.control.state import control_dtype
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario

AIRCRAFT = load()
LEGS = {
    "altitude_m": [{"hold": True}, {"at_s": 20, "value": 1900, "climb_mps": 2.5}],
    "airspeed_mps": [{"at_s": 5, "value": 42, "change_mps2": 0.4}],
    "heading_deg": [{"value": 90}],
}
DESIGN = {"mass": 1.1, "coefficients": {"Cm_alpha": 1.2}}


@pytest.fixture(scope="module")
def filled():
    """(autopilot, control) as filled for a scenario."""
    given = {"name": "profile", "duration_s": 60, "autopilot": LEGS, "design_model": DESIGN}
    pilot, control = np.zeros(1, AUTOPILOT)[0], np.zeros(1, control_dtype(4))[0]
    control["layout"]["main"], control["layout"]["stand_in"] = (0, 1, 2), 3
    control["layout"]["low"], control["layout"]["high"] = (-0.5, -0.4, -0.3, -0.1), (0.5, 0.4, 0.3, 1.0)
    control["power"]["config"]["trim"], control["power"]["config"]["low"] = 20.0, 12.0
    control["power"]["config"]["high"], control["power"]["config"]["step"] = 28.0, 0.5
    autopilot_setup.set_up_autopilot(pilot, control, Declared.of(Scenario.model_validate(given)))
    return pilot, control


def level(qdyn_pa, flap_rad):
    """Elevator of level flight, rad, by the identified polynomials [TM88]; Cm_alpha times 1.2."""
    load = 1.1 * 2288.231 * 9.80665 / (qdyn_pa * 23.23)

    def imbalance(unknown):
        a, dpt, de = unknown
        CX = -0.03554 + 0.00292 * a + 5.459 * a**2 - 5.162 * a**3 + (1.106 * a - 0.09447) * flap_rad
        CX += 0.1161 * dpt + 0.1453 * a * dpt**2
        CZ = -0.05504 - 5.578 * a + 3.442 * a**3 - 0.398 * de - (1.377 + 1.261 * a) * flap_rad - 0.1563 * dpt
        Cm = 0.09448 - 0.6028 * 1.2 * a - 2.14 * a**2 - 0.07895 * dpt - 1.921 * de + 0.4072 * flap_rad
        return CX - load * np.sin(a), CZ + load * np.cos(a), Cm

    found = root(imbalance, (0.1 - 0.25 * flap_rad, 0.5, 0.2 * flap_rad), tol=1e-12)
    return found.x[2] if found.success and abs(found.x[1]) < 3.0 else np.nan  # beyond: too much thrust


def test_the_table_is_that_of_level_flight_between_the_ends_of_speed_and_flap(filled):
    hold, (slowest, fastest) = filled[0]["holding"], AIRCRAFT.envelope.airspeed_mps
    assert hold["qdyn"] == pytest.approx(0.5 * 1.225 * np.linspace(slowest, fastest, N_QDYN) ** 2, rel=1e-3)
    assert hold["flap"] == pytest.approx(np.linspace(-0.1, 1.0, N_FLAP))
    expected = [[level(q, flap) for flap in hold["flap"]] for q in hold["qdyn"]]
    assert hold["elevator"] == pytest.approx(np.array(expected), abs=1e-7)
    assert hold["has_table"] == 1
    assert (hold["max_airspeed_rate_mps2"], hold["flap_reserve"]) == pytest.approx((1.0, radians(0.7)))
    assert (hold["from_s"] == -1.0).all()
    assert (hold["bank"], hold["fastest"]) == (pytest.approx(radians(30.0)), inf)


@pytest.mark.parametrize(
    ("qdyn_pa", "flap_rad", "held"),
    [
        (1800.0, 1.0, True),
        (4000.0, 0.6, True),
        (4000.0, 1.0, False),
        (280.0, 0.6, True),
        (280.0, -0.1, False),
    ],
)
def test_what_takes_more_thrust_or_incidence_than_there_is_cannot_be_held(qdyn_pa, flap_rad, held):
    """Too much flap for the speed, or too slow for what flap there is; each beside one that is held."""
    wanted = (("Cm_alpha", 1.2),), (qdyn_pa, 900.0), (0.3, flap_rad)
    needed = elevator_needed(AIRCRAFT, ("elevator", "flap"), 1.1 * AIRCRAFT.mass.mass_kg, *wanted)
    expected = level(qdyn_pa, flap_rad) if held else np.nan
    assert needed[0, 1] == pytest.approx(expected, abs=1e-7, nan_ok=True)
    assert needed[1, 0] == pytest.approx(level(900.0, 0.3), abs=1e-7)
