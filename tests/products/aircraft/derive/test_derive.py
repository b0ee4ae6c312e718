"""Aircraft nobody wrote by hand: derived from JSBSim, flown with the measured error as the bound."""

import hashlib
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tools.autopilots import peers
from tools.autopilots.small import Small

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.aircraft import derived_folder, first_line, read
from beaver_ftc.design.model import DesignFunctions, design_record
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.documents.files import data_root
from beaver_ftc.loop.loop import fly
from beaver_ftc.plant import instrumented
from beaver_ftc.plant.adapter import Plant, bare
from beaver_ftc.plant.model_file import copy_of
from beaver_ftc.plant.trim import trim as trim_plant
from beaver_ftc.scenario.airframe import find_aircraft
from beaver_ftc.scenario.schema import load_text
from beaver_ftc_aircraft.derive import derivation, first_use
from beaver_ftc_aircraft.derive.derivation import derive, source_of, try_out
from beaver_ftc_aircraft.derive.fit import errors_of
from beaver_ftc_aircraft.derive.outline import not_affine, usual_start
from beaver_ftc_aircraft.derive.sample import SIDESLIP_RAD, Envelope, sample
from beaver_ftc_links.sitl.ardupilot import Ardupilot
from beaver_ftc_links.sitl.link import Link
from beaver_ftc_links.sitl.vehicle import Vehicle
from trainer import TRAINER

from .foreign import quickly

FLIGHT = """
name: derived
aircraft: ./NAME
duration_s: 20
reference:
  p: [{sine: {amplitude_deg_s: 2, frequency_hz: 0.25}}]
  q: [{sine: {amplitude_deg_s: 2, frequency_hz: 0.2}}]
  r: [{sine: {amplitude_deg_s: 1, frequency_hz: 0.3}}]
"""


@pytest.fixture(scope="module", params=["c172p", pytest.param("737", marks=pytest.mark.nightly)])
def derived(request, tmp_path_factory):
    """The aircraft, its trim, a folder that has it, its name: derived once, whichever test flies it first."""
    find_aircraft(f"jsbsim:{request.param}")
    folder = tmp_path_factory.mktemp("derived")
    shutil.copytree(derived_folder(request.param), folder / request.param)
    aircraft = read(folder / request.param)
    trim = trim_plant(plant=Plant(100, aircraft=aircraft), **usual_start(aircraft))
    return SimpleNamespace(aircraft=aircraft, trim=trim), folder, request.param


@pytest.fixture(scope="module")
def unseen(derived):
    """A third set of states, and the aircraft."""
    made, _, _ = derived
    aircraft = made.aircraft
    of = aircraft.envelope
    envelope = Envelope(of.airspeed_mps, aircraft.alpha_rad, SIDESLIP_RAD, of.altitude_m)
    properties = {name: signal.property for name, signal in aircraft.signals.items()}
    return sample(Plant(100, aircraft=aircraft), envelope, made.trim, 1000, 77, properties, (0,)), aircraft


@pytest.fixture
def quick():
    with quickly(1500, 500):
        yield


@pytest.fixture(scope="module")
def again(tmp_path_factory):
    """The built-in aircraft derived from its model, in a folder."""
    folder = tmp_path_factory.mktemp("again")
    with quickly(1500, 500):
        return derive("beaver", folder), folder


def values(aircraft):
    """Coefficients by what they multiply, whatever they are called."""
    return {(t.coefficient, *sorted(t.factors)): t.value for t in aircraft.moments if t.value}


def flight(derived, **changes):
    _, folder, name = derived
    return fly(load_text(FLIGHT.replace("NAME", name), folder=folder).with_(changes))


def test_in_a_dive_beyond_what_was_measured_the_statistical_test_concludes_nothing(derived):
    dive = {"q": [{"ramp": {"amplitude_deg_s": -8, "start_s": 0, "end_s": 8}}]}
    fdi = {"statistical": {}, "authority": "statistical"}
    changes = {"duration_s": 20, "rate_hz": 50, "substeps": 2, "actuators": "servo"}
    dived = flight(derived, reference=dive, fdi=fdi, **changes)
    assert dived.detection_time_s is None
    assert dived.statistical["closest_approach"] < 1.0


def test_the_declared_error_holds_on_states_neither_fit_nor_check_has_seen(unseen):
    """Box by box and share by share of the travel: none exceeds what a search for the worst has found."""
    seen, aircraft = unseen
    errors, error_map = errors_of(aircraft, seen), aircraft.file.model_error_map
    rows = [[getattr(box, f"error_{axis}_rad_s2")[0] for axis in "pqr"] for box in error_map.boxes]
    declared = np.array(rows)[seen.box, :, seen.level]
    assert (errors <= declared).all()
    assert ((errors / declared).max(axis=0) > 0.3).all(), "the bound is loose"


def test_the_error_is_that_of_the_evaluator_that_flies(unseen):
    """The error is measured with one evaluator and flown with another: they agree to rounding."""
    seen, aircraft = unseen
    model = DesignFunctions(design_record(aircraft))
    y = np.column_stack([seen.y, *(seen.signals[name] for name in aircraft.signals)])
    for k in range(0, len(seen), 97):
        believed = model.f(seen.x[k], y[k]) + model.G(y[k]) @ seen.u[k]
        assert np.abs(believed - seen.rate[k]) == pytest.approx(errors_of(aircraft, seen)[k], abs=1e-9)


def test_a_healthy_flight_raises_no_alarm(derived):
    healthy = flight(derived)
    assert healthy.detection_time_s is None
    assert healthy.departure is None
    assert max(healthy.pre_fault_rms_rad_s) < np.radians(0.2)


@pytest.mark.parametrize("surface", ["aileron", "elevator", "rudder"])
def test_a_loss_is_found_and_named_rightly(derived, surface):
    loss = {"actuator": surface, "type": "loss_of_effectiveness", "magnitude": 0.8, "at_s": 8}
    faulty = flight(derived, faults=[loss])
    assert faulty.detection_time_s >= 8.0
    assert faulty.isolated == surface
    assert faulty.departure is None


def under_an_autopilot(folder, name):
    """A flight under the small one, in which half of the elevator goes."""
    fault = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.5, "at_s": 3}
    expect = {
        "isolated_as": "elevator",
        "detected_within_s": 0.5,
        "no_false_alarm": True,
        "no_departure": True,
    }
    scenario = load_text(FLIGHT.replace("NAME", name), folder=folder)
    flown = scenario.with_({"duration_s": 6, "faults": [fault], "expect": expect})
    vehicle = Vehicle(flown, pulses=True, log=False)
    end, autopilot = Ardupilot(vehicle, Link()), peers.Ardupilot(Small().outputs)
    while not vehicle.over:
        autopilot.hear(end.take(autopilot.next(), "it", 0.0))
    return vehicle.flight.land()


def test_an_aircraft_whose_coefficients_are_known_is_found_again(tmp_path, quick):
    """The trainer's own file is what its model was written from: the fit has to find it."""
    found = derive(str(TRAINER), tmp_path).aircraft
    known, fitted = values(read(TRAINER)), values(found)
    assert {key: fitted[key] for key in known} == pytest.approx(known, rel=1e-3)
    assert all(abs(fitted[key]) < 1e-3 for key in fitted.keys() - known.keys())
    assert max(found.model_error_rad_s2) < 1e-3


def test_the_built_in_aircraft_is_found_again(again):
    """Derived from its model, the table written by hand comes out."""
    made, _ = again
    known, fitted = values(load()), values(made.aircraft)
    assert {key: fitted[key] for key in known} == pytest.approx(known, rel=5e-3)
    assert max(made.checked_rad_s2) < 2e-3
    outermost = made.aircraft.file.model_error_map.boxes[-1]
    assert made.aircraft.envelope.alpha_deg == load().envelope.alpha_deg
    assert made.aircraft.envelope.airspeed_mps == load().envelope.airspeed_mps
    beta = made.trim.beta_rad  # its own terms hold wherever a rudder at its stop takes it
    assert outermost.beta_rad == pytest.approx((beta - 0.45, beta + 0.45), abs=1e-3)


def test_a_scenario_derives_its_aircraft_at_first_use_and_the_source_is_untouched(
    tmp_path, monkeypatch, capsys, quick
):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    made, usual = [], derivation.derive
    monkeypatch.setattr(first_use, "derive", lambda reference: made.append(usual(reference)))
    source = instrumented.source_of("T37")
    before = hashlib.sha256(source.read_bytes()).hexdigest()
    file = find_aircraft("jsbsim:T37").folder / "aircraft.yaml"
    assert file.is_relative_to(tmp_path)
    assert file.read_text().startswith(first_line())
    assert capsys.readouterr().err.startswith("beaver-ftc: jsbsim:T37: deriving its design model")
    find_aircraft("jsbsim:T37")
    assert capsys.readouterr().err == ""
    (made,) = made
    assert hashlib.sha256(source.read_bytes()).hexdigest() == before
    page = (made.aircraft.folder / "derived.md").read_text()
    assert page.startswith("# T37")
    assert 0.0 < made.took_s < 60.0
    assert f"Derived in {made.took_s:.1f} s." in page
    assert set(made.further) == {"fcs/flap-pos-norm", "fcs/speedbrake-pos-norm"}
    assert all(f"| `{name}` | 0 |" in page for name in made.further)


def test_other_stops_leave_a_deflection_its_moment(tmp_path):
    """Its aerodynamics see a share of the travel. The search for trim moves the stops, and has to find the
    trim of the aircraft that flies."""
    model = instrumented.instrument(instrumented.source_of("OV10"), tmp_path, {"elevator": (-0.4, 0.3)})
    fdm, seen = bare(model), []
    for stop in (0.3, 10.0):
        fdm["actuators/elevator/position-max-rad"] = stop
        fdm["fcs/actuated-elevator-cmd-rad"] = 0.15
        fdm.run_ic()
        seen.append(fdm["fcs/effective-elevator-pos-norm"])
    assert seen == pytest.approx([0.5, 0.5])


def test_a_models_own_output_file_is_left_nowhere(tmp_path, monkeypatch):
    """JSBSim opens its CSV in the root directory when the model is loaded, output disabled or not."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    try_out(source_of("jsbsim:ball"))
    assert list(tmp_path.iterdir()) == []
    bare(copy_of(source_of("jsbsim:ball").model, tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["ball.xml"]
    assert not list(data_root().glob("BallOut*"))


def test_what_cannot_be_derived_is_refused_in_a_line(tmp_path, quick):
    with pytest.raises(BadInput, match=r"jsbsim:nothing: the jsbsim package has no such aircraft"):
        derive("jsbsim:nothing", tmp_path)
    with pytest.raises(BadInput, match=r"'nowhere' cannot be derived, allowed: jsbsim:NAME"):
        derive("nowhere", tmp_path)
    with pytest.raises(BadInput, match="give --out DIR"):
        derive(str(TRAINER))
    (tmp_path / "T37").mkdir()
    with pytest.raises(BadInput, match="was not derived"):
        derive("jsbsim:T37", tmp_path)
    assert list((tmp_path / "T37").iterdir()) == []
    with pytest.raises(BadInput, match=r"^jsbsim:Pterosaur: fcs/wing-alpha-deg moves by itself in steady"):
        derive("jsbsim:Pterosaur", tmp_path)
    file = tmp_path / "envelope.yaml"
    file.write_text("airspeed_mps: [80, 60]\n")
    with pytest.raises(BadInput, match=r"envelope.yaml:1: airspeed_mps: ends out of order"):
        derive("jsbsim:c172p", tmp_path, file)


def test_what_jsbsim_cannot_fly_is_said_in_a_line(tmp_path):
    """Its model ends the process that loads it."""
    text = (Path(__file__).parents[4] / "examples" / "own-aircraft" / "navion.xml").read_text()
    (tmp_path / "navion.xml").write_text(text.replace("<propulsion/>", '<system file="hydrodynamics_"/>'))
    says = r"^navion: JSBSim cannot load navion/navion.xml: it needs the file hydrodynamics_.xml, which "
    with pytest.raises(SimulationFailed, match=says):
        derive(str(tmp_path / "navion.xml"), tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["navion.xml"]


def test_a_surface_off_a_straight_line_is_said(derived):
    """The truth of a surface that loses half its effect beyond half its travel is no straight line."""
    made, _, _ = derived
    plant = Plant(100, aircraft=made.aircraft)
    held = plant.hold

    def softer(state):
        beyond = {name: u if abs(u) < 0.15 else 0.15 * np.sign(u) for name, u in state.surfaces_rad.items()}
        held(replace(state, surfaces_rad=beyond))

    plant.hold = softer
    assert any(
        note.startswith("aileron: its moment is not proportional") for note in not_affine(plant, made.trim)
    )


def test_the_tutorials_aircraft_is_its_published_table(tmp_path, quick):
    """Derivatives as they are in the book; with pitch rate the book counts q c/2V."""
    model = Path(__file__).parents[4] / "examples" / "own-aircraft" / "navion.xml"
    found = values(derive(str(model), tmp_path).aircraft)
    book = {
        ("Cl", "beta"): -0.074, ("Cl", "ph"): -0.410, ("Cl", "rh"): 0.107, ("Cm", "alpha"): -0.683,
        ("Cm", "qh"): -9.96 / 2, ("Cm", "elevator"): -0.923, ("Cn", "beta"): 0.071, ("Cn", "rudder"): -0.072,
    }  # fmt: skip
    assert {key: found[key] for key in book} == pytest.approx(book, rel=1e-3)
    assert under_an_autopilot(tmp_path, "navion").passed


SAME = ["elevator-partial-loss", "aileron-stuck", "rudder-stuck", "unanticipated", "fault-free"]


@pytest.mark.parametrize("name", SAME)
def test_the_built_in_aircraft_as_derived_has_the_same_verdicts(name, again):
    """Its table written by hand, and the one found from its model: the same flights are judged the same."""
    _, folder = again
    text = (Path(__file__).parents[4] / "scenarios" / f"{name}.yaml").read_text()
    flights = [
        fly(load_text(f"aircraft: {aircraft}\n{text}", folder=folder)) for aircraft in ("beaver", "./beaver")
    ]
    assert flights[0].scenario.airframe is not flights[1].scenario.airframe
    by_hand, derived = ((f.isolated, f.candidates, f.departure) for f in flights)
    assert derived == by_hand
    at = [f.detection_time_s for f in flights]
    assert at[0] == at[1] or at[1] == pytest.approx(at[0], abs=0.05)
