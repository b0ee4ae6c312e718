"""What is assumed where a vehicle file says nothing of laws and air."""

import numpy as np
import pytest
import small

from beaver_ftc_logs.posterior import recent_scale
from beaver_ftc_logs.preparation import assume_law_and_air

BARE = {key: of for key, of in small.WING.items() if key != "labels"}


@pytest.mark.parametrize(
    ("of", "keys", "taken"),
    [
        (BARE, {}, (True, True)),
        (small.WING, {}, (False, False)),
        (BARE, {"moving_air": False}, (True, False)),
        (small.WING, {"other_laws": True}, (True, False)),
    ],
)
def test_laws_and_air_are_taken_to_be_others_unless_labels_or_a_key_say(of, keys, taken):
    model = small.model(of)
    vehicle, lines = assume_law_and_air([small.flight(model, n=60)], small.vehicle(of, **keys))
    assert (vehicle.other_laws, vehicle.moving_air) == taken
    assert [line.partition(":")[0] for line in lines[:2]] == ["other_laws", "moving_air"]
    assert sum("as the vehicle file says" in line for line in lines) == len(keys)


RNG = np.random.default_rng(5005)


@pytest.mark.parametrize(("span", "times"), [(1, 1.0), (10, (2.0 * 10**2 + 1.0) / (3.0 * 10.0))])
def test_noise_is_as_much_larger_as_it_is_and_as_its_sums_are(span, times):
    """Noise of nine times the variance, white or held for `span` samples: sums over n = 10 samples at any
    place have (2 n^2 + 1) / (3 n) times the variance that sums of white noise have."""
    held = np.repeat(RNG.standard_normal((6000 // span, 3)), span, axis=0)
    residual = 3.0 * held
    scale = recent_scale(residual, np.ones(6000, bool), 100.0)
    assert np.median(scale[1000:]) == pytest.approx(9.0 * times, rel=0.15)
    known = np.arange(6000) % 200 < 100
    gaps = recent_scale(residual * known[:, None], known, 100.0)
    assert np.median(gaps[1000:]) == pytest.approx(9.0 * times, rel=0.15)
