"""What a detector is told of instruments and air is what the truth does."""

import numpy as np
import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.design import Dryden
from beaver_ftc.design.context import Declared
from beaver_ftc.loop.loop import Loop
from beaver_ftc.studies.compare.replay import Recorder, record
from flying import scenario


def told(**keys):
    loop = Loop(scenario(duration_s=1, **keys), Recorder())
    return loop.plugin_frame.detector.context.declared


def test_nothing_declared_is_nothing_told():
    declared = told(sensors="tactical-grade", environment={"turbulence": "dryden", "severity": "light"})
    assert not declared.errors
    assert not declared.air
    assert not declared.turbulence_rad_s2.any()
    for name, zeros in vars(Declared()).items():
        if name == "coefficients":
            assert not getattr(declared, name).any()
        elif name not in ("gust_time_s", "gust_effect"):
            assert np.array_equal(getattr(declared, name), zeros), name


def test_instruments_are_told_as_the_preset_has_them():
    declared = told(fdi={"bounds": {"sensors": "consumer-grade"}})
    assert declared.errors
    assert declared.noise == pytest.approx([np.radians(0.1)] * 3 + [np.radians(0.043)] * 2 + [0.1, 3.0])
    assert declared.bias == pytest.approx([np.radians(0.5)] * 5 + [0.4, 17.0])
    assert declared.slope[:3] == pytest.approx([0.03] * 3)
    assert declared.gyro_rad_s == pytest.approx(np.radians(np.hypot(0.1, 0.0153 / np.sqrt(12))) * np.ones(3))


def test_the_actuators_are_told():
    declared = told(actuators="servo")
    assert declared.bandwidth_rad_s == pytest.approx([20.0] * 4)
    assert declared.rate_limit_rad_s == pytest.approx(np.radians([60.0] * 4))
    assert not declared.errors


def test_one_coefficient_off_gives_its_own_share_of_the_acceleration():
    """Cm_alpha off by a tenth: a tenth of its moment, over the inertia."""
    declared = told(fdi={"bounds": {"coefficients": {"Cm_alpha": 0.1}}})
    loop = Loop(scenario(duration_s=1), Recorder())
    alpha, _, _, qdyn = loop.plugin_frame.detector.context.trim_y[:4]
    expected = 0.1 * abs(load().terms["Cm_alpha"].value) * alpha * qdyn * 23.23 * 1.5875 / 6928.93
    assert declared.model_rad_s2 == pytest.approx([0.0, expected, 0.0], abs=1e-9)
    wanted = [0.1 * abs(term.value) * (term.name == "Cm_alpha") for term in load().moments]
    assert declared.coefficients == pytest.approx(wanted)


@pytest.mark.parametrize("severity", ["light", "moderate"])
def test_the_turbulence_told_is_the_one_flown(severity):
    """What the model does not explain of a flight in JSBSim's turbulence has the size and the memory told."""
    innovations = []
    for seed in range(6):
        recording = record(
            scenario(
                duration_s=30,
                seed=seed,
                uncertainty={},
                environment={"turbulence": "dryden", "severity": severity},
                fdi={"bounds": {"turbulence": severity}},
            )
        )
        x = np.array([measured.x for measured, _ in recording.seen])
        believed = np.array([measured.acceleration for measured, _ in recording.seen])
        innovations.append((np.diff(x, axis=0) / 0.01 - believed[1:])[200:])
    declared = recording.context.declared
    size = np.sqrt(np.mean([np.mean(nu**2, axis=0) for nu in innovations], axis=0))
    assert size == pytest.approx(declared.turbulence_rad_s2, rel=0.2)
    lag = 25
    kept = np.mean([np.mean(nu[lag:] * nu[:-lag], axis=0) for nu in innovations], axis=0) / size**2
    assert kept == pytest.approx(np.exp(-lag * 0.01 / declared.turbulence_time_s), abs=0.15)


def test_the_air_rolls_more_than_it_pitches_or_yaws_and_faster_flight_meets_it_sooner():
    slow, fast = Dryden("light").rotation(40.0, 14.63), Dryden("light").rotation(50.0, 14.63)
    assert slow[0][0] > slow[0][2] > slow[0][1] > 0
    assert slow[0] == pytest.approx(fast[0])
    assert slow[1] == pytest.approx(1.25 * fast[1])
    assert Dryden("moderate").rotation(40.0, 14.63)[0] == pytest.approx(10.6 / 7.4 * slow[0])
