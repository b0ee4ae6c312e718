"""The speed through the field of gusts, and the strength of turbulence at a height: closed forms, by hand."""

import numpy as np
import pytest

from beaver_ftc.design.turbulence import Dryden
from beaver_ftc.diagnosis import bounds, bounds_design, gusts
from beaver_ftc.diagnosis.bounds import errors_dtype

SPAN_M, FT = 14.63, 0.3048
# sigma_w below 1000 ft: a tenth of 25.3, 50.6 and 76.0 ft/s; above 2000 ft: 7.4, 10.6 and 23.6 ft/s
LOW, HIGH = {"light": 2.53, "moderate": 5.06, "severe": 7.6}, {"light": 7.4, "moderate": 10.6, "severe": 23.6}


def record_of(dtype):
    return np.zeros(1, dtype).view(np.recarray)[0]


@pytest.mark.parametrize("turbulence", ["light", "moderate", "severe"])
@pytest.mark.parametrize("height_ft", [4.0, 10.0, 120.0, 300.0, 900.0, 5000.0])
def test_turbulence_is_as_strong_as_the_standard_has_it_at_a_height_and_no_less_than_aloft(
    turbulence, height_ft
):
    h, b = max(height_ft, 10.0), SPAN_M / FT
    low, high = LOW[turbulence] * FT, HIGH[turbulence] * FT
    record = record_of(gusts.GUST_RECORD)
    record["config"]["Q_aloft"] = Dryden(turbulence).rotation_walk(SPAN_M)
    record["config"]["Q_1m"] = Dryden(turbulence).rotation_walk_at_1_m(SPAN_M)
    record["config"]["h0"], record["config"]["h1"] = (
        0.7,
        0.02,
    )
    reading = height_ft * FT / (1.0 - 0.02 / 0.98) + 0.7 / 0.98 / (1.0 - 0.02 / 0.98)
    gusts.set_intensity(record, reading)
    L = h * FT
    rolling = 2.0 * 1.9**2 * 2.6 * max(low**2 / L**1.5, high**2 / (1750 * FT) ** 1.5) / SPAN_M**1.5
    vertical = 3.0 * max(low**2 / L, high**2 / (1750 * FT))
    by_gusts = [rolling, vertical * (np.pi / 4 / SPAN_M) ** 2, vertical * (np.pi / 3 / SPAN_M) ** 2]
    assert record["memory"]["Q"] == pytest.approx(by_gusts)

    declared_errors = record_of(errors_dtype(4))
    declared_errors["wg_aloft"] = bounds_design.GUST_LIMIT_SIGMA * Dryden(turbulence).rotation_limit_rad_s(
        SPAN_M
    )
    declared_errors["wg_1m"] = bounds_design.GUST_LIMIT_SIGMA * Dryden(turbulence).low_rotation_limit_rad_s(
        SPAN_M
    )
    declared_errors["h0"], declared_errors["h1"] = 0.7, 0.02
    bounds.set_air_rotation(declared_errors, reading)
    sigma = max(1.9 * LOW[turbulence] / np.sqrt(h * b), 1.9 * HIGH[turbulence] / np.sqrt(1750.0 * b))
    assert declared_errors["wg"] == pytest.approx(6.0 * sigma)
