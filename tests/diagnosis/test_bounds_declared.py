"""What a detector is told of instruments and air is what the truth does."""

import numpy as np
import pytest

from beaver_ftc.studies.compare.replay import record
from flying import scenario


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
