"""The flight under an autopilot: as in process, at any rate of packets, its faults and its instant."""

from pathlib import Path

import numpy as np
import pytest
from tools.autopilots import peers
from tools.autopilots.reader import read
from tools.autopilots.small import Small

import beaver_ftc as bf
from beaver_ftc.design import standard_air
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant.adapter import body_axes
from beaver_ftc_links.sitl.ardupilot import Ardupilot
from beaver_ftc_links.sitl.link import Link
from beaver_ftc_links.sitl.mavlink import Mavlink
from beaver_ftc_links.sitl.px4 import Px4, quaternion
from beaver_ftc_links.sitl.vehicle import Vehicle

NO_PULSE = 0


def scenario(**keys):
    """Level, as published otherwise; 1.5 s."""
    base = bf.load("elevator-partial-loss")
    keys = {"faults": [], "reference": {}, "expect": {}, "duration_s": 1.5, "control.law": "nominal", **keys}
    return base.with_(keys)


def flown_by(vehicle, packets):
    """The log of a flight driven by datagrams."""
    end = Ardupilot(vehicle, Link())
    for datagram in packets:
        assert end.take(datagram, "it", 0.0) is not None
    return vehicle.flight.land().log


def recorded(frames, rate_hz, seed=3):
    """Datagrams, and the pulses in them."""
    rng = np.random.default_rng(seed)
    pulses = rng.integers(1400, 1600, (frames, 4))
    pulses[:, 2] = NO_PULSE  # of the throttle: the engine stays as it is
    return [peers.packet(k, rate_hz, row.tolist()) for k, row in enumerate(pulses)], pulses


def commands(pulses, trim_rad):
    """What the Beaver's surfaces make of them, by hand: full output is the stop."""
    share = (pulses - 1500) / 500
    aileron, elevator, rudder = -share[:, 0] * 0.52, -share[:, 1] * 0.49, -share[:, 3] * 0.44
    return np.column_stack([aileron, elevator, rudder, np.full(len(pulses), trim_rad[3])])


BROKEN = {
    "faults": [
        {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.4, "at_s": 0.5},
        {"type": "bias", "sensor": "p", "magnitude": 2.0, "at_s": 0.8},
    ]
}


def test_what_ardupilot_is_told_is_what_is_kept(changed):
    end = Ardupilot(Vehicle(scenario(**BROKEN), pulses=True), Link())
    told = [read(end.take(datagram, "it", 0.0)) for datagram in recorded(149, 100)[0]]
    assert not changed(told[::20], relative=1e-3)


def test_what_px4_is_told_is_what_is_kept(changed):
    end = Px4(Vehicle(scenario(**BROKEN), pulses=False), Link(), Mavlink(), None)
    autopilot = peers.Px4(Small().outputs, silent=0, armed_after=2)
    answer, told = autopilot.hear(end.connect(0.0)), []
    for k in range(300):
        answer = autopilot.hear(end.take(answer, 0.004 * k))
        told += [autopilot.state.to_dict(), autopilot.gps.to_dict()] if k % 50 == 49 else []
    assert not changed(told, relative=1e-3)


@pytest.mark.parametrize("noisy", [False, True])
def test_recorded_packets_fly_what_the_same_commands_fly_in_process(noisy):
    """To the bit; with a fault of a surface and one of an instrument, turbulence, sensors and servos."""
    keys = BROKEN
    if noisy:
        keys = BROKEN | {
            "sensors": "tactical-grade", "actuators": "servo", "fdi.bounds.sensors": "tactical-grade",
            "environment": {"turbulence": "dryden", "severity": "light"},
        }  # fmt: skip
    packets, pulses = recorded(149, 100)
    log = flown_by(Vehicle(scenario(**keys), pulses=True), packets)
    sim = bf.Simulation(scenario(**keys))
    for command in commands(pulses, sim.trim_rad):
        sim.step(command)
    assert log.columns.tolist() == list(sim.columns)
    assert len(log) == 150
    assert np.array_equal(log.to_numpy(), sim.log.to_numpy(), equal_nan=True)
    assert log["detected"].iloc[-1] == 1


@pytest.mark.parametrize("packets_hz", [50, 400, 1200])
def test_the_flight_follows_the_rate_of_the_packets(packets_hz):
    """At most 400 frames of the diagnosis a second: of faster packets the first in each counts."""
    loss = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.4, "at_s": 0.2}
    air = {"duration_s": 1.0, "environment": {"turbulence": "dryden", "severity": "light"}, "faults": [loss]}
    packets, pulses = recorded(round(0.5 * packets_hz), packets_hz)
    vehicle = Vehicle(scenario(**air), pulses=True)
    log = flown_by(vehicle, packets)
    frames_hz = min(packets_hz, 400)
    each = packets_hz // frames_hz
    assert vehicle.scenario.rate_hz == frames_hz
    assert vehicle.instant().t_s == pytest.approx(0.5)
    sim = bf.Simulation(scenario(**air, rate_hz=frames_hz, substeps=each))
    for command in commands(pulses[::each], sim.trim_rad):
        sim.step(command)
    assert np.array_equal(log.to_numpy(), sim.log.to_numpy(), equal_nan=True)


def test_the_example_finds_its_fault_under_the_small_autopilot():
    """`examples/autopilot`, sooner."""
    file = Path(__file__).parents[4] / "examples" / "autopilot" / "under-an-autopilot.yaml"
    base = bf.load(file).with_({"duration_s": 9, "faults[0].at_s": 6})
    assert base.warnings() == ()
    vehicle = Vehicle(base, pulses=True, log=False)
    end, autopilot = Ardupilot(vehicle, Link()), peers.Ardupilot(Small().outputs, 100)
    while not vehicle.over:
        autopilot.hear(end.take(autopilot.next(), "it", 0.0))
    flight = vehicle.flight.land()
    assert flight.passed, flight


def test_the_throttle_moves_the_engine():
    given = {}
    for pulse in (1000, 2000):
        vehicle = Vehicle(scenario(), pulses=True)
        for _ in range(100):
            vehicle.fly([1500, 1500, pulse, 1500], 100)
        given[pulse] = vehicle.flight.read("engine/manifold-pressure-inhg"), vehicle.instant().airspeed_mps
    assert [setting for setting, _ in given.values()] == [10.0, 36.5]
    assert given[2000][1] > given[1000][1] + 1.0


def test_what_the_autopilot_is_told_is_one_motion():
    """In a flight that banks and climbs: position, velocity, attitude, rates and specific force agree."""
    vehicle = Vehicle(scenario(duration_s=6.0), pulses=True, rate_hz=200, ground_m=100.0)
    end, autopilot = Ardupilot(vehicle, Link()), peers.Ardupilot(Small().outputs, 200)
    seen = []
    while not vehicle.over:
        autopilot.hear(end.take(autopilot.next(), "it", 0.0))
        seen.append(vehicle.instant())
    (
        t, rates, force, attitude, airspeed, beta, qdyn, altitude, position, velocity, latitude, longitude,
        height, true_attitude,
    ) = map(np.array, zip(*seen[1:], strict=True))  # fmt: skip
    assert position[0, 2] == pytest.approx(100.0 - 1828.8, abs=0.1)
    moved = np.gradient(position, t, axis=0)[2:-2]
    assert np.allclose(moved, velocity[2:-2], atol=0.1)
    turned = np.gradient(np.unwrap(attitude[:, 0]), t)[2:-2]
    phi, theta = attitude[2:-2, 0], attitude[2:-2, 1]
    p, q, r = rates[2:-2].T
    assert np.allclose(turned, p + np.tan(theta) * (q * np.sin(phi) + r * np.cos(phi)), atol=2e-3)
    down = np.array([body_axes(*angles).T @ f for angles, f in zip(attitude, force, strict=True)])
    felt = np.gradient(velocity, t, axis=0)[2:-2] - [0.0, 0.0, 9.806]
    assert np.allclose(felt, down[2:-2], atol=0.06)  # the Earth turns, and is round
    body = np.array([body_axes(*angles) @ v for angles, v in zip(attitude, velocity, strict=True)])
    assert airspeed == pytest.approx(np.linalg.norm(velocity, axis=1), rel=1e-6)  # the air is still
    assert beta == pytest.approx(np.arcsin(body[:, 1] / airspeed), abs=1e-6)
    assert np.ptp(beta) > 1e-3
    assert qdyn == pytest.approx(0.5 * 1.0253 * airspeed**2, rel=0.01)  # at 1829 m [ISA]
    assert altitude == pytest.approx(height, abs=0.01)
    assert height == pytest.approx(100.0 - position[:, 2], abs=1e-6)
    # the geodetic radii at 45 degrees north, and height [WGS 84]
    north_m = np.radians(latitude - latitude[0]) * (6_367_382 + 1829)
    east_m = np.radians(longitude - longitude[0]) * (4_517_590 + 1293)
    moved = np.column_stack([north_m, east_m])
    np.testing.assert_allclose(moved, position[:, :2] - position[0, :2], atol=1.0)
    assert (np.abs(moved[-1]) > [200.0, 1.0]).all()
    assert np.array_equal(attitude, true_attitude)


@pytest.mark.parametrize("packets_hz", [0.0, 19.9, 4000.5])
def test_rates_beyond_the_limits_are_refused(packets_hz):
    with pytest.raises(BadInput) as refused:
        Vehicle(scenario(), pulses=True, rate_hz=packets_hz)
    says = f"frames of an autopilot at {packets_hz:g} Hz, allowed: 20 to 4000 Hz, or --rate"
    assert str(refused.value) == f"elevator-partial-loss: {says}"


def test_a_broken_gyro_breaks_what_the_autopilot_is_told():
    fault = {"type": "bias", "sensor": "q", "magnitude": 3.0, "at_s": 0.0}
    told = {}
    for name, faults in (("sound", []), ("broken", [fault])):
        vehicle = Vehicle(scenario(faults=faults), pulses=True)
        vehicle.fly([0] * 16, 100)
        told[name] = vehicle.instant().gyro
    assert np.subtract(told["broken"], told["sound"]) == pytest.approx([0, np.radians(3), 0], abs=1e-12)


def test_quaternions_and_the_standard_air():
    """q v q* turns a vector as the angles do; pressures are the tables' [ISA]."""
    angles, v = (0.3, -0.4, 2.0), np.array([1.0, -2.0, 3.0])
    w, *xyz = quaternion(*angles)
    across = np.cross(xyz, v)
    assert np.allclose(body_axes(*angles).T @ v, v + 2.0 * (w * across + np.cross(xyz, across)))
    pressures = [standard_air(altitude_m) for altitude_m in (0, 1000, 5000, 11000, 15000)]
    table = [(1013.25, 15.0), (898.75, 8.5), (540.20, -17.5), (226.32, -56.5), (120.45, -56.5)]
    assert pressures == [pytest.approx(row, rel=2e-4) for row in table]
