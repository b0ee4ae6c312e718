"""The table of thrust: its power undoes its acceleration, and between its points it is linear."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.aircraft.schema import ThrustSection
from beaver_ftc.control.power import POWER, move_differences
from beaver_ftc.control.thrust import (
    ENGINE,
    gained,
    look_up,
    power_for,
    set_up_engine,
)

MASS_KG = 500.0
SECTION = {"airspeed_mps": [20.0, 30.0, 60.0], "setting": [0.0, 0.25, 1.0], "lag_s": 0.8,
           "force_n": [[-100.0, 500.0, 2000.0], [-200.0, 400.0, 1500.0], [-500.0] * 2 + [600.0]]}  # fmt: skip


def engine_of(airspeed_mps=30.0):
    engine = np.zeros(1, ENGINE).view(np.recarray)[0]
    set_up_engine(engine, ThrustSection.model_validate(SECTION), MASS_KG)
    look_up(engine, airspeed_mps)
    return engine


@pytest.mark.parametrize(
    ("airspeed_mps", "power", "force_n"),
    [(30, 1.0, 1500), (30, 0.0, -200), (25, 0.25, 450), (45, 1.0, 1050), (30, 0.625, 950), (10, 1.0, 2000),
     (99, 0.0, -500)],
)  # fmt: skip
def test_an_acceleration_is_that_of_the_force_between_the_points_of_the_table(airspeed_mps, power, force_n):
    """Trim at 0: what it gives is the force less that at 0, over the mass, but for 1e-4 m/s2 a setting."""
    engine = engine_of(airspeed_mps=float(airspeed_mps))
    idle_n = np.interp(airspeed_mps, SECTION["airspeed_mps"], [row[0] for row in SECTION["force_n"]])
    expected = (force_n - idle_n) / MASS_KG
    assert gained(engine, 0.0, 0.0, power) == pytest.approx(expected, abs=3e-4)


@given(st.floats(15, 70), st.floats(0, 1), st.floats(0, 1))
def test_the_power_for_an_acceleration_gives_it(airspeed_mps, trim, power):
    """Also where the force does not rise with the setting: a small rise stands in."""
    engine = engine_of(airspeed_mps=airspeed_mps)
    assert power_for(engine, 0.0, trim, gained(engine, 0.0, trim, power)) == pytest.approx(power, abs=1e-6)


@pytest.mark.parametrize(("wanted", "power"), [(-50.0, 0.0), (50.0, 1.0)])
def test_what_no_power_gives_is_asked_of_the_end(wanted, power):
    assert power_for(engine_of(), 0.0, 0.5, wanted) == power


def test_each_engine_moves_towards_its_own_difference():
    power = np.zeros(1, POWER).view(np.recarray)[0]
    move_differences(power, (0.2, -0.3), 2, 0.25)
    assert power.output.command[:3].tolist() == [0.0, 0.2, -0.25]
