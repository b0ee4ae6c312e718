"""The flight in the sample logs: rates as least squares find them, attitude by rotation matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beaver_ftc_logs import sample_logs

DT = 0.05


class Steady:
    """Noise is 1 at all times; what is demanded changes its sign each time, and is beyond what a command
    can do for the roll angle."""

    sign = -1.0

    def standard_normal(self, size):
        return np.ones(size)

    def uniform(self, low, high, size):
        assert (low, high) == (-1.0, 1.0)
        self.sign = -self.sign
        return self.sign * np.array([2.6, -0.9][:size])


def test_rates_follow_the_elevons_and_the_attitude_the_rates():
    rows = np.array([*sample_logs._simulate_rows(20.0, Steady(), lambda t_s: 0.4 if t_s > 7.0 else 1.0)])
    t_s, rates = rows[:, 0] / 1000.0, np.deg2rad(rows[:, 1:4]) - 0.004
    command, attitude = rows[:, 4:6], rows[:, 6:]
    assert t_s == pytest.approx(DT * np.arange(400))
    demanded = np.where(t_s // 4.0 % 2 == 0, 1.0, -1.0)[:, None] * [2.6 * 0.5, -0.9 * 0.15]
    assert command == pytest.approx(np.clip(1.2 * (demanded - attitude) - 0.15 * rates[:, :2], -1.0, 1.0))
    assert [abs(one).max() == 1.0 for one in command.T] == [True, False]
    elevons = (
        command @ [[0.5, 0.5], [0.5, -0.5]] * np.column_stack([0.0 * t_s + 1.0, np.where(t_s > 7.0, 0.4, 1)])
    )
    turbulence = np.outer(1.0 - (1.0 - 2.0 * DT) ** np.arange(1, 401), [1.2, 0.8, 0.4]) / (2.0 * np.sqrt(DT))
    acceleration = np.diff(rates, axis=0) / DT - turbulence[:-1]
    found, *_ = np.linalg.lstsq(np.hstack([rates, elevons])[:-1], acceleration, rcond=None)
    damping = [[-6.0, 0.0, 0.8], [0.0, -4.0, 0.0], [-0.4, 0.0, -1.5]]
    assert found == pytest.approx(
        np.vstack([np.transpose(damping), [[22, 9, -1.2], [22, -9, -1.2]]]), abs=1e-8
    )
    turned = Rotation.from_euler("ZYX", np.column_stack([0.0 * t_s, attitude[:, ::-1]])[:-1])
    turned *= Rotation.from_rotvec(1e-6 * rates[1:])
    step = (turned.as_euler("ZYX")[:, :0:-1] - attitude[:-1]) / 1e-6
    assert np.diff(attitude, axis=0) / DT == pytest.approx(step, abs=1e-5)


def test_two_flights_in_a_table_and_the_left_elevon_of_the_second_is_weak_from_90_s(monkeypatch):
    text = sample_logs._table_text(0.1, 1, lambda t_s: 1.0)
    header, *rows, end = text.split("\n")
    assert header == "time_ms,gyro_x,gyro_y,gyro_z,roll_cmd,pitch_cmd,roll_rad,pitch_rad"
    assert ([row.split(",")[0] for row in rows], end) == (["0", "50"], "")
    assert all(len(cell.lstrip("-0.").replace(".", "")) <= 7 for row in rows for cell in row.split(","))
    monkeypatch.setattr(
        sample_logs,
        "_table_text",
        lambda duration_s, seed, left_effectiveness: (duration_s, *map(left_effectiveness, (89.9, 90.0))),
    )
    found = sample_logs.files()
    assert found["healthy.csv"] == (600.0, 1.0, 1.0)
    assert found["suspect.csv"] == (180.0, 1.0, 0.4)
