"""From the ground and back: at rest on the wheels, a circuit under the small autopilot, what is refused."""

import numpy as np
import pytest
from tools.autopilots import peers
from tools.autopilots.circuit import Circuit

import beaver_ftc as bf
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.loop import fly
from beaver_ftc.plant.adapter import FlightState, Plant, body_axes
from beaver_ftc.plant.ground import lay
from beaver_ftc_links.sitl.ardupilot import Ardupilot
from beaver_ftc_links.sitl.link import Link
from beaver_ftc_links.sitl.mavlink import Mavlink
from beaver_ftc_links.sitl.px4 import Px4
from beaver_ftc_links.sitl.telling import Teller
from beaver_ftc_links.sitl.vehicle import Flown, Vehicle

NOTHING = [0] * 16
G_MPS2 = 9.806  # at 45 N, as JSBSim's Earth has it
WEIGHT_N = 2288.231 * G_MPS2
N_PER_LBF = 4.4482216152605


def scenario(altitude_m=300.0, **keys):
    given = {"expect": {}, "duration_s": 150.0, "initial.on_ground": True, "initial.altitude_m": altitude_m}
    return bf.load("fault-free").with_(given | keys)


def forces_n(sim):
    return [N_PER_LBF * sim.read(f"forces/fb{axis}-gear-lbs") for axis in "xyz"]


@pytest.mark.parametrize("altitude_m", [-200.0, 0.0, 100.0, 101.0, 2000.0])
def test_it_stands_where_the_ground_is_and_does_not_move(altitude_m):
    """The wheels carry the weight; accelerometers feel gravity alone; in five seconds nothing moves."""
    vehicle = Vehicle(scenario(altitude_m), pulses=True)
    first = vehicle.instant()
    for _ in range(500):
        vehicle.fly(NOTHING, 100)
    last = vehicle.instant()
    assert np.abs(np.subtract(last.position, first.position)).max() < 2e-3
    assert last.height_m == pytest.approx(altitude_m + 1.65, abs=0.02)
    down = body_axes(*last.attitude).T @ last.force
    assert down == pytest.approx([0.0, 0.0, -G_MPS2], abs=0.02)  # the Earth turns
    assert np.linalg.norm(forces_n(vehicle.flight)) == pytest.approx(WEIGHT_N, rel=2e-3)
    assert np.degrees(last.attitude[1]) == pytest.approx(11.5, abs=0.2)


def test_the_wheels_carry_what_the_lever_says():
    """Moments about the main wheels' line: the tail carries weight times its share of the wheelbase."""
    vehicle = Vehicle(scenario(), pulses=True)
    vehicle.fly(NOTHING, 100)
    sim = vehicle.flight
    tail_n = 43_000 * 0.3048 * sim.read("gear/unit[2]/compression-ft")
    pitch = vehicle.instant().attitude[1]
    ahead = 0.53 * np.cos(pitch) + (1.908 - 0.12) * np.sin(pitch)  # of the main wheels, along the ground
    assert tail_n == pytest.approx(WEIGHT_N * ahead / 6.94, rel=0.03)


def test_in_the_air_the_ground_adds_nothing():
    """To the bit, inside the validated speeds; it is laid out in the one flight, not in the other."""
    flown, level = scenario(altitude_m=500.0).with_({"initial.on_ground": None, "duration_s": 3.0}), 0.02
    over, without = Flown(flown), bf.Simulation(flown)
    for k in range(150):
        command = over.trim_rad + level * np.sin(0.1 * k)
        over.pilot(1, command, None)
        without.step(command)
    assert over.read("ground/present") == 1.0
    assert np.array_equal(over.log.to_numpy(), without.log.to_numpy(), equal_nan=True)


def thrust_n(airspeed_mps):
    """Of the terms and below 30 m/s of the ground's, by JSBSim at sea level; the power, W, and what of it the
    terms' efficiency leaves."""
    plant = Plant(rate_hz=100)
    lay(plant, 0.0)
    plant.start(FlightState(airspeed_mps, 100.0))
    pressure = plant.read("aero/qbar-psf") * plant.read("metrics/Sw-sqft")
    terms = N_PER_LBF * pressure * (plant.read("aero/coefficient/CX_dpt") - 0.1161 * 0.08696)
    return terms + plant.read("ground/thrust-n"), 515.6 * plant.read("engine/power-kw")


def test_thrust_at_rest_is_what_momentum_gives_and_meets_the_terms():
    """Static thrust T of T^3 = 2 rho A P^2; with rising speed P / V, without a step where the terms take over
    at 30 m/s."""
    at_rest, power_w = thrust_n(0.0)
    assert at_rest**3 == pytest.approx(2 * 1.213 * 5.273 * power_w**2, rel=5e-3)
    for airspeed_mps in (25.0, 29.999, 30.001, 40.0):
        thrust, power_w = thrust_n(airspeed_mps)
        assert thrust == pytest.approx(power_w / airspeed_mps, rel=1e-3)


def flown_by_ardupilot(vehicle, pilot, hz, until):
    end, autopilot = Ardupilot(vehicle, Link()), peers.Ardupilot(pilot, hz)
    while not (vehicle.over or until(vehicle)):
        autopilot.hear(end.take(autopilot.next(), "it", 0.0))


def flown_by_px4(vehicle, pilot, hz, until):
    end = Px4(vehicle, Link(), Mavlink(), None)
    autopilot = peers.Px4(pilot, silent=3, armed_after=10)
    sent = end.connect(0.0)
    for _ in range(3):
        assert autopilot.hear(sent) == b""
        sent = end.tick(1.0 + vehicle.instant().t_s, 0.0)
    while not (vehicle.over or until(vehicle)):
        sent = end.take(autopilot.hear(sent), 0.0)


@pytest.mark.parametrize("over", [flown_by_ardupilot, flown_by_px4])
def test_the_small_autopilot_takes_off_climbs_turns_and_lands(over):
    """With a fault in flight: nothing is found on the ground or at take-off, the fault is, and its name
    stands once the aircraft is down."""
    fault = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.3, "at_s": 75.0}
    vehicle = Vehicle(scenario(faults=[fault]), over is flown_by_ardupilot, rate_hz=50)
    pilot, teller, seen, said = Circuit(turn_deg=90.0), Teller(), [], []

    def fly(told):
        outputs = pilot.outputs(told)
        seen.append((pilot.phase, told.t_s, told.attitude[2]))
        said.extend(teller.news(vehicle.flight))
        return outputs

    over(vehicle, fly, 50, lambda flown: pilot.phase == "stop" and flown.instant().airspeed_mps < 34.0)
    sim, phases = vehicle.flight, list(dict.fromkeys(phase for phase, _, _ in seen))
    assert phases == ["roll", "climb", "turn", "descend", "flare", "stop"]
    assert not sim.departed
    assert max(forces_n(sim), key=abs) < -1000.0
    up_s = next(t_s for phase, t_s, _ in seen if phase == "climb")
    assert sim.listens_from_s == pytest.approx(up_s, abs=10.0)
    texts = [text for _, _, text in said]
    assert texts[:3] == ["FDI: listening", "FDI: alarm on q", "FDI: elevator, loss of effectiveness"]
    document = sim.land().metrics
    assert (document["false_alarm"], document["isolation"]["fault"]) == (False, "elevator")
    assert document["detection"]["delay_s"] < 0.1
    assert not sim._diagnoses


def test_what_cannot_begin_on_the_ground():
    base = scenario()
    with pytest.raises(
        BadInput, match=r"initial\.on_ground: no law of ours takes off, allowed: false, or an"
    ):
        fly(base)
    with pytest.raises(BadInput, match=r"initial\.on_ground: no law of ours takes off"):
        bf.Simulation(base)
    with pytest.raises(BadInput, match="--hold has no meaning on the ground"):
        Vehicle(base, pulses=True, hold_s=2.0)
    with pytest.raises(BadInput, match="--ground has no meaning on the ground"):
        Vehicle(base, pulses=True, ground_m=2.0)
    with pytest.raises(BadInput, match=r"fdi\.scheme: no plug-in knows that begins in flight"):
        Vehicle(base.with_({"fdi.scheme": "rls-monitor"}), pulses=True)
    low = base.with_({"initial.on_ground": None})
    with pytest.raises(
        BadInput, match=r"altitude_m: 300 is at or below the ground at 299, allowed: above 305\.65,"
    ):
        Vehicle(low, pulses=True, ground_m=299.0)
