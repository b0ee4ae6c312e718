"""What is found out about an aircraft before it is sampled: on plants whose answers are known."""

from types import SimpleNamespace

import pytest

from beaver_ftc.plant.trim import TrimPoint
from beaver_ftc_aircraft.derive import outline

TRAVEL = {name: SimpleNamespace(min_rad=-0.4, max_rad=0.4) for name in ("aileron", "elevator")}


class Bench:
    """A plant that answers with functions of the state it was last put into, and counts its runs."""

    n_engines = 1

    def __init__(self, answers, travel=TRAVEL):
        self.answers, self.runs, self.put, self.held = answers, 0, [], 0
        self.aircraft = SimpleNamespace(
            travel=travel, envelope=SimpleNamespace(airspeed_mps=(30.0, 60.0)),
            file=SimpleNamespace(start=SimpleNamespace(altitude_m=1500.0)),
            engine=SimpleNamespace(settings={}, start="steady"),
        )  # fmt: skip

    def start(self, state):
        self.state = state
        self.put.append(state)

    def hold(self, state):
        self.state = state
        self.held += 1

    def run(self):
        self.runs += 1

    def has(self, name):
        return name in self.answers

    def read(self, name):
        return self.answers[name](self)


def trimmed(gamma_rad):
    return TrimPoint(45.0, 1500.0, gamma_rad=gamma_rad, residual=(0.0,) * 6, envelope_valid=True)


@pytest.mark.parametrize(
    ("start", "engines", "throttle"), [("steady", 1, 0.41), ("off", 1, 0.525), ("run_up", 0, 0.525)]
)
def test_level_flight_is_found_by_halving(start, engines, throttle, monkeypatch):
    """It climbs at more than 0.41 of the throttle: after nine halvings known to 0.95 / 2^10."""
    asked = []

    def trim(airspeed_mps, altitude_m, plant, throttle):
        asked.append((airspeed_mps, altitude_m, throttle))
        return trimmed(0.1 * (throttle - 0.41))

    monkeypatch.setattr(outline, "trim", trim)
    bench = Bench({})
    bench.n_engines, bench.aircraft.engine.start = engines, start
    data = {
        "envelope": {"airspeed_mps": (40.0, 60.0)}, "start": {"altitude_m": 1200.0},
        "engine": {"settings": {"throttle": {}}},
    }  # fmt: skip
    point = outline.level_trim(bench, data)
    found = data["engine"]["settings"]["throttle"]["default"]
    assert {place[:2] for place in asked} == {(50.0, 1200.0)}
    assert found == asked[-1][2] == round(found, 4) == pytest.approx(throttle, abs=0.95 / 2**9)
    assert point.gamma_rad == 0.1 * (found - 0.41)
    assert len(asked) == (10 if throttle == 0.41 else 1)
    if throttle == 0.41:
        assert asked[0][2] == 0.525
        assert abs(asked[-2][2] - asked[-3][2]) == pytest.approx(0.95 / 2**9)
