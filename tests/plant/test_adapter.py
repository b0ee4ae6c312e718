"""The adapter: names are checked, nothing is printed or written, a start is the state it was given."""

import pytest

from beaver_ftc.documents.errors import BadInput, BeaverFtcError, SimulationFailed
from beaver_ftc.plant.adapter import FlightState, Plant, UnknownProperty

STATE = FlightState(
    airspeed_mps=41.0,
    altitude_m=700.0,
    alpha_rad=0.15,
    beta_rad=-0.04,
    p_rad_s=0.2,
    q_rad_s=-0.1,
    r_rad_s=0.3,
    phi_rad=-0.5,
    theta_rad=0.2,
    psi_rad=2.0,
    aileron_rad=0.03,
    elevator_rad=-0.06,
    rudder_rad=0.02,
    flap_rad=0.3,
    engine_rpm=2000.0,
    manifold_pressure_inhg=23.0,
)
WHERE = {
    "airspeed_mps": ("velocities/vt-fps", 0.3048),
    "altitude_m": ("position/h-sl-ft", 0.3048),
    "alpha_rad": ("aero/alpha-rad", 1),
    "beta_rad": ("aero/beta-rad", 1),
    "p_rad_s": ("velocities/p-rad_sec", 1),
    "q_rad_s": ("velocities/q-rad_sec", 1),
    "r_rad_s": ("velocities/r-rad_sec", 1),
    "phi_rad": ("attitude/phi-rad", 1),
    "theta_rad": ("attitude/theta-rad", 1),
    "psi_rad": ("attitude/psi-rad", 1),
    "aileron_rad": ("fcs/aileron-effective-rad", 1),
    "elevator_rad": ("fcs/elevator-effective-rad", 1),
    "rudder_rad": ("fcs/rudder-effective-rad", 1),
    "flap_rad": ("fcs/flap-effective-rad", 1),
    "engine_rpm": ("engine/speed-rpm", 1),
    "manifold_pressure_inhg": ("engine/manifold-pressure-inhg", 1),
}


def test_a_start_is_the_state_it_was_given():
    plant = Plant(rate_hz=100)
    plant.start(STATE)
    found = {name: plant.read(node) * factor for name, (node, factor) in WHERE.items()}
    assert found == pytest.approx(STATE.as_dict(), rel=1e-12, abs=1e-12)
    assert plant.read("simulation/sim-time-sec") == 0
    assert plant.read("position/lat-geod-deg") == pytest.approx(45, abs=1e-9)


def test_a_second_start_forgets_the_first_flight(trim_point):
    fresh, flown = Plant(rate_hz=100), Plant(rate_hz=100)
    flown.start(trim_point)
    flown.write("fcs/elevator-cmd-rad", 0.1)
    for _ in range(300):
        flown.run()
    trajectories = []
    for plant in (fresh, flown):
        plant.start(STATE)
        for _ in range(100):
            plant.run()
        trajectories.append([plant.read(node) for node, _ in WHERE.values()])
    assert trajectories[1] == pytest.approx(trajectories[0], rel=1e-9, abs=1e-9)


def test_accelerations_after_a_start_belong_to_the_state():
    """Another look at the same state changes nothing: the rate of sideslip and the force it makes agree."""
    plant = Plant(rate_hz=100)
    plant.start(STATE)
    names = [f"accelerations/{axis}dot-ft_sec2" for axis in "uvw"] + ["aero/betadot-rad_sec"]
    first = [plant.read(name) for name in names]
    plant.settle()
    assert [plant.read(name) for name in names] == pytest.approx(first, abs=1e-11)


@pytest.mark.parametrize(("rate_hz", "substeps"), [(100, 1), (50, 4), (1000, 1)])
def test_a_run_is_one_jsbsim_frame(rate_hz, substeps):
    plant = Plant(rate_hz=rate_hz, substeps=substeps)
    plant.start(STATE)
    for _ in range(substeps * rate_hz):
        plant.run()
    assert plant.read("simulation/sim-time-sec") == pytest.approx(1.0, abs=1e-9)


def test_a_misspelt_property_raises_and_is_not_created():
    plant = Plant(rate_hz=100)
    for _ in range(2):
        with pytest.raises(UnknownProperty, match="fcs/elevater-cmd-rad"):
            plant.write("fcs/elevater-cmd-rad", 0.1)
    assert issubclass(UnknownProperty, BeaverFtcError)


def test_nothing_is_printed_or_written(capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plant = Plant(rate_hz=100)
    plant.start(STATE)
    for _ in range(50):
        plant.run()
    del plant
    assert capfd.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == []


def test_an_aircraft_that_cannot_be_loaded_is_one_clear_line(capfd, tmp_path):
    broken = tmp_path / "broken.xml"
    broken.write_text("<fdm_config><metrics></fdm_config>")
    with pytest.raises(BadInput, match=r"/broken.xml:1: is no XML .mismatched tag.+, allowed: a JSB"):
        Plant(rate_hz=100, model=broken)
    broken.write_text("<fdm_config/>")
    with pytest.raises(SimulationFailed, match=r"^JSBSim cannot load .+/broken.xml: .*No metrics") as caught:
        Plant(rate_hz=100, model=broken)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")
