import numpy as np
import pytest

from beaver_ftc.results.log import ParquetLog, StoredLog
from beaver_ftc.results.series import series_of

COLUMNS = ("t_s", "x", "psi_rad", "q_residual_rad_s", "q_threshold_rad_s",
           "fie_e_q_residual_rad_s", "fie_e_q_lower_rad_s", "fie_e_q_upper_rad_s")  # fmt: skip


def _log(path, rows, **columns):
    t = np.arange(rows) / 100
    values = {name: columns.get(name, np.zeros(rows)) for name in COLUMNS} | {"t_s": t}
    with ParquetLog(path, 1000) as log:
        log.open(COLUMNS)
        log.write(np.column_stack([values[name] for name in COLUMNS]))
    return StoredLog(path)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "log.parquet"


def test_long_log_keeps_every_peak_at_its_time(path):
    x = np.zeros(50_000)
    x[12_345], x[33_333] = 7.0, -3.0
    series = series_of(_log(path, 50_000, x=x), ["x"], max_points=400)
    assert series["x"].size <= 480
    assert series["t_s"][series["x"].argmax()] == pytest.approx(123.45, abs=2.5)
    assert series["t_s"][series["x"].argmin()] == pytest.approx(333.33, abs=2.5)
    assert (series["x"].max(), series["x"].min()) == (7.0, -3.0)
    assert (np.diff(series["t_s"]) >= 0).all()


def test_window_of_a_long_log_is_in_full_resolution(path):
    x = np.arange(50_000.0)
    series = series_of(_log(path, 50_000, x=x), ["x"], (99.995, 110.005), max_points=2000)
    np.testing.assert_array_equal(series["x"], np.arange(10_000, 11_001))


def test_heading_goes_on_where_it_passes_north(path):
    psi = np.linspace(0, 4 * np.pi, 2500)
    np.testing.assert_allclose(
        series_of(_log(path, 2500, psi_rad=psi % (2 * np.pi)), ["psi_rad"])["psi_rad"], psi
    )


def test_ratio_is_of_the_bound_on_the_residuals_side(path):
    one = np.ones(4)
    bounds = {
        "fie_e_q_lower_rad_s": -2 * one,
        "fie_e_q_upper_rad_s": 4 * one,
        "q_threshold_rad_s": [0, 1, 2, 4],
    }
    residual = np.array([1.0, -1.0, 3.0, np.nan])
    _log(path, 4, fie_e_q_residual_rad_s=residual, q_residual_rad_s=residual, **bounds)
    series = series_of(StoredLog(path), ["q_ratio", "fie_e_q_ratio"])
    np.testing.assert_allclose(series["fie_e_q_ratio"], [0.25, 0.5, 0.75, np.nan])
    np.testing.assert_allclose(series["q_ratio"], [np.nan, 1.0, 1.5, np.nan])
