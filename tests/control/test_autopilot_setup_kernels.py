"""What the autopilot takes from the aircraft's file: each number as the balance it stands for."""

from math import inf, radians
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import root

from beaver_ftc.aircraft import load
from beaver_ftc.control import autopilot as profile
from beaver_ftc.control.autopilot import AUTOPILOT, GAIN, N_FLAP, N_QDYN
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


def set_up(stand_in=3, autopilot=LEGS, **keys):
    """(autopilot, control) as filled for a scenario."""
    given = {"name": "profile", "duration_s": 60, "autopilot": autopilot, "design_model": DESIGN, **keys}
    pilot, control = np.zeros(1, AUTOPILOT)[0], np.zeros(1, control_dtype(4))[0]
    control["layout"]["main"], control["layout"]["stand_in"] = (0, 1, 2), stand_in
    control["layout"]["low"], control["layout"]["high"] = (-0.5, -0.4, -0.3, -0.1), (0.5, 0.4, 0.3, 1.0)
    control["power"]["config"]["trim"], control["power"]["config"]["low"] = 20.0, 12.0
    control["power"]["config"]["high"], control["power"]["config"]["step"] = 28.0, 0.5
    profile.set_up_autopilot(pilot, control, Declared.of(Scenario.model_validate(given)))
    return pilot, control


@pytest.fixture(scope="module")
def filled():
    return set_up()


def coefficient(name, **of):
    """A coefficient of the aircraft's file where only these signals are not zero."""
    neutral = {factor: 0.0 for term in AIRCRAFT.terms.values() for factor in term.factors}
    return AIRCRAFT.coefficient(name, neutral | of)


@pytest.mark.parametrize(
    ("loop", "rate", "damping"),
    [("altitude", 0.8, 2.0), ("speed", 0.3, 1.224745), ("bank", 1.0, 1.118034), ("heading", 0.25, 1.976424)],
)
def test_a_loop_that_integrates_what_is_missing_does_not_overshoot_by_it(filled, loop, rate, damping):
    """s^2 + k s + k_i: k in 1/s, and a damping of k / (2 sqrt k_i) above 1."""
    gain = filled[0]["gain"]
    assert gain[loop] == rate
    assert gain[loop] / (2.0 * np.sqrt(gain[f"{loop}_i"])) == pytest.approx(damping, rel=1e-6)


@pytest.mark.parametrize(("by", "slower"), [("power", 1.5), ("pitch", 1.0)])
def test_an_engine_that_lags_slows_its_loop_down_and_nothing_else(filled, by, slower):
    """3 s of the loop and 1.5 of the engine in a row: k by 1.5, k_i by its square, so that it damps alike."""
    engine = SimpleNamespace(thrust=SimpleNamespace(lag_s=1.5))
    lagging = profile._gains(SimpleNamespace(engine=engine, airspeed_by=by))
    usual = {name: float(filled[0]["gain"][name]) for name in GAIN.names}
    assert lagging["speed"] == pytest.approx(usual["speed"] / slower)
    damping = [gain["speed"] / np.sqrt(gain["speed_i"]) for gain in (lagging, usual)]
    assert damping[0] == pytest.approx(damping[1])
    assert {name for name in usual if lagging[name] != usual[name]} <= {"speed", "speed_i"}
    assert lagging["airspeed_s"] == 3.0


def test_each_loop_is_a_few_times_slower_than_the_one_inside_it(filled):
    """Attitude 3 1/s; altitude and speed beside it; heading a quarter of bank. Time constants in s."""
    gain = {name: float(filled[0]["gain"][name]) for name in GAIN.names}
    assert gain["attitude"] == 3.0
    assert gain["heading"] == gain["bank"] / 4.0
    assert {name: gain[name] for name in gain if name.endswith("_s")} == {
        "alpha_s": 2.0, "airspeed_s": 3.0, "jammed_s": 1.0, "authority_s": 1.0, "bank_s": 6.0,
    }  # fmt: skip
    left = {"sideslip": 0.5, "spare_mps": 2.0, "path_per_mps": 0.02, "loose": 0.4, "protection": 2.0}
    assert {name: gain[name] for name in left} == left
    assert min(gain.values()) > 0.0  # none is forgotten


def test_thrust_is_what_the_slipstream_adds_along_the_body(filled):
    """Per dynamic pressure and dpt; the part on alpha for the square of dpt. At 1.1 times the mass."""
    per_mass = AIRCRAFT.geometry.wing_area_m2 / (1.1 * AIRCRAFT.mass.mass_kg)
    straight = coefficient("CX", dpt=1.0) - coefficient("CX")
    inclined = coefficient("CX", alpha=0.1, dpt=1.0) - coefficient("CX", alpha=0.1) - straight
    assert filled[0]["thrust"] == pytest.approx([per_mass * straight, per_mass * inclined / 0.1])


def test_the_dihedral_is_the_roll_that_sideslip_sustains(filled):
    beta, V = 0.05, 45.0
    p = -filled[0]["dihedral"] * V * beta
    ph = p * AIRCRAFT.geometry.span_m / (2.0 * V)
    assert coefficient("Cl", beta=beta) < 0.0
    assert coefficient("Cl", beta=beta, ph=ph) == pytest.approx(coefficient("Cl"), abs=1e-12)


def test_the_weathercock_holds_full_power_at_the_largest_sideslip_accepted(filled):
    dpt = filled[0]["dpt_cubed_held_by_sideslip"] ** (1.0 / 3.0)
    pulled = coefficient("Cn", dpt=dpt) - coefficient("Cn")
    assert abs(pulled) > 1e-4
    beta = -np.sign(pulled) * 0.2  # rad, a third of what is a departure
    assert coefficient("Cn", dpt=dpt, beta=beta) == pytest.approx(coefficient("Cn"), abs=1e-12)


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
    needed = profile.elevator_needed(AIRCRAFT, ("elevator", "flap"), 1.1 * AIRCRAFT.mass.mass_kg, *wanted)
    expected = level(qdyn_pa, flap_rad) if held else np.nan
    assert needed[0, 1] == pytest.approx(expected, abs=1e-7, nan_ok=True)
    assert needed[1, 0] == pytest.approx(level(900.0, 0.3), abs=1e-7)
