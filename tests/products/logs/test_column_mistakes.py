"""A log with one mistake mended: every column of a sample follows its name."""

import numpy as np
import pytest

from beaver_ftc_logs.column_mistakes import corrected_logs
from products.logs import small
from telling import apart

NAMED = {"signals": ["alpha", "beta"], "airspeed": "tas", "reference_airspeed_mps": 30.0}


@pytest.fixture
def log():
    vehicle = small.vehicle(small.TAIL | NAMED)
    samples = small.flight(small.model(small.TAIL), n=4)
    rates = np.array([[1.0, 2.0, 3.0]]) * [[1.0], [1.1], [1.3], [1.7]]
    assert vehicle.regressor_columns == [
        "alpha",
        "beta",
        *(f"{n} by airspeed" for n in (*small.RATES.values(), "alpha", "beta")),
    ]
    given = {"rates": rates, "signals": np.hstack([rates[:, :1] + k for k in range(4, 11)])}
    apart(**given)
    return vehicle, type(samples)(**{**vars(samples), **given})


def column(samples, vehicle, name):
    names = [*small.RATES.values(), *vehicle.regressor_columns]
    return np.column_stack([samples.rates, samples.signals])[:, names.index(name)]


def test_a_factor_is_of_a_column_and_of_what_the_airspeed_makes_of_it(log):
    vehicle, samples = log
    found = {one.correction_text: one for one in corrected_logs(samples, vehicle)}
    for name in ("q_rad_s", "beta"):
        scaled = found[f"`scale: 57.3` on {name}"]
        assert scaled.log_jacobian == pytest.approx(np.log(57.29578) if name == "q_rad_s" else 0.0)
        for other in (*small.RATES.values(), *vehicle.regressor_columns):
            factor = 57.29577951 if other.removesuffix(" by airspeed") == name else 1.0
            np.testing.assert_allclose(
                column(scaled.samples, vehicle, other), factor * column(samples, vehicle, other)
            )


def test_what_is_exchanged_is_exchanged_in_all_of_its_columns(log):
    vehicle, samples = log
    found = {one.correction_text: one.samples for one in corrected_logs(samples, vehicle)}
    rates, turned = (
        found["p_rad_s and r_rad_s exchanged"],
        found["the commands of left_aileron and right_aileron exchanged"],
    )
    pairs = {"p_rad_s": "r_rad_s", "r_rad_s": "p_rad_s"}
    for name in (*small.RATES.values(), *vehicle.regressor_columns):
        stem = name.removesuffix(" by airspeed")
        source = name.replace(stem, pairs.get(stem, stem))
        np.testing.assert_array_equal(column(rates, vehicle, name), column(samples, vehicle, source))
    np.testing.assert_array_equal(turned.commands, samples.commands[:, [2, 1, 0]])
    assert len(found) == 3 + 3 + 5 * 5  # pairs of commands and of rates; a sign and two units either way
