"""The table of thrust: its power undoes its acceleration, and between its points it is linear."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.aircraft import MassProperties
from beaver_ftc.aircraft.schema import ThrustSection
from beaver_ftc.control.allocation import layout_dtype
from beaver_ftc.control.engines import (
    ENGINE,
    ENGINES,
    POWER,
    POWER_CONFIG,
    between,
    configure_engines,
    configure_power,
    gained,
    is_at_hand,
    look_up,
    power_for,
    set_up_engine,
)
from beaver_ftc.scenario.diagnosis import EnginePower
from telling import bits

MASS_KG = 500.0
SECTION = {"airspeed_mps": [20.0, 30.0, 60.0], "setting": [0.0, 0.25, 1.0], "lag_s": 0.8,
           "force_n": [[-100.0, 500.0, 2000.0], [-200.0, 400.0, 1500.0], [-500.0] * 2 + [600.0]]}  # fmt: skip


def engine_of(section=SECTION, airspeed_mps=30.0):
    engine = np.zeros(1, ENGINE).view(np.recarray)[0]
    set_up_engine(engine, ThrustSection.model_validate(section), MASS_KG)
    look_up(engine, airspeed_mps)
    return engine


@pytest.mark.parametrize(
    ("airspeed_mps", "power", "force_n"),
    [(30, 1.0, 1500), (30, 0.0, -200), (25, 0.25, 450), (45, 1.0, 1050), (30, 0.625, 950), (10, 1.0, 2000),
     (99, 0.0, -500)],
)  # fmt: skip
def test_an_acceleration_is_that_of_the_force_between_the_points_of_the_table(airspeed_mps, power, force_n):
    """Trim at 0: what it gives is the force less that at 0, over the mass, but for 1e-4 m/s2 a setting."""
    engine = engine_of(airspeed_mps=float(airspeed_mps))
    idle_n = np.interp(airspeed_mps, SECTION["airspeed_mps"], [row[0] for row in SECTION["force_n"]])
    expected = (force_n - idle_n) / MASS_KG
    assert gained(engine, 0.0, 0.0, power) == pytest.approx(expected, abs=3e-4)


@given(st.floats(15, 70), st.floats(0, 1), st.floats(0, 1))
def test_the_power_for_an_acceleration_gives_it(airspeed_mps, trim, power):
    """Also where the force does not rise with the setting: a small rise stands in."""
    engine = engine_of(airspeed_mps=airspeed_mps)
    assert power_for(engine, 0.0, trim, gained(engine, 0.0, trim, power)) == pytest.approx(power, abs=1e-6)


@pytest.mark.parametrize(("wanted", "power"), [(-50.0, 0.0), (50.0, 1.0)])
def test_what_no_power_gives_is_asked_of_the_end(wanted, power):
    assert power_for(engine_of(), 0.0, 0.5, wanted) == power


def test_without_a_table_the_slope_counts():
    engine = np.zeros(1, ENGINE).view(np.recarray)[0]
    set_up_engine(engine, None, MASS_KG)
    assert gained(engine, 0.2, 20.0, 23.0) == pytest.approx(0.6)
    assert power_for(engine, 0.2, 20.0, 0.6) == pytest.approx(23.0)


@given(st.floats(-5, 5), st.lists(st.floats(0.1, 2.0), min_size=1, max_size=6))
def test_between_is_linear_interpolation(at, steps):
    x = np.cumsum([-2.0, *steps])
    y = np.sin(x)
    assert between(at, x.size, x, y) == pytest.approx(np.interp(at, x, y), abs=1e-12)


@pytest.mark.parametrize(
    ("changes", "says"),
    [({"setting": [0.0, 1.0, 0.5]}, "rising"), ({"force_n": [[1.0, 2.0]]}, "no table"),
     ({"force_n": [[0.0, 9.0, 8.0]] * 3}, "falls with the setting")],
)  # fmt: skip
def test_what_is_no_table_is_refused(changes, says):
    with pytest.raises(ValueError, match="contradictory") as refused:
        ThrustSection.model_validate(SECTION | changes)
    assert says in str(refused.value.errors())


MASS = MassProperties(MASS_KG, 900.0, 1400.0, 2100.0, 150.0)
ARMS = {
    "left": (0.4, 0.3, -2.5),
    "right": (0.35, -0.2, 2.0),
    "tail": (0.25, 0.9, 0.1),
}  # share, down_m, right_m
RATE_HZ = 50


def flight(law="fault-tolerant", fault_class="all", setting="throttle", rpm=None, enabled=True, **changes):
    """A declaration of an aircraft with three engines, and a setting of its power from 0.15 to 0.9."""
    effectors = {
        name: SimpleNamespace(share=share, down_m=down, right_m=right)
        for name, (share, down, right) in ARMS.items()
    }
    named = (setting, SimpleNamespace(range=(0.15, 0.9))) if setting else None
    airframe = SimpleNamespace(**{
        "effectors": effectors, "mass": MASS, "file": SimpleNamespace(power_setting=named),
        "engine": SimpleNamespace(thrust=ThrustSection.model_validate(SECTION)), "power_setting": setting,
        "has_engine_instruments": rpm is not None, "surfaces": ("fin", "tab", "rudder"),
        "dominant_axis": (2, 1, 2), "terms": TERMS,
    } | changes)  # fmt: skip
    control = SimpleNamespace(law=law, power=EnginePower(**POWER_KEYS, enabled=enabled))
    initial = SimpleNamespace(engine_rpm=rpm, **({setting: 0.4} if setting else {}))
    fdi = SimpleNamespace(fault_class=fault_class)
    return SimpleNamespace(rate_hz=RATE_HZ, aircraft=airframe, control=control, initial=initial, fdi=fdi)


POWER_KEYS = {
    "speed_gain_inhg_per_mps": 0.7, "attitude_gain_inhg_per_deg": 0.3, "washout_s": 9.0, "smoothing_s": 0.4,
    "attitude_memory_s": 7.0, "lowest_inhg": 0.25, "highest_inhg": 0.8, "rate_inhg_s": 4.0,
    "patience_s": 1.25, "release_s": 8.0,
}  # fmt: skip
TERMS = {
    name: SimpleNamespace(coefficient=coefficient, of=of, surface=surface, value=value)
    for name, coefficient, of, surface, value in (
        ("one", "Cn", (), "rudder", 0.05), ("two", "Cn", (), "fin", 0.03), ("aside", "Cn", (), "tab", 9.0),
        ("flow", "Cn", (("alpha", 1),), "rudder", 9.0), ("rolls", "Cl", (), "rudder", 9.0),
        ("slip", "Cn", (("dpt", 3),), None, 0.004), ("slow", "Cn", (("dpt", 1),), None, 9.0),
    )
}  # fmt: skip
LAGS = {
    "impatience": 1.0 / RATE_HZ / 1.25, "forgiveness": 1.0 / RATE_HZ / 8.0, "speed_gain": 0.7,
    "attitude_gain": 0.3 * 180.0 / np.pi, "smoothing": 1.0 - np.exp(-1.0 / RATE_HZ / 0.4),
    "washout": 1.0 - np.exp(-1.0 / RATE_HZ / 9.0), "leak": 1.0 - np.exp(-1.0 / RATE_HZ / 7.0),
}  # fmt: skip


def test_engines_that_turn_the_aircraft_are_set_up_with_their_arms_over_its_inertia():
    """Rows of the inverse of the inertia, for the moment of a force along the body's x axis at each arm."""
    record = np.zeros(1, ENGINES)[0]
    configure_engines(record, flight())
    config, memory = record["config"], record["memory"]
    inertia = np.array([[900.0, 0.0, -150.0], [0.0, 1400.0, 0.0], [-150.0, 0.0, 2100.0]])
    for e, (share, down, right) in enumerate(ARMS.values()):
        turned = np.linalg.solve(inertia, share * MASS_KG * np.array([0.0, down, -right]))
        assert config["B"][:, e] == pytest.approx(turned)
    assert not config["B"][:, 3:].any()
    found = [config[name].item() for name in ("n", "low", "high", "step", "part", "release")]
    assert found == pytest.approx(
        [3, 0.15, 0.9, 0.75 / 5.0 / RATE_HZ, 1.0 / RATE_HZ / 1.6, 1.0 / RATE_HZ / 20.0]
    )
    assert memory["problem"]["weight"].tolist() == [1.0] * 3 + [0.0] * (memory["problem"]["weight"].size - 3)
    expected = engine_of()
    for name in ("settings", "airspeeds", "setting", "airspeed", "table"):
        assert memory["thrust"][name].tolist() == expected[name].tolist()


@pytest.mark.parametrize(("thrust", "lag_s"), [(None, 0.5), ({"lag_s": 0.2}, 0.5), ({"lag_s": 0.6}, 0.6)])
def test_engines_take_twice_their_lag_and_one_second_at_least(thrust, lag_s):
    record = np.zeros(1, ENGINES)[0]
    section = thrust and ThrustSection.model_validate(SECTION | thrust)
    configure_engines(record, flight(engine=SimpleNamespace(thrust=section)))
    assert record["config"]["part"] == pytest.approx(1.0 / RATE_HZ / (2.0 * lag_s))


@pytest.mark.parametrize("keys", [{"law": "nominal"}, {"enabled": False}, {"setting": ""}, {"effectors": {}}])
def test_engines_that_may_not_turn_the_aircraft_are_not_set_up(keys):
    record = np.zeros(1, ENGINES)[0]
    configure_engines(record, flight(**keys))
    assert bits(record) == bits(np.zeros(1, ENGINES)[0])


@pytest.mark.parametrize(
    ("law", "fault_class", "at_hand"),
    [
        ("fault-tolerant", "all", 1), ("fault-tolerant", "published", 0), ("oracle", "published", 1),
        ("adaptive", "all", 0), ("zhang2005", "all", 0), ("fault-tolerant-published", "all", 1),
        ("nominal", "all", 0),
    ],
)  # fmt: skip
def test_which_law_may_leave_pitch_to_the_engine(law, fault_class, at_hand):
    keys = {"law": law, "fault_class": fault_class}
    piston = {"setting": "manifold_pressure_inhg", "rpm": 1900.0}
    assert is_at_hand(flight(**keys, **piston)) == at_hand
    assert not is_at_hand(flight(**keys, **piston, enabled=False))
    assert not is_at_hand(flight(**keys, setting="throttle", rpm=1900.0))
    assert not is_at_hand(flight(**keys, setting="manifold_pressure_inhg"))


def powered(**keys):
    """{name: value} of the configuration of power, and what is not zero beside it."""
    record, layout = np.zeros(1, POWER)[0], np.zeros(1, layout_dtype(3))[0]
    layout["main"], layout["low"], layout["high"] = (1, 1, 2), (-0.1, -0.2, -0.35), (0.1, 0.2, 0.3)
    configure_power(record, layout, flight(**keys))
    assert record["output"]["from_s"] == -1.0
    trim = float(record["setpoint"]["base"])
    assert record["output"]["command"].tolist() == [trim] + [0.0] * (record["output"]["command"].size - 1)
    assert (record["output"]["least"], record["output"]["greatest"]) == (trim, trim)
    assert not any(record["memory"].tolist())
    return {name: record["config"][name].item() for name in POWER_CONFIG.names}, trim


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"setting": ""}, {}),
        ({}, {"trim": 0.4, "low": 0.15, "high": 0.9, "step": 0.75 / 5.0 / RATE_HZ}),
        ({"setting": "manifold_pressure_inhg", "rpm": 1900.0}, {
            "enabled": 1, "trim": 0.4, "low": 0.25, "high": 0.8, "step": 4.0 / RATE_HZ,
            # dpt = .. + 191.18 P / (rho V^3 / 2), P = 0.7355 (0.00412 (pz + 7.4) (n + 2010) + ..) [FDC]
            "dpt_factor": 2.0 * 191.18 * 0.7355 * 0.00412 * (1900.0 + 2010.0),
            # the smaller travel, by the terms of rudder and fin that nothing else multiplies
            "highest_dpt": (0.5 * 0.08 * 0.3 / 0.004) ** (1.0 / 3.0),
        }),
        ({"setting": "manifold_pressure_inhg", "rpm": 1900.0, "terms": {}, "law": "nominal"}, {
            "trim": 0.4, "low": 0.25, "high": 0.8, "step": 4.0 / RATE_HZ, "highest_dpt": np.inf,
            "dpt_factor": 2.0 * 191.18 * 0.7355 * 0.00412 * (1900.0 + 2010.0),
        }),
    ],
)  # fmt: skip
def test_power_is_set_up_in_the_units_of_its_setting(keys, expected):
    config, trim = powered(**keys)
    assert config == pytest.approx(dict.fromkeys(config, 0.0) | LAGS | expected)
    assert trim == expected.get("trim", 0.0)
