from dataclasses import replace

import pytest

from beaver_ftc.plant.adapter import Plant


@pytest.fixture
def banked(trim_point):
    """The same in a state where nothing is zero: angles, rates, surfaces, rate of sideslip."""
    plant = Plant(rate_hz=100)
    plant.start(
        replace(
            trim_point,
            beta_rad=0.05,
            p_rad_s=0.3,
            q_rad_s=-0.2,
            r_rad_s=0.15,
            phi_rad=0.4,
            psi_rad=1.1,
            aileron_rad=0.06,
            elevator_rad=-0.08,
            rudder_rad=0.07,
            flap_rad=0.2,
        )
    )
    return plant
