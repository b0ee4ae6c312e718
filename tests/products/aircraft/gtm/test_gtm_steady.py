"""What steady flight is told and says, without the model: densities by altitude, velocity, commands."""

from math import degrees

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_aircraft.gtm.steady import Bench, Condition, Steady, pitch_angle
from telling import apart

FOUND = Steady(
    airspeed_fps=132.0, eas_kt=77.0, alpha_deg=3.5, beta_deg=-1.2, phi_deg=0.8, theta_deg=2.7,
    elevator_deg=1.9, aileron_deg=-0.6, rudder_deg=2.3, throttle_percent=41.0, left=1e-10,
)  # fmt: skip


def test_the_velocity_has_the_angles_that_were_found():
    u, v, w = FOUND.velocity_fps
    assert np.linalg.norm((u, v, w)) == pytest.approx(132.0)
    assert degrees(np.arctan2(w, u)) == pytest.approx(3.5)
    assert degrees(np.arcsin(v / 132.0)) == pytest.approx(-1.2)


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
