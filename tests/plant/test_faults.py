"""The fault schedule: the right property, from the right frame to the right frame, at the right value."""

from math import exp, radians

import pytest
from pydantic import TypeAdapter

from beaver_ftc.plant.faults import NEVER, FaultSchedule, frame_of
from beaver_ftc.scenario.faults import HEALTHY, Fault

RATE_HZ = 100


def fault(**given):
    return TypeAdapter(Fault).validate_python({"at_s": 0.05} | given)


def elevator(type, **given):
    return fault(type=type, actuator="elevator", **given)


def fly(plant, faults, frames=12, names=("failures/elevator/effectiveness",)):
    """The named properties at each frame, flown as the loop flies: apply at a change, then run."""
    schedule, history, due = FaultSchedule(faults, plant, RATE_HZ), [], 0
    for k in range(frames):
        if k == due:
            schedule.apply(k)
            due = schedule.next_change(k)
        if k:
            plant.run()
        history.append([plant.read(name) for name in names])
    return [values[0] if len(values) == 1 else values for values in history]


@pytest.mark.parametrize(
    ("time_s", "frame"),
    [(0, 0), (0.05, 5), (0.0501, 6), (0.05 + 1e-10, 5), (12, 1200), (360_000, 36_000_000)],
)
def test_a_fault_begins_in_the_first_frame_not_before_its_time(time_s, frame):
    assert frame_of(time_s, RATE_HZ) == frame


@pytest.mark.parametrize("rate_hz", [20, 60, 100, 250, 333, 1000])
def test_a_time_on_a_frame_is_that_frame_whatever_the_rate(rate_hz):
    for k in range(0, 400_000, 997):
        assert frame_of(k / rate_hz, rate_hz) == k


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ({"type": "loss_of_effectiveness", "magnitude": 0.4}, {"effectiveness": 0.6}),
        ({"type": "stuck", "position_deg": 3.0}, {"stuck": 1, "stuck-at-rad": radians(3)}),
        ({"type": "hardover", "direction": -1}, {"hardover": -1}),
        ({"type": "float"}, {"float": 1}),
        ({"type": "bias", "bias_deg": -2.0}, {"bias-rad": radians(-2)}),
        ({"type": "rate_limit", "scale": 0.3}, {"rate-scale": 0.3}),
        (
            {"type": "oscillatory", "amplitude_deg": 1.0, "frequency_rad_s": 6.0},
            {"oscillation-amplitude-rad": radians(1), "oscillation-frequency-rad_sec": 6},
        ),
    ],
)
@pytest.mark.parametrize("surface", ["aileron", "elevator", "rudder", "flap"])
def test_each_type_sets_its_properties_alone_and_repairs_them(beaver, surface, given, wanted):
    healthy = {name: value for name, value in HEALTHY.items() if name != "Cm-alpha3"}
    names = [f"failures/{surface}/{name}" for name in healthy]
    history = fly(beaver, [fault(actuator=surface, end_s=0.09, **given)], names=names)
    for k, values in enumerate(history):
        expected = healthy | (wanted if 5 <= k < 9 else {})
        assert values == pytest.approx(list(expected.values())), f"frame {k}"


def test_the_unanticipated_fault(beaver):
    history = fly(
        beaver, [fault(type="unanticipated", Cm_alpha3=10)], names=["failures/unanticipated/Cm-alpha3"]
    )
    assert history == [0] * 5 + [10] * 7


def test_an_incipient_fault_grows_every_frame_and_then_rests(beaver):
    loss = elevator("loss_of_effectiveness", magnitude=0.5, profile="incipient", kappa_per_s=40.0)
    history = fly(beaver, [loss], frames=40)
    wanted = [1 - 0.5 * (1 - exp(-40 * (k / RATE_HZ - 0.05))) if k >= 5 else 1.0 for k in range(40)]
    assert history == pytest.approx(wanted, abs=1e-15)
    schedule = FaultSchedule([loss], beaver, RATE_HZ)
    assert schedule.next_change(0) == 5
    assert schedule.next_change(5) == 6
    assert schedule.next_change(200) == NEVER


def test_losses_on_one_surface_multiply_and_biases_add(beaver):
    faults = [
        elevator("loss_of_effectiveness", magnitude=0.4),
        elevator("loss_of_effectiveness", magnitude=0.5, at_s=0.07, end_s=0.1),
        elevator("bias", bias_deg=1.0),
        elevator("bias", bias_deg=2.0, at_s=0.08),
    ]
    history = fly(beaver, faults, names=["failures/elevator/effectiveness", "failures/elevator/bias-rad"])
    effectiveness, bias = zip(*history, strict=True)
    assert effectiveness == pytest.approx([1] * 5 + [0.6] * 2 + [0.3] * 3 + [0.6] * 2)
    assert bias == pytest.approx([0] * 5 + [radians(1)] * 3 + [radians(3)] * 4)


def test_a_jam_without_a_position_holds_the_surface_where_it_is(beaver):
    beaver.write("fcs/elevator-cmd-rad", 0.07)
    beaver.run()
    schedule = FaultSchedule([elevator("stuck")], beaver, RATE_HZ)
    schedule.apply(5)
    beaver.write("fcs/elevator-cmd-rad", -0.2)
    for k in range(6, 10):
        beaver.run()
        schedule.apply(k)
        assert beaver.read("fcs/elevator-pos-rad") == 0.07


def test_of_two_jams_the_earlier_holds(beaver):
    faults = [elevator("stuck", position_deg=2, at_s=0.07), elevator("stuck", position_deg=1, end_s=0.1)]
    history = fly(beaver, faults, names=["fcs/elevator-pos-rad"])
    assert history[5:] == pytest.approx([radians(1)] * 5 + [radians(2)] * 2)


def test_a_fault_at_time_zero_shows_in_the_accelerations_of_frame_zero(beaver):
    before = beaver.read("accelerations/qdot-rad_sec2")
    FaultSchedule([elevator("loss_of_effectiveness", magnitude=1, at_s=0)], beaver, RATE_HZ).apply(0)
    assert beaver.read("fcs/elevator-effective-rad") == 0
    assert abs(beaver.read("accelerations/qdot-rad_sec2") - before) > 0.05
    assert beaver.read("simulation/sim-time-sec") == 0
