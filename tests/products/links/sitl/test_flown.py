"""The flight under an autopilot: as in process, at any rate of packets, its faults and its instant."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from tools.autopilots import peers
from tools.autopilots.small import Small

import beaver_ftc as bf
from beaver_ftc.design import standard_air
from beaver_ftc.diagnosis.rivals.rls import RlsMonitor
from beaver_ftc.documents.errors import BadInput
from beaver_ftc_links.sitl.ardupilot import Ardupilot
from beaver_ftc_links.sitl.link import Link
from beaver_ftc_links.sitl.px4 import quaternion, rotation
from beaver_ftc_links.sitl.vehicle import Flown, Vehicle, at_rate, without_reference

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


@pytest.mark.parametrize("noisy", [False, True])
def test_recorded_packets_fly_what_the_same_commands_fly_in_process(noisy):
    """To the bit; with a fault of a surface and one of an instrument, turbulence, sensors and servos."""
    keys = {
        "faults": [
            {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.4, "at_s": 0.5},
            {"type": "bias", "sensor": "p", "magnitude": 2.0, "at_s": 0.8},
        ]
    }
    if noisy:
        keys |= {
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


def test_a_plug_in_sees_whole_frames_however_they_are_flown():
    flown = at_rate(scenario(duration_s=0.5), 100).with_({"substeps": 4})
    whole, parts = (Flown(flown, detector=RlsMonitor()) for _ in range(2))
    for k in range(40):
        command = whole.trim_rad + 0.01 * np.sin(k)
        whole.pilot(4, command, None)
        for runs in (1, 2, 1):
            parts.pilot(runs, command, None)
    assert np.array_equal(whole.log.to_numpy(), parts.log.to_numpy(), equal_nan=True)


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


def test_packets_inside_a_frame_see_the_truth_move():
    vehicle = Vehicle(scenario(), pulses=True)
    vehicle.begin(1200)
    seen = []
    for _ in range(12):
        vehicle.fly([2000, 1500, 0, 1500], 1200)
        seen.append(vehicle.instant())
    times = [now.t_s for now in seen]
    assert times == pytest.approx([k / 1200 for k in range(1, 13)])
    rolling = [now.gyro[0] for now in seen]
    assert all(later > earlier for earlier, later in pairwise(rolling[2:]))


def test_another_rate_in_flight_is_followed_where_it_is_whole_and_counted_where_not():
    vehicle = Vehicle(scenario(), pulses=True)
    vehicle.begin(100)
    for rate_hz, t_s in ((100, 0.01), (50, 0.03), (101, 0.04), (0, 0.05), (25, 0.09)):
        vehicle.fly([0] * 16, rate_hz)
        assert vehicle.instant().t_s == pytest.approx(t_s)
    assert vehicle.off_rate == 2


def test_a_rate_that_is_said_counts_whatever_the_packets_say():
    vehicle = Vehicle(scenario(), pulses=True, rate_hz=200)
    vehicle.begin(1200)
    vehicle.fly([0] * 16, 1200)
    assert vehicle.instant().t_s == pytest.approx(0.005)
    assert vehicle.off_rate == 1


@pytest.mark.parametrize("packets_hz", [10, 5000])
def test_rates_that_cannot_be_flown(packets_hz):
    with pytest.raises(BadInput, match=f"at {packets_hz} Hz, allowed: 20 to 4000 Hz, or --rate"):
        at_rate(scenario(), packets_hz)


def test_a_flight_begun_anew_is_the_first_one_again():
    packets, _ = recorded(60, 100)
    vehicle = Vehicle(scenario(), pulses=True)
    first = flown_by(vehicle, packets)
    second = flown_by(vehicle, packets)
    assert np.array_equal(first.to_numpy(), second.to_numpy(), equal_nan=True)


def test_the_law_flies_until_the_autopilot_may():
    vehicle = Vehicle(scenario(), pulses=True, hold_s=0.2)
    vehicle.begin(100)
    for _ in range(60):
        vehicle.fly([2000, 1500, 0, 1500], 100)
    log = vehicle.flight.land().log
    own = log["t_s"] < 0.2 + 1e-9  # the command computed at 0.2 s is in force from the next frame on
    assert (log["aileron_cmd_rad"][own] > -0.5).all()
    assert (log["aileron_cmd_rad"][~own & (log["t_s"] < 0.58)] == -0.52).all()


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
    t, position, velocity, rates, attitude, force = (
        np.array([getattr(now, name) for now in seen[1:]])
        for name in ("t_s", "position", "velocity", "gyro", "attitude", "force")
    )
    assert position[0, 2] == pytest.approx(100.0 - 1828.8, abs=0.1)
    moved = np.gradient(position, t, axis=0)[2:-2]
    assert np.allclose(moved, velocity[2:-2], atol=0.1)
    turned = np.gradient(np.unwrap(attitude[:, 0]), t)[2:-2]
    phi, theta = attitude[2:-2, 0], attitude[2:-2, 1]
    p, q, r = rates[2:-2].T
    assert np.allclose(turned, p + np.tan(theta) * (q * np.sin(phi) + r * np.cos(phi)), atol=2e-3)
    down = np.array([rotation(*angles).T @ f for angles, f in zip(attitude, force, strict=True)])
    felt = np.gradient(velocity, t, axis=0)[2:-2] - [0.0, 0.0, 9.806]
    assert np.allclose(felt, down[2:-2], atol=0.06)  # the Earth turns, and is round
    airspeed, beta, qdyn, altitude, latitude, longitude, height = (
        np.array([getattr(now, name) for now in seen[1:]])
        for name in (
            "airspeed_mps", "beta_rad", "qdyn_pa", "altitude_m", "latitude_deg", "longitude_deg", "height_m",
        )
    )  # fmt: skip
    body = np.array([rotation(*angles) @ v for angles, v in zip(attitude, velocity, strict=True)])
    assert airspeed == pytest.approx(np.linalg.norm(velocity, axis=1), rel=1e-6)  # the air is still
    assert beta == pytest.approx(np.arcsin(body[:, 1] / airspeed), abs=1e-6)
    assert np.ptp(beta) > 1e-3
    assert qdyn == pytest.approx(0.5 * 1.0253 * airspeed**2, rel=0.01)  # at 1829 m [ISA]
    assert altitude == pytest.approx(height, abs=0.01)
    assert height == pytest.approx(100.0 - position[:, 2], abs=1e-6)
    # the geodetic radii at 45 degrees north, and height [WGS 84]
    assert np.radians(latitude - latitude[0]) * (6_367_382 + 1829) == pytest.approx(
        position[:, 0] - position[0, 0], abs=1.0
    )
    assert np.radians(longitude - longitude[0]) * (4_517_590 + 1293) == pytest.approx(
        position[:, 1] - position[0, 1], abs=1.0
    )
    assert position[-1, 0] > 200.0
    assert np.abs(position[-1, 1]) > 1.0
    assert np.array_equal(attitude, [now.true_attitude for now in seen[1:]])


def test_every_instrument_that_is_told_is_told_with_its_own_error():
    """Eleven of them, each with a bias of another size; what none of them measures stays true."""
    biases = {
        "p": 0.5, "q": -0.75, "r": 1.25, "phi": 2.0, "theta": -1.5, "psi": 3.0, "beta": 0.8, "ax": 0.11,
        "ay": -0.13, "az": 0.17, "V": 1.7, "qdyn": 40.0, "altitude": 7.0,
    }  # fmt: skip
    found = []
    for size in (0.0, 1.0):
        faults = [
            {"type": "bias", "sensor": name, "magnitude": size * bias, "at_s": 0.0}
            for name, bias in biases.items()
        ]
        vehicle = Vehicle(scenario(faults=faults if size else faults[:0]), pulses=True)
        vehicle.fly([0] * 16, 100)
        found.append(vehicle.instant())
    sound, broken = found
    differences = {name: np.subtract(getattr(broken, name), getattr(sound, name)) for name in sound._fields}
    degrees = {name: np.radians(biases[name]) for name in ("p", "q", "r", "phi", "theta", "psi", "beta")}
    expected = {
        "t_s": 0.0, "gyro": [degrees[name] for name in "pqr"], "force": [0.11, -0.13, 0.17],
        "attitude": [degrees[name] for name in ("phi", "theta", "psi")], "airspeed_mps": 1.7,
        "beta_rad": degrees["beta"], "qdyn_pa": 40.0, "altitude_m": 7.0, "position": [0.0] * 3,
        "velocity": [0.0] * 3, "latitude_deg": 0.0, "longitude_deg": 0.0, "height_m": 0.0,
        "true_attitude": [0.0] * 3,
    }  # fmt: skip
    assert {name: difference.tolist() for name, difference in differences.items()} == {
        name: pytest.approx(value, abs=1e-9) for name, value in expected.items()
    }


@pytest.mark.parametrize(
    ("substeps", "packets_hz", "rate_hz", "flown"),
    [
        (1, 20, 20, 1), (1, 400, 400, 1), (5, 100, 100, 5), (1, 401, 200.5, 2), (3, 800, 400, 4),
        (4, 1200, 400, 6), (2, 1000, 1000 / 3, 3), (1, 4000, 400, 10), (10, 4000, 400, 10),
        (11, 4000, 400, 20),
    ],
)  # fmt: skip
def test_fast_packets_are_a_whole_part_of_a_frame_of_the_diagnosis(substeps, packets_hz, rate_hz, flown):
    """No more than 400 Hz, and as many steps of the model as asked for, or more."""
    given = scenario(
        substeps=substeps,
        **{
            "control.law": "lqr",
            "reference": {"p": [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.25}}]},
        },
    )
    found = at_rate(given, packets_hz)
    assert (found.rate_hz, found.substeps) == (pytest.approx(rate_hz), flown)
    assert (found.control.law, found.control.options) == ("nominal", {})
    assert found.reference == scenario().reference
    assert found.faults == given.faults


@pytest.mark.parametrize("packets_hz", [19.9, 4000.5])
def test_rates_beyond_the_limits_are_refused(packets_hz):
    with pytest.raises(BadInput) as refused:
        at_rate(scenario(), packets_hz)
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


def test_what_only_our_law_can_be_asked_for_is_left_out():
    base = bf.load("elevator-partial-loss")
    left, said = without_reference(base)
    assert said == ["expect.post_fault_rms_deg_s is left out: the reference is the autopilot's own"]
    assert left.expect.post_fault_rms_deg_s is None
    assert left.expect.isolated_as == "elevator"
    with pytest.raises(BadInput, match="changes: there are none under an autopilot, allowed: faults"):
        without_reference(base.with_({"changes": [{"at_s": 5, "law": "lqr"}]}))


def test_quaternions_and_the_standard_air():
    """The rotation by the quaternion is that of the angles; pressures are the tables' [ISA]."""
    angles = 0.3, -0.4, 2.0
    w, x, y, z = quaternion(*angles)
    to_earth = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    assert np.allclose(rotation(*angles).T, to_earth)
    pressures = [standard_air(altitude_m) for altitude_m in (0, 1000, 5000, 11000, 15000)]
    table = [(1013.25, 15.0), (898.75, 8.5), (540.20, -17.5), (226.32, -56.5), (120.45, -56.5)]
    assert pressures == [pytest.approx(row, rel=2e-4) for row in table]
