"""Faults as frames, and what several of one instrument come to."""

from math import exp

import numpy as np
import pytest

from beaver_ftc.plant.faults import (
    NEVER,
    FaultSchedule,
    SensorFaultSchedule,
    _Event,
    frame_of,
    is_there,
)
from beaver_ftc.plant.instruments import CONFIGURED, SENSORS, instruments_dtype, take_configuration
from beaver_ftc.scenario.faults import HEALTHY, SurfaceFault
from beaver_ftc.scenario.schema import load
from telling import bits, fill

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


def test_a_fault_grows_as_an_exponential_until_nothing_is_left_to_grow():
    (fault,) = faults({**LOSS, "profile": "incipient", "kappa_per_s": 2.0})
    event = _Event(fault, 100.0)
    assert [event.share(k) for k in (0, 10)] == [0.0, 0.0]
    assert event.share(60) == pytest.approx(1.0 - exp(-2.0 * 0.5))
    assert event.grown == frame_of(0.1 + 37.0 / 2.0, 100.0) == 1860
    assert event.share(1859) == 1.0 - exp(-2.0 * (18.59 - 0.1))
    assert event.share(1860) == 1.0
    (abrupt,) = faults(LOSS)
    assert [_Event(abrupt, 100.0).share(k) for k in (10, 11)] == [1.0, 1.0]


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


def test_what_is_written_when():
    stuck = {"type": "stuck", "actuator": "rudder", "at_s": 0.0, "end_s": 0.2}
    plant = Recorded()
    schedule = FaultSchedule(faults(LOSS, stuck), plant, 100.0)
    schedule.apply(0)
    assert (plant.written, plant.settled) == ([("rudder/stuck", 1.0), ("rudder/stuck-at-rad", 0.25)], 1)
    schedule.apply(0)
    assert (len(plant.written), plant.settled) == (2, 1)  # again is harmless
    schedule.apply(10)
    assert plant.written[2:] == [("elevator/effectiveness", 0.5)]
    schedule.apply(20)
    assert plant.written[3:] == [("rudder/stuck", 0.0), ("rudder/stuck-at-rad", 0.0)]
    assert (plant.settled, schedule.any, schedule.begun(0), schedule.next_change(20)) == (
        1,
        True,
        True,
        NEVER,
    )
    assert [schedule.next_change(k) for k in (-1, 0, 10)] == [0, 10, 20]


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


def test_faults_declared_later_and_ended_earlier():
    plant = Recorded()
    first, second = faults(LOSS, {**LOSS, "actuator": "flap", "at_s": 0.3})
    schedule = FaultSchedule([first], plant, 100.0)
    assert [schedule.begun(k) for k in (9, 10)] == [False, True]
    schedule.apply(10)
    schedule.declare([first.model_copy(update={"end_s": 0.2}), second])
    assert [schedule.next_change(k) for k in (10, 20, 30)] == [20, 30, NEVER]
    schedule.apply(20)
    schedule.apply(30)
    assert plant.written == [
        ("elevator/effectiveness", 0.5), ("elevator/effectiveness", HEALTHY["effectiveness"]),
        ("flap/effectiveness", 0.5),
    ]  # fmt: skip
    none = FaultSchedule([], plant, 100.0)
    assert (none.any, none.begun(99), none.next_change(0)) == (False, False, NEVER)


def test_a_jam_stays_where_the_surface_was_as_it_began(monkeypatch):
    """Whatever the surface does later, and again when another change of the flight is due."""
    plant, there = Recorded(), iter((0.25, 0.31, 0.42))
    plant.read = lambda name: next(there)
    stuck = {"type": "stuck", "actuator": "rudder", "at_s": 0.1}
    schedule = FaultSchedule(faults(stuck, {**LOSS, "at_s": 0.2}), plant, 100.0)
    for k in (10, 20):
        schedule.apply(k)
    assert plant.written == [
        ("rudder/stuck", 1.0), ("rudder/stuck-at-rad", 0.25), ("elevator/effectiveness", 0.5),
    ]  # fmt: skip


def test_a_fault_that_follows_its_actuator_takes_each_frame_in_once():
    """A frame that is applied again is not taken in again; nor is one before the fault or after it."""
    followed = []

    class Follows(SurfaceFault):
        type: str = "follows"
        profile: str = "abrupt"
        follows_actuator = True

        def follow(self, past, actuator_rad):
            followed.append(actuator_rad)

    event = _Event(Follows(at_s=0.1, end_s=0.13), 100.0)
    for k in (9, 10, 10, 11, 11, 12, 13):
        event.note(k, lambda surface, k=k: 0.01 * k)
    assert followed == pytest.approx([0.1, 0.11, 0.12])
    assert [event.next_change(k) for k in (9, 10, 11, 12, 13)] == [10, 11, 12, 13, NEVER]


def test_other_sensors_are_taken_in_flight_with_the_memory_that_there_is():
    """Every part that is configured is new; random numbers and readings go on, lags and delays begin anew."""
    old, new = (fill(instruments(), seed) for seed in (1, 2))
    before, given = old.copy(), new.copy()
    take_configuration(old, new)
    for name in old.dtype.names:
        source = given if name in CONFIGURED else before
        expected = np.zeros_like(source[name]) if name == "taken" else source[name]
        assert bits(np.asarray(old[name])) == bits(np.asarray(expected)), name
    assert set(old.dtype.names) - set(CONFIGURED) == {
        "random", "counter", "lagged", "line", "taken", "reading", "broken", "fault",
    }  # fmt: skip


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


def test_instruments_of_which_none_breaks_are_left_alone():
    record = instruments()
    SensorFaultSchedule(faults(LOSS), record, 100.0).apply(20)
    assert record["broken"] == 0
