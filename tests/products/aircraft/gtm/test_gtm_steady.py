"""What steady flight is told and says, without the model: densities by altitude, velocity, commands."""

from math import asin, atan2, degrees, radians, sin, sqrt

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_aircraft.gtm.parameters import cases
from beaver_ftc_aircraft.gtm.steady import Bench, Condition, Steady, pitch_angle
from beaver_ftc_aircraft.gtm.systems import THROTTLE
from telling import apart

FOUND = Steady(
    airspeed_fps=132.0, eas_kt=77.0, alpha_deg=3.5, beta_deg=-1.2, phi_deg=0.8, theta_deg=2.7,
    elevator_deg=1.9, aileron_deg=-0.6, rudder_deg=2.3, throttle_percent=41.0, left=1e-10,
)  # fmt: skip


def test_each_altitude_has_its_density_and_is_asked_once():
    bench, asked = object.__new__(Bench), []
    bench.fdm = {}

    def place(altitude_ft, velocity_fps, angles_rad):
        asked.append(altitude_ft)
        bench.fdm["atmosphere/rho-slugs_ft3"] = 0.0024 * np.exp(-altitude_ft / 30000.0)

    bench.place = place
    flown = [800.0, 12000.0, 800.0, 0.0, 12000.0]
    found = [bench.density(altitude_ft) for altitude_ft in flown]
    assert found == pytest.approx([0.0024 * np.exp(-altitude_ft / 30000.0) for altitude_ft in flown])
    assert asked == [800.0, 12000.0, 0.0]


def test_the_velocity_has_the_angles_that_were_found():
    u, v, w = FOUND.velocity_fps
    assert np.linalg.norm((u, v, w)) == pytest.approx(132.0)
    assert degrees(np.arctan2(w, u)) == pytest.approx(3.5)
    assert degrees(np.arcsin(v / 132.0)) == pytest.approx(-1.2)


def test_each_surface_is_commanded_by_its_kind_and_side():
    apart(found=[FOUND.elevator_deg, FOUND.aileron_deg, FOUND.rudder_deg, FOUND.throttle_percent])
    commands = FOUND.commands()
    assert commands.pop(THROTTLE) == pytest.approx(0.41)
    for name, value in commands.items():
        of = {"elevator": 1.9, "rudder": 2.3, "aileron": 0.6 if "left" in name else -0.6}
        kind = next(kind for kind in of if kind in name)
        assert value == pytest.approx(radians(of[kind])), name
    assert {kind for kind in ("elevator", "aileron", "rudder") if any(kind in name for name in commands)} == {
        "elevator", "aileron", "rudder",
    }  # fmt: skip


@pytest.mark.parametrize(
    "angles", [(0.11, -0.07, 0.23, 0.05), (-0.04, 0.13, -0.6, -0.09), (0.3, 0.2, 0.9, 0.17)]
)
def test_the_pitch_angle_gives_the_path_angle(angles):
    """By turning the velocity from body axes to the Earth's: it climbs at gamma."""
    alpha, beta, phi, gamma = angles
    apart(angles=angles)
    body = [np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)]
    theta = pitch_angle(alpha, beta, phi, gamma)
    down = Rotation.from_euler("ZYX", [0.4, theta, phi]).apply(body)[2]
    assert np.arcsin(-down) == pytest.approx(gamma)


@pytest.mark.parametrize(("left", "is_steady"), [(0.9e-6, True), (1.1e-6, False)])
def test_flight_is_steady_where_a_millionth_is_left_of_its_accelerations(left, is_steady, monkeypatch):
    monkeypatch.setattr(Bench, "damage", lambda self, case: None)
    monkeypatch.setattr(Bench, "_off", lambda self, wanted, x: np.full(6, left))
    monkeypatch.setattr(Bench, "_found", lambda self, wanted, x, left: left)
    still = object.__new__(Bench)
    if is_steady:
        assert still.steady(Condition(alpha_deg=3.0)) == left
    else:
        with pytest.raises(BadInput, match="no steady flight with"):
            still.steady(Condition(alpha_deg=3.0))


class Alike(Bench):
    """An aircraft made up: six accelerations that are zero at one flight alone, read from what is commanded
    and where it is put. Rudders that are gone leave the sideslip to be found."""

    ELEVATOR, AILERON, SIDE, BANK, THROTTLE = 0.07, -0.03, 0.021, 0.04, 0.62
    ALPHA, SPEED_FPS, DENSITY = 0.11, 171.0, 0.0021

    def __init__(self):
        self.fdm = {"atmosphere/rho-slugs_ft3": self.DENSITY}
        self.put = []

    def place(self, altitude_ft, velocity_fps, angles_rad, rates=(0.0, 0.0, 0.0)):
        self.put.append((altitude_ft, velocity_fps, angles_rad))

    def accelerations(self):
        (u, v, w), (phi, _, _), of = *self.put[-1][1:], self.fdm
        V = sqrt(u * u + v * v + w * w)
        gone = any(of[f"failures/damage/{name}"] for name in ("rudder-off", "fin-off"))
        assert v == 0.0 or gone
        assert of["fcs/upper_rudder-cmd-rad"] == of["fcs/lower_rudder-cmd-rad"]
        side = asin(v / V) if gone else of["fcs/upper_rudder-cmd-rad"]
        lift, alpha = V * V * (0.1 + atan2(w, u)), self.ALPHA
        off = np.array([
            lift / (self.SPEED_FPS**2 * (0.1 + alpha)) - 1.0,
            phi - self.BANK,
            of["fcs/left_inboard_elevator-cmd-rad"] - self.ELEVATOR,
            of["fcs/right_aileron-cmd-rad"] - self.AILERON,
            side - self.SIDE,
            of["fcs/throttle-cmd-norm"] - self.THROTTLE,
        ])  # fmt: skip
        coupled = np.eye(6) + 0.1 * np.arange(36.0).reshape(6, 6) / 36.0
        return coupled @ (off + 0.3 * off**2)


@pytest.mark.parametrize("case", range(4))
@pytest.mark.parametrize("by_speed", [False, True])
def test_steady_flight_is_found_by_speed_or_angle_of_attack_and_by_sideslip_without_rudders(by_speed, case):
    """Equivalent airspeed: that which has the same pressure at 0.0023769 slug/ft3, at 0.592487 kt a ft/s."""
    thin = sqrt(0.0021 / 0.0023769)
    eas_kt = 171.0 * 0.592487 * thin
    wanted = {"eas_kt": eas_kt} if by_speed else {"alpha_deg": degrees(0.11)}
    condition = Condition(**wanted, gamma_deg=-4.0, altitude_ft=4300.0, case=case)
    bench = Alike()
    found = bench.steady(condition)
    beta, rudder = (0.021, 0.0) if case in (1, 2) else (0.0, 0.021)
    theta = found.theta_deg
    u, v, w = found.velocity_fps
    climb = Rotation.from_euler("ZYX", [90.0, theta, found.phi_deg], degrees=True).apply([u, v, w])[2]
    assert -climb == pytest.approx(171.0 * sin(radians(-4.0)))
    assert vars(found) == pytest.approx(
        {
            "airspeed_fps": 171.0, "eas_kt": eas_kt, "alpha_deg": degrees(0.11), "beta_deg": degrees(beta),
            "phi_deg": degrees(0.04), "theta_deg": theta, "elevator_deg": degrees(0.07),
            "aileron_deg": degrees(-0.03), "rudder_deg": degrees(rudder), "throttle_percent": 62.0,
            "left": found.left,
        },
        abs=1e-6,
    )  # fmt: skip
    assert found.left < 1e-9
    assert [bench.fdm[f"failures/damage/{name}"] for name in cases()] == [n == case for n in range(1, 7)]
    altitude_ft, velocity, angles = bench.put[-1]
    assert altitude_ft == 4300.0
    assert velocity == pytest.approx(found.velocity_fps)
    assert np.degrees(angles) == pytest.approx([found.phi_deg, theta, 90.0])
    looked = len(bench.put)
    assert vars(bench.steady(condition, found)) == pytest.approx(vars(found))
    assert len(bench.put) == looked + 2  # from where it was found there is nothing to search
