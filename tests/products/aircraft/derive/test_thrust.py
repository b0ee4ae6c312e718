"""The table of thrust of an aircraft whose force is its setting, newton for newton."""

from types import SimpleNamespace

import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.plant.adapter import FlightState, Plant
from beaver_ftc.plant.trim import trim
from beaver_ftc_aircraft.derive import thrust
from beaver_ftc_aircraft.derive.thrust import effectors_of, thrust_of
from telling import apart

from .known import TRAINER


@pytest.fixture(scope="module")
def measured():
    aircraft = load("./trainer", TRAINER.parent)
    plant = Plant(100, aircraft=aircraft)
    point = trim(50.0, 1500.0, plant=plant)
    return aircraft, thrust_of(plant, point), plant, point


def test_each_force_is_its_setting_at_every_airspeed(measured):
    aircraft, found, _, _ = measured
    assert found["airspeed_mps"][0] == aircraft.envelope.airspeed_mps[0]
    assert found["airspeed_mps"][-1] == aircraft.envelope.airspeed_mps[1]
    assert found["setting"] == pytest.approx([0, 600, 1200, 1800, 2400, 3000])
    for row in found["force_n"]:
        assert row == pytest.approx(found["setting"], rel=5e-3, abs=1.0)  # it flies 0.1 s meanwhile
    assert found["lag_s"] <= 0.1


class Turbine:
    """An engine that takes its time, and more of it the higher its setting; what else a plant does is not
    asked."""

    dt_s = 0.01
    aircraft = SimpleNamespace(trim=SimpleNamespace(throttle="throttle"))

    def __init__(self):
        self.wanted, self.force = 0.0, 0.0
        self.written = []

    def has(self, name):
        return name == thrust.OF_ENGINES

    def start(self, state):
        self.force = self.wanted = 0.0

    def hold(self, state):
        assert state == "trim"

    def write(self, name, value):
        assert name == "throttle"
        self.wanted = value
        self.written.append(value)

    def run(self):
        self.force += self.dt_s * (self.wanted - self.force) / (self.wanted / 3000.0)

    def read(self, name):
        return 2.0 * self.force + 7.0


def test_the_lag_is_that_of_a_step_within_the_range_of_the_settings():
    """From 0.4 to 0.7 of 1000 to 3000: the lag at the latter setting, 2400, is 0.8 s."""
    plant = Turbine()
    assert thrust._lag_s(plant, "trim", 1000.0, 3000.0) == pytest.approx(0.8, abs=0.11)
    assert list(dict.fromkeys(plant.written)) == [1800.0, 2400.0]


TRIM = FlightState(50.0, 1500.0, surfaces_rad={"elevator": -0.02}, settings={"power": 0.3})
LBF_N, FT_M = 4.4482216, 0.3048


class Jet:
    """Engines that push at once by the common lever and one of their own each, at places beside and below
    the centre of gravity; drag grows with airspeed."""

    dt_s, n_engines = 0.02, 3
    PUSH_LBF, RIGHT_FT, DOWN_FT = (310.0, 170.0, 520.0), (-11.0, 2.5, 7.3), (3.1, -1.7, 4.9)

    def __init__(self, mass_kg=900.0, power=("power", (0.1, 0.9))):
        name, ends = power or (None, None)
        setting = name and ("power", SimpleNamespace(range=ends))
        self.aircraft = SimpleNamespace(
            mass=SimpleNamespace(mass_kg=mass_kg), trim=SimpleNamespace(throttle="power"),
            envelope=SimpleNamespace(airspeed_mps=(40.0, 80.0)), file=SimpleNamespace(power_setting=setting),
        )  # fmt: skip
        self.now, self.put, self.runs, self.held = {}, [], 0, []

    def start(self, state):
        self.put.append(state)
        self.now |= {"power": state.settings["power"], "V": state.airspeed_mps}

    def hold(self, state):
        self.held.append(state)

    def has(self, name):
        return name == thrust.OF_ENGINES

    def write(self, name, value):
        self.now[name] = value

    def run(self):
        self.runs += 1

    def read(self, name):
        if name == "power":
            return self.now[name]
        levers = [
            self.now["power"] + self.now.get(f"fcs/actuated-throttle-{i}-difference", 0.0) for i in range(3)
        ]
        pushes = [lever * push for lever, push in zip(levers, self.PUSH_LBF, strict=True)]
        return {
            "forces/fbx-prop-lbs": sum(pushes),
            "forces/fbx-total-lbs": sum(pushes) * 100.0 / self.now["V"] - 0.2 * self.now["V"],
            "moments/m-prop-lbsft": sum(f * arm for f, arm in zip(pushes, self.DOWN_FT, strict=True)),
            "moments/n-prop-lbsft": -sum(f * arm for f, arm in zip(pushes, self.RIGHT_FT, strict=True)),
        }[name]


def test_an_engines_share_and_arms_are_what_its_own_lever_changes():
    """A push right of the centre of gravity turns left, one below it pitches up; then all is as before."""
    apart(push=Jet.PUSH_LBF, right=Jet.RIGHT_FT, down=Jet.DOWN_FT)
    jet = Jet()
    assert effectors_of(jet, TRIM) == {
        f"engine_{i + 1}": {
            "throttle": f"fcs/actuated-throttle-{i}-difference", "share": round(push / 1000.0, 4),
            "right_m": round(right * FT_M, 3), "down_m": round(down * FT_M, 3),
        }
        for i, (push, right, down) in enumerate(zip(jet.PUSH_LBF, jet.RIGHT_FT, jet.DOWN_FT, strict=True))
    }  # fmt: skip
    assert [jet.now[f"fcs/actuated-throttle-{i}-difference"] for i in range(3)] == [0.0, 0.0, 0.0]
    assert set(map(id, [*jet.put, *jet.held])) == {id(TRIM)}
    assert (len(jet.put), jet.put[-1]) == (7, TRIM)
    assert (len(jet.held), jet.runs) == (6 * 60, 6 * 60 * 5)  # 6 s of each, put back each tenth of a second
