"""The table of thrust: its power undoes its acceleration, and between its points it is linear."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.aircraft import MassProperties
from beaver_ftc.aircraft.schema import ThrustSection
from beaver_ftc.control.engines import (
    ENGINE,
    ENGINES,
    configure_engines,
    gained,
    look_up,
    power_for,
    set_up_engine,
)
from beaver_ftc.scenario.diagnosis import EnginePower

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
