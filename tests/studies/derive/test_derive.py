"""Aircraft nobody wrote by hand: derived from JSBSim, flown with the measured error as the bound."""

import hashlib

import numpy as np
import pytest
from typer.testing import CliRunner

from beaver_ftc.cli.main import app
from beaver_ftc.design.context import DesignModel
from beaver_ftc.design.model import design_record
from beaver_ftc.errors import BadInput
from beaver_ftc.loop.loop import fly
from beaver_ftc.plant import instrumented
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.scenario.loader import load_text
from beaver_ftc.studies.derive.fit import pursue
from beaver_ftc.studies.derive.run import derive
from beaver_ftc.studies.derive.sample import Envelope, sample

FLIGHT = """
name: derived
aircraft: ./NAME
duration_s: 20
reference:
  p: [{sine: {amplitude_deg_s: 2, frequency_hz: 0.25}}]
  q: [{sine: {amplitude_deg_s: 2, frequency_hz: 0.2}}]
  r: [{sine: {amplitude_deg_s: 1, frequency_hz: 0.3}}]
"""


@pytest.fixture(scope="module", params=["c172p", "737"])
def derived(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("derived")
    return derive(request.param, folder), folder, request.param


def flight(derived, **changes):
    _, folder, name = derived
    return fly(load_text(FLIGHT.replace("NAME", name), folder=folder).with_(changes))


def test_the_declared_error_holds_on_states_neither_fit_nor_check_has_seen(derived):
    """A third set of states: hardly any may exceed the bound, which covers the largest of 4500."""
    made, _, _ = derived
    aircraft, low_high = made.aircraft, made.aircraft.envelope.airspeed_mps
    envelope = Envelope(low_high, made.aircraft.alpha_rad, made.trim.altitude_m)
    seen = sample(Plant(100, aircraft=aircraft), envelope, made.trim, 1000, seed=77)
    model = DesignModel(design_record(aircraft))
    believed = [model.f(x, y) + model.G(y) @ u for x, y, u in zip(seen.x, seen.y, seen.u, strict=True)]
    error = np.abs(np.array(believed) - seen.rate)
    assert (error > aircraft.model_error_rad_s2).mean() < 2e-3
    assert (error.max(axis=0) > 0.3 * np.array(aircraft.model_error_rad_s2)).all(), "the bound is loose"


def test_a_healthy_flight_raises_no_alarm(derived):
    healthy = flight(derived)
    assert healthy.detection_time_s is None
    assert healthy.departure is None
    assert max(healthy.pre_fault_rms_rad_s) < np.radians(0.2)


@pytest.mark.parametrize("surface", ["aileron", "elevator", "rudder"])
def test_a_loss_that_is_detected_is_named_rightly(derived, surface):
    loss = {"actuator": surface, "type": "loss_of_effectiveness", "magnitude": 0.7, "at_s": 8}
    faulty = flight(derived, faults=[loss])
    if faulty.detection_time_s is not None:
        assert faulty.detection_time_s >= 8.0
        assert faulty.isolated in (surface, None)
        assert faulty.isolated == surface or surface in faulty.candidates
    assert faulty.departure is None


def test_the_file_on_disk_is_untouched(tmp_path):
    source = instrumented.source_of("T37")
    before = hashlib.sha256(source.read_bytes()).hexdigest()
    derive("T37", tmp_path)
    assert hashlib.sha256(source.read_bytes()).hexdigest() == before


def test_pursuit_finds_the_terms_that_made_the_data():
    rng = np.random.default_rng(3)
    A = rng.normal(size=(400, 12))
    A[:, 7] = 0.0
    b = 2.0 * A[:, 3] - 0.5 * A[:, 9] + 0.1 * A[:, 0]
    taken, values = pursue(A, b)
    assert dict(zip(taken, values, strict=True)) == pytest.approx({3: 2.0, 9: -0.5, 0: 0.1})


def test_what_cannot_be_derived_is_refused_in_a_line(tmp_path):
    with pytest.raises(BadInput, match=r"jsbsim:nothing: the jsbsim package has no such aircraft"):
        derive("nothing", tmp_path)
    (tmp_path / "T37").mkdir()
    with pytest.raises(BadInput, match="was not derived"):
        derive("T37", tmp_path)
    assert list((tmp_path / "T37").iterdir()) == []
    file = tmp_path / "envelope.yaml"
    file.write_text("airspeed_mps: [80, 60]\n")
    with pytest.raises(BadInput, match=r"envelope.yaml:1: airspeed_mps: ends out of order"):
        derive("c172p", tmp_path, file)


def test_the_list_names_them():
    said = CliRunner().invoke(app, ["list", "aircraft"]).output
    assert "beaver " in said
    assert "jsbsim:c172p" in said
