"""What a detector is told of instruments and air is what the truth does."""

import numpy as np
import pytest

from beaver_ftc.design import Dryden
from beaver_ftc.loop.loop import Loop
from beaver_ftc.studies.compare.replay import Recorder, record
from flying import scenario


def told(**keys):
    loop = Loop(scenario(duration_s=1, **keys), Recorder())
    return loop.plugin_frame.detector.context.declared


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
