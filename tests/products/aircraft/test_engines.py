"""Engines as effectors: their column of G is arm times thrust over inertia; they take the slow part of what
surfaces leave; a transport without ailerons and rudder keeps its heading by them, and by nothing else."""

from xml.etree import ElementTree

import numpy as np
import pytest
import yaml

import beaver_ftc as bf
from beaver_ftc.aircraft.aircraft import read
from beaver_ftc.control import engines
from beaver_ftc.control.power import POWER, move_differences
from beaver_ftc.control.state import control_dtype
from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.instrumented import source_of
from beaver_ftc.plant.trim import trim
from beaver_ftc.scenario.declared import Declared
from beaver_ftc_aircraft.derive.derivation import derive
from products.aircraft.derive.foreign import quickly

M_PER_IN, N_PER_LBF = 0.0254, 4.4482216
DT, YAW = 0.01, 2


@pytest.fixture(scope="module")
def jet(tmp_path_factory):
    """The 737 with its engines as effectors, in a folder beside a scenario."""
    folder = tmp_path_factory.mktemp("engines")
    with quickly(1000, 400):
        derive("jsbsim:737", folder / "aircraft", engines=True)
    return folder


def scenario(folder, **keys):
    path = folder / "flight.yaml"
    path.write_text(yaml.safe_dump({"name": "flight", "aircraft": "./aircraft/737", "duration_s": 1, **keys}))
    return bf.load(str(path))


def test_the_arms_are_those_of_the_model_file(jet):
    """Of each engine: beside the centre of gravity, by its place in JSBSim's own file."""
    places = ElementTree.parse(source_of("737")).findall("propulsion/engine/thruster/location")
    found = read(jet / "aircraft" / "737").effectors.values()
    for place, of in zip(places, found, strict=True):
        assert of.right_m == pytest.approx(float(place.findtext("y")) * M_PER_IN, abs=0.01)
        assert of.share == pytest.approx(0.5, abs=1e-3)


def test_the_column_is_arm_times_thrust_over_inertia(jet):
    """As JSBSim turns: the thrust of each engine is read at its place, not from our signals. The designer's
    inertia in yaw is twice that of the file."""
    aircraft = read(jet / "aircraft" / "737")
    plant = Plant(100, aircraft=aircraft)
    B = engines.effects_of_engines(Declared.of(scenario(jet, design_model={"inertia": {"Iz": 2}})))
    point = trim(aircraft.usual_airspeed_mps, 1500.0, plant=plant, throttle=0.6)
    seen = []
    for difference in (0.0, 0.15):
        plant.start(point)
        for e, way in enumerate((1.0, -1.0)):
            plant.write(f"fcs/actuated-throttle-{e}-difference", way * difference)
        for _ in range(600):
            plant.hold(point)
            plant.run()
        thrust_n = [plant.read(f"propulsion/engine[{e}]/thrust-lbs") * N_PER_LBF for e in range(2)]
        seen.append((*thrust_n, plant.read("accelerations/rdot-rad_sec2")))
    left, right, turned = np.subtract(seen[1], seen[0])
    per_n = 2 * B[YAW] / (aircraft.mass.mass_kg * 0.5)
    assert per_n[0] == pytest.approx(4.902 / aircraft.mass.Iz_kg_m2, rel=2e-3)
    assert turned == pytest.approx(per_n[0] * left + per_n[1] * right, rel=0.02)


def records(jet, lag_s):
    """What the law of the jet keeps, its rudder given up; the engines' table is a straight line."""
    control = np.zeros(1, control_dtype(3)).view(np.recarray)[0]
    engines.configure_engines(control["engines"], Declared.of(scenario(jet, rate_hz=100)))
    control["engines"]["config"]["integral_gain"] = DT / (2.0 * lag_s)
    control["power"] = np.zeros(1, POWER)[0]
    control["power"]["output"]["command"][0] = 0.5
    control["layout"]["main"], control["layout"]["authority"] = (0, 1, 2), np.eye(3)
    control["surfaces"]["output"]["effectiveness"], control["surfaces"]["config"]["least_effectiveness"] = (
        (1, 1, 0),
        0.1,
    )
    return control


def answer(control, demand, lag_s, frames):
    """The yaw acceleration (frames,) that engines with a lag give for a constant demand, rad/s2."""
    given, out, parts, power = 0.0, np.empty(frames), control["engines"], control["power"]
    config = parts["config"]
    for k in range(frames):
        control["axes"]["shortfall"][YAW] = demand - given
        engines.steer_by_engines(control, 139.0)
        move_differences(power, parts["output"]["difference"], config["n"], config["step"])
        given += DT / lag_s * (float(parts["memory"]["wanted"][YAW]) - given)
        out[k] = given
    return out


def test_they_take_the_slow_part_damped_by_0_7(jet):
    """The closed form's overshoot of a second-order step is 4.3 % at a damping of 1 / sqrt 2."""
    control, lag_s, demand = records(jet, 1.0), 1.0, 0.01
    given = answer(control, demand, lag_s, 1500)
    assert given.max() / demand == pytest.approx(1.0 + np.exp(-np.pi), abs=2e-3)
    assert given[-1] == pytest.approx(demand, rel=1e-3)
    moved = control["power"]["output"]["command"][1:3]
    assert moved[0] > 0.0 > moved[1]  # left forward turns right
    table = control["engines"]["memory"]["problem"]["u"][:2]
    assert table.sum() == pytest.approx(0.0, abs=1e-9)  # and the airspeed stays


def test_what_they_cannot_give_is_not_integrated(jet):
    """Beyond reach they stand at their limit, and leave it as soon as the demand comes back."""
    control = records(jet, 1.0)
    given = answer(control, 1.0, 1.0, 1500)
    most = float(control["engines"]["output"]["authority"][1, YAW])
    assert given[-1] == pytest.approx(most, rel=1e-3)
    back = answer(control, -most, 1.0, 400)
    assert back[-1] < 0.0


def lost(surface):
    return {"actuator": surface, "type": "loss_of_effectiveness", "magnitude": 1.0, "at_s": 20}


def test_a_transport_without_ailerons_and_rudder_is_turned_by_its_engines(jet):
    keys = {
        "duration_s": 150,
        "autopilot": {
            "altitude_m": [{"hold": True}],
            "airspeed_mps": [{"hold": True}],
            "heading_deg": [{"hold": True}, {"at_s": 80, "value": 15}],
        },
        "faults": [lost("aileron"), lost("rudder")],
        "fdi": {"fault_class": "all"},
    }
    held = bf.fly(scenario(jet, **keys))
    without = bf.fly(scenario(jet, **keys, control={"power": {"enabled": False}}))
    assert np.degrees(held.log["psi_rad"].iloc[-1]) == pytest.approx(15.0, abs=3.0)
    off = (np.degrees(without.log["psi_rad"].iloc[-1]) - 15.0 + 180.0) % 360.0 - 180.0
    assert abs(off) > 10.0
    assert held.metrics["authority"]["r"]["engines_greatest_rad_s2"] > 0.0


def test_engines_together_hold_the_altitude_of_a_jammed_elevator(jet):
    keys = {
        "duration_s": 200,
        "autopilot": {"altitude_m": [{"hold": True}], "airspeed_mps": [{"hold": True}]},
        "faults": [{"actuator": "elevator", "type": "stuck", "at_s": 20}],
        "fdi": {"fault_class": "all"},
    }
    held = bf.fly(scenario(jet, **keys))
    without = bf.fly(scenario(jet, **keys, control={"power": {"enabled": False}}))
    later_m = [np.ptp(flight.log["altitude_m"].iloc[10_000:]) for flight in (held, without)]
    assert later_m[0] < 0.2 * later_m[1]  # the phugoid has died out
    together = held.log[["engine_1_difference", "engine_2_difference"]].to_numpy()
    assert np.corrcoef(together.T)[0, 1] > 0.99


@pytest.mark.parametrize("fault_class", ["published", "all"])
def test_an_engine_that_fails_is_no_surface(jet, fault_class):
    """It goes to idle, as JSBSim's own thrust says, turns the aircraft, and is outside every class."""
    keys = {"duration_s": 25, "fdi": {"fault_class": fault_class, "statistical": {}}}
    flight = bf.fly(scenario(jet, **keys, faults=[{"type": "damage", "case": "engine_1-at-idle", "at_s": 5}]))
    thrust, turning = (flight.log[name].to_numpy() for name in ("thrust", "engines_n"))
    assert thrust[-1] < 0.7 * thrust[400]
    assert abs(turning[-1] - turning[400]) > 0.2 * thrust[400] * 4.902 / 28.88 / 2.0
    assert flight.metrics["isolation"]["fault"] == "unanticipated"
    assert flight.metrics["detection"]["delay_s"] < 0.3
    assert flight.metrics["isolation"]["candidates"] == []


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d: d["effectors"]["engine_1"].update(share=0.9), "shares add up to more than 1"),
        (lambda d: d["engine"].pop("thrust"), "allowed: with engine.thrust"),
        (lambda d: d["effectors"]["engine_1"].pop("throttle"), "throttle"),
    ],
)
def test_a_wrong_file_is_refused_in_a_line(jet, tmp_path, change, says):
    data = yaml.safe_load((jet / "aircraft" / "737" / "aircraft.yaml").read_text())
    change(data)
    (tmp_path / "aircraft.yaml").write_text(yaml.safe_dump(data))
    with pytest.raises(ScenarioError, match=says):
        read(tmp_path)
