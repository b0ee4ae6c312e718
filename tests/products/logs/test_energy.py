"""Energy height by closed forms, and which names an engine that may have failed leaves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc_logs import energy
from beaver_ftc_logs.readers import alfa
from beaver_ftc_logs.recording import Column, RecordedFlight
from beaver_ftc_logs.samples import resample
from beaver_ftc_logs.vehicle import Vehicle

T_S = np.arange(0.0, 20.0, 0.1)
ONE = np.zeros(len(T_S), dtype=int)
G = 9.80665
WING = {
    "name": "wing",
    "rates": {"p": "p", "q": "q", "r": "r"},
    "commands": ["roll"],
    "surfaces": {"left": {"roll": 1.0}},
    "energy": {"altitude": {"column": "alt", "unit": "ft"}, "airspeed": {"column": "tas", "unit": "km/h"}},
}


@pytest.mark.parametrize(
    ("altitude", "airspeed", "expected"),
    [
        (100.0 - 2.0 * T_S, np.full(len(T_S), 20.0), -2.0),  # a glide
        (np.full(len(T_S), 50.0), np.sqrt(400.0 + 2.0 * G * 1.5 * T_S), 1.5),  # power into speed
        (100.0 - 3.0 * T_S, np.sqrt(400.0 + 2.0 * G * 3.0 * T_S), 0.0),  # a dive without drag
    ],
)
def test_the_energy_height_climbs_as_mechanics_says(altitude, airspeed, expected):
    climb = energy.energy_climb_mps(T_S, altitude, airspeed, ONE)
    assert np.isnan(climb[T_S < 4.9]).all()
    np.testing.assert_allclose(climb[T_S > 5.05], expected, atol=1e-9)


def test_an_alarm_while_energy_falls_names_an_engine_after_three_seconds_and_no_surface():
    """It stays named while nothing rises."""
    faulty = ((T_S >= 5.0) & (T_S < 15.0)).astype(int)
    names = np.where(faulty == 1, "left", "").astype(object)
    climb = np.where(T_S < 4.0, 0.5, np.where(T_S < 9.0, -2.0, -0.5))
    named = energy.withdraw_surfaces(T_S, faulty, names, climb, -1.0, T_S)
    assert set(named[(T_S >= 5.0) & (T_S < 7.9)]) == {"unknown"}
    assert set(named[(T_S > 8.05) & (T_S < 14.95)]) == {"engine"}
    assert set(named[(T_S < 4.95) | (T_S > 15.05)]) == {""}


@given(st.lists(st.tuples(st.integers(0, 1), st.booleans()), min_size=2, max_size=60), st.integers(1, 60))
def test_a_name_uses_nothing_later(rows, cut):
    faulty, falls = np.array(rows).T
    names, t_s = np.where(faulty == 1, "left", "").astype(object), np.arange(len(rows)) * 0.5
    given = t_s, faulty, names, np.where(falls, -2.0, 0.5), np.maximum(t_s - 2.0, 0.0)
    whole, short = (
        energy.withdraw_surfaces(*of[:4], -1.0, of[4]) for of in (given, [one[:cut] for one in given])
    )
    assert whole[:cut].tolist() == short.tolist()
    assert ((whole == "") == (faulty == 0)).all()


def recording(**columns):
    rng = np.random.default_rng(1)
    known = {name: rng.normal(0.0, 0.1, len(T_S)) for name in ("p", "q", "r", "roll")}
    return RecordedFlight("one", {name: Column(T_S, values) for name, values in (known | columns).items()})


def test_samples_have_it_in_si_where_it_is_logged():
    vehicle = Vehicle.model_validate(WING)
    logged = {"alt": (100.0 - 2.0 * T_S) / 0.3048, "tas": np.full(len(T_S), 72.0)}
    climb = resample(recording(**logged), vehicle).energy_height_rate_mps
    np.testing.assert_allclose(climb[T_S > 5.05], -2.0, atol=1e-9)
    assert np.isnan(resample(recording(alt=logged["alt"]), vehicle).energy_height_rate_mps).all()


def test_the_airspeed_of_an_alfa_flight_is_ground_speed_less_the_last_wind():
    """No later wind counts. Where a topic is missing, or no row of it is left, there is no airspeed."""
    stamps, wind_s, none = np.array([1.0, 2.0, 3.0]), np.array([1.5, 2.5]), np.empty(0)
    columns = {
        "ground_north_m_s": Column(stamps, 3.0 * stamps), "ground_east_m_s": Column(stamps, 4.0 * stamps),
        "wind_north_m_s": Column(wind_s, np.array([0.0, 4.0])),
        "wind_east_m_s": Column(wind_s, np.array([0.0, 12.0])),
    }  # fmt: skip
    calm = columns | {"wind_east_m_s": Column(none, none)}
    still = {name: one for name, one in columns.items() if name.startswith("ground")}
    for of in (columns, calm, still):
        alfa._add_airspeed_from_wind(of)
    np.testing.assert_array_equal(columns["airspeed_by_wind_m_s"].values, [np.nan, 10.0, 5.0])
    assert not {"airspeed_by_wind_m_s"} & (calm.keys() | still.keys())
