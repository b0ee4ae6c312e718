"""Trim: on the truth's own accelerations, to 1e-9, or a clear refusal."""

from math import radians

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim

TOLERANCE = 1e-9  # m/s2 and rad/s2
SIX = [f"accelerations/{axis}dot-ft_sec2" for axis in "uvw"] + [
    f"accelerations/{axis}dot-rad_sec2" for axis in "pqr"
]


def accelerations(point, plant=None):
    """JSBSim's own, in SI, of an aircraft freshly started at the point."""
    plant = plant or Plant(rate_hz=100)
    plant.start(point)
    return [plant.read(name) * (0.3048 if "ft" in name else 1.0) for name in SIX]


@pytest.mark.parametrize("airspeed_mps", [30, 37.5, 45, 55, 70])
@pytest.mark.parametrize("altitude_m", [-300, 1828.8])
@pytest.mark.parametrize("flap_rad", [-0.1, 0.0, 0.35])
def test_all_six_accelerations_vanish(airspeed_mps, altitude_m, flap_rad):
    point = trim(airspeed_mps, altitude_m, flap_rad=flap_rad)
    assert accelerations(point) == pytest.approx([0] * 6, abs=TOLERANCE)
    assert point.residual == pytest.approx([0] * 6, abs=TOLERANCE)
    assert (point.airspeed_mps, point.altitude_m, point.flap_rad, point.phi_rad) == (
        airspeed_mps,
        altitude_m,
        flap_rad,
        0,
    )


def test_longitudinal_trim_is_the_published_one():
    """FDC's tutorial point at 35 m/s and sea level, 1800 rpm, 20 inHg: the first row of the doublet data."""
    point = trim(35.0, 0.0)
    assert point.alpha_rad == pytest.approx(0.21131, abs=2e-4)
    assert point.theta_rad == pytest.approx(0.1919, abs=2e-4)
    assert point.elevator_rad == pytest.approx(-0.093083, abs=2e-4)
    assert point.rudder_rad == pytest.approx(-0.049506, abs=5e-4)


def test_a_trimmed_aircraft_stays(beaver, trim_point):
    for _ in range(500):
        beaver.run()
    for axis in "pqr":
        assert abs(beaver.read(f"velocities/{axis}-rad_sec")) < 1e-3
    assert beaver.read("velocities/vt-fps") * 0.3048 == pytest.approx(45, abs=0.05)
    climb = beaver.read("velocities/h-dot-fps") * 0.3048 / 45
    assert climb == pytest.approx(trim_point.gamma_rad, abs=1e-3)


def test_flight_path_angle_is_the_climb(trim_point, beaver):
    climb = beaver.read("velocities/h-dot-fps") * 0.3048 / 45
    assert climb == pytest.approx(trim_point.gamma_rad, abs=1e-6)
    assert (
        trim(45, 1828.8, engine_rpm=2200, manifold_pressure_inhg=28).gamma_rad > trim_point.gamma_rad + 0.01
    )


def test_the_truth_is_trimmed_with_its_own_coefficients(trim_point):
    plant = Plant(rate_hz=100)
    plant.write("uncertainty/Cm_alpha-scale", 1.2)
    point = trim(45, 1828.8, plant=plant)
    assert point.elevator_rad < trim_point.elevator_rad - 0.005
    assert accelerations(point, plant) == pytest.approx([0] * 6, abs=TOLERANCE)


def test_outside_the_envelope_is_said():
    assert trim(45, 1000).envelope_valid
    assert not trim(60, 1000).envelope_valid
    assert not trim(30, 1500).envelope_valid, "too slow at that height: alpha beyond attached flow"


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"airspeed_mps": 20, "altitude_m": 6000}, "no steady straight flight at 20 m/s, 6000 m .*allowed"),
        (
            {"airspeed_mps": 25, "altitude_m": 0, "flap_rad": -0.1},
            r"needs elevator -30.\d deg, allowed: -28.1 to 28.1",
        ),
        ({"airspeed_mps": 35, "altitude_m": 6000}, r"needs rudder -26.\d deg, allowed: -25.2 to 25.2 deg"),
        ({"engine_rpm": 2600}, "engine speed is 2600 rpm, allowed: 600 to 2300 rpm"),
        ({"manifold_pressure_inhg": 40}, "manifold pressure is 40 inHg, allowed: 10 to 36.5 inHg"),
        ({"engine_rpm": 700, "manifold_pressure_inhg": 11}, "engine power is -.* kW, allowed: -40 to 400 kW"),
        ({"flap_rad": radians(70)}, r"flap is 1.22\d* rad, allowed: -0.1 to 1.03 rad"),
        ({"airspeed_mps": float("nan")}, "allowed: a positive airspeed and a finite altitude"),
        ({"airspeed_mps": -3}, "allowed: a positive airspeed and a finite altitude"),
        ({"altitude_m": float("inf")}, "allowed: a positive airspeed and a finite altitude"),
        ({"engine_rpm": float("nan")}, "engine speed is nan rpm, allowed"),
    ],
)
def test_what_cannot_be_trimmed_is_refused(asked, says):
    with pytest.raises(BadInput, match=says) as caught:
        trim(**({"airspeed_mps": 45.0, "altitude_m": 1828.8} | asked))
    assert "\n" not in str(caught.value)
