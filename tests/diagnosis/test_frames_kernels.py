"""A few dozen frames of the whole diagnosis on the design model as a plant, where sums and sets are exact."""

import numpy as np
import pytest
from design_plant import UNCERTAINTIES, DesignPlant

RATE_HZ, AT, THETA = 50.0, 5, -0.6
AILERON, ELEVATOR, RUDDER = range(3)


def plant(surface=None, **given):
    theta = None if surface is None or "position" in given else (lambda k: THETA if k >= AT else 0.0)
    return DesignPlant(seed=3, rate_hz=RATE_HZ, surface=surface, theta=theta, **given)


FAULTS = {
    "jam": lambda k, u: 0.2 if k >= AT else u,
    "hard over": lambda k, u: 0.44 if k >= AT else u,
    "bias": lambda k, u: u + 0.15 if k >= AT else u,
    "loss": lambda k, u: 0.3 * u if k >= AT else u,
    "oscillation": lambda k, u: u + 0.2 * np.sin(0.3 * k) if k >= AT else u,
    "runaway": lambda k, u: min(0.02 * (k - AT), 0.4) if k >= AT else u,
}


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("surface", [AILERON, ELEVATOR, RUDDER])
def test_of_faults_of_every_kind_the_true_position_is_never_excluded(name, surface):
    flown = plant(surface, position=FAULTS[name], fault_class="all")
    for _ in range(30):
        flown.fly(1, UNCERTAINTIES["random"])
        assert not flown.position_excluded(surface)
    verdict = flown.fdi["verdict"]
    assert verdict["detected"]
    assert verdict["target"] in (-1, surface)
    named = int(verdict["isolated_estimator"])
    assert named == -1 or flown.fdi["isolation"]["estimator"]["surface"][named] == surface
    if name != "oscillation" or surface != RUDDER:
        assert (
            surface
            in flown.fdi["isolation"]["estimator"]["surface"][
                flown.fdi["isolation"]["estimator"]["excluded"] == 0
            ]
        )
