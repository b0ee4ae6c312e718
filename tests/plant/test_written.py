"""What is written into the aircraft, property by property: its start, a scenario's truth, the air, gusts."""

from math import pi

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant.adapter import Plant, body_axes
from beaver_ftc.plant.true_aircraft import configure
from beaver_ftc.scenario.schema import load
from trainer import trainer


def written(plant):
    return dict(sorted(plant.written.items()))


def test_body_axes_turn_by_yaw_then_pitch_then_roll():
    axes = body_axes(0.4, -0.1, 1.1)
    assert axes @ axes.T == pytest.approx(np.eye(3))
    nose, right, down = axes
    assert nose == pytest.approx([np.cos(0.1) * np.cos(1.1), np.cos(0.1) * np.sin(1.1), np.sin(0.1)])
    assert down[2] == pytest.approx(np.cos(0.4) * np.cos(0.1))
    assert right[2] == pytest.approx(np.sin(0.4) * np.cos(0.1))
    assert body_axes(0.0, 0.0, pi / 2) @ [1.0, 2.0, 3.0] == pytest.approx([2.0, -1.0, 3.0])


@pytest.mark.parametrize(
    ("uncertainty", "says"),
    [
        ({"inertia_coupling": {"q": 0.1}}, "uncertainty.inertia_coupling.q: trainer has no property"),
        ({"coefficients": {"Cm_q": 1.1}}, "uncertainty/Cm_q-scale, allowed: 1"),
        ({"sinusoid": {"r": {"amplitude_rad_s2": 0.1}}}, "uncertainty.sinusoid.r: .*amplitude-rad_sec2, all"),
    ],
)  # fmt: skip
def test_an_error_of_the_truth_that_an_aircraft_cannot_have_is_refused(uncertainty, says):
    class Without(Plant):
        def has(self, name):
            return not name.startswith("uncertainty/") and super().has(name)

    plant = Without(rate_hz=50, aircraft=trainer(start={"altitude_m": 500}))
    neutral = {"coefficients": dict.fromkeys(uncertainty.get("coefficients", ()), 1.0)}
    for given, refused in ((neutral, False), (uncertainty, True)):
        scenario = load({"aircraft": "beaver", "uncertainty": given})
        if refused:
            with pytest.raises(BadInput, match=says):
                configure(plant, scenario)
        else:
            configure(plant, scenario)
