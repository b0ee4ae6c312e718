"""Faults as frames, and what several of one instrument come to."""

import numpy as np
import pytest

from beaver_ftc.plant.faults import (
    NEVER,
    FaultSchedule,
    SensorFaultSchedule,
    _Event,
    is_there,
)
from beaver_ftc.plant.instruments import SENSORS, instruments_dtype
from beaver_ftc.scenario.schema import load

LOSS = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.5, "at_s": 0.1}
GROWING = {"profile": "incipient", "kappa_per_s": 370.0}


def faults(*given):
    return load({"faults": list(given)}).faults


@pytest.mark.parametrize(
    ("times", "in_force", "next_changes"),
    [
        ({}, range(10, 50), {0: 10, 9: 10, 10: NEVER, 49: NEVER}),
        ({"end_s": 0.3}, range(10, 30), {0: 10, 10: 30, 29: 30, 30: NEVER, 31: NEVER}),
        (GROWING, range(10, 50), {9: 10, 10: 11, 18: 19, 19: 20, 20: NEVER}),
        ({**GROWING, "end_s": 0.15}, range(10, 15), {14: 15, 13: 14, 15: NEVER}),
    ],
)  # fmt: skip
def test_when_a_fault_changes_something(times, in_force, next_changes):
    (fault,) = faults({**LOSS, **times})
    event = _Event(fault, 100.0)
    assert [k for k in range(50) if event.in_force(k)] == list(in_force)
    assert [k for k in range(50) if is_there(fault, k, 100.0)] == list(in_force)
    assert {k: event.next_change(k) for k in next_changes} == next_changes
    assert event.place == "failures/elevator"


class Recorded:
    """Stands for a plant: notes what is written, how often it settles; every surface is at 0.25 rad."""

    def __init__(self):
        self.aircraft = load({}).airframe
        self.written, self.settled = [], 0

    def write(self, name, value):
        self.written.append((name.removeprefix("failures/"), value))

    def read(self, name):
        return 0.25

    def settle(self):
        self.settled += 1


def test_of_two_runaways_or_oscillations_the_later_holds_in_whatever_order_they_are_declared():
    def moved(type, at_s, **of):
        return {"type": type, "actuator": "flap", "at_s": at_s, "end_s": at_s + 0.1, **of}

    plant = Recorded()
    given = faults(
        moved("hardover", 0.15, direction=-1), moved("hardover", 0.1, direction=1),
        moved("oscillatory", 0.15, amplitude_deg=2.0, frequency_rad_s=7.0),
        moved("oscillatory", 0.1, amplitude_deg=1.0, frequency_rad_s=5.0),
    )  # fmt: skip
    schedule = FaultSchedule(given, plant, 100.0)
    per_deg = np.pi / 180
    for k, (way, amplitude_deg, frequency) in (
        (10, (1, 1, 5)),
        (15, (-1, 2, 7)),
        (20, (-1, 2, 7)),
        (25, (0, 0, 0)),
    ):
        schedule.apply(k)
        now = dict(plant.written)
        found = [now[f"flap/{name}"] for name in (
            "hardover", "oscillation-amplitude-rad", "oscillation-frequency-rad_sec"
        )]  # fmt: skip
        assert found == pytest.approx([way, amplitude_deg * per_deg, frequency]), k


def instruments():
    return np.zeros(1, instruments_dtype())[0]


def test_what_faults_of_one_instrument_come_to():
    record = instruments()
    on_p = [{"sensor": "p", "at_s": 0.1, **of} for of in (
        {"type": "bias", "magnitude": 2.0}, {"type": "bias", "magnitude": 1.0},
        {"type": "noise", "magnitude": 3.0}, {"type": "noise", "magnitude": 4.0},
        {"type": "scale", "magnitude": 0.5}, {"type": "scale", "magnitude": -0.2, "end_s": 0.2},
    )]  # fmt: skip
    others = [{"sensor": "V", "type": "freeze", "at_s": 0.1}, {"sensor": "az", "type": "lost", "at_s": 0.15}]
    schedule = SensorFaultSchedule(faults(LOSS, *on_p, *others), record, 100.0, has_engine=True)
    schedule.apply(9)
    assert (record["broken"], record["engine"], record["fault"]["bias"].any()) == (1, 0, False)
    schedule.apply(10)
    of = record["fault"]
    per_deg = np.pi / 180
    assert of["bias"][0] == pytest.approx(3.0 * per_deg)
    assert of["noise"][0] == pytest.approx(5.0 * per_deg)
    assert of["scale"][0] == pytest.approx(1.5 * 0.8 - 1.0)
    assert (record["engine"], list(np.flatnonzero(of["frozen"])), of["lost"].any()) == (
        1,
        [SENSORS.index("V")],
        False,
    )
    schedule.apply(20)
    schedule.apply(20)
    assert of["scale"][0] == pytest.approx(0.5)
    assert of["bias"][0] == pytest.approx(3.0 * per_deg)
    assert list(np.flatnonzero(of["lost"])) == [SENSORS.index("az")]


@pytest.mark.parametrize(
    ("sensor", "has_engine", "works_out"),
    [("qdyn", True, 1), ("V", True, 1), ("engine_rpm", True, 1), ("manifold_pressure", True, 1),
     ("p", True, 0), ("V", False, 0)],
)  # fmt: skip
def test_what_the_slipstream_is_worked_out_from(sensor, has_engine, works_out):
    record = instruments()
    given = faults({"sensor": sensor, "type": "bias", "magnitude": 1.0, "at_s": 0.1, "end_s": 0.2})
    schedule = SensorFaultSchedule(given, record, 100.0, has_engine)
    schedule.apply(50)  # it is over, and yet
    assert record["engine"] == works_out
    assert record["fault"]["bias"].any() == np.False_
