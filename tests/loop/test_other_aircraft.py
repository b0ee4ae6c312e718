"""An aircraft that is only data: three surfaces, no slipstream, terms the built-in one does not have."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import beaver_ftc as bf
from beaver_ftc.aircraft import load
from beaver_ftc.loop.loop import fly
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim
from beaver_ftc.plugins import DETECTORS, LAWS, registered
from beaver_ftc.scenario.schema import load_scenario, load_text

FOLDER = Path(__file__).parents[1] / "data" / "aircraft"
FLIGHT = FOLDER / "trainer-flight.yaml"
QUIET = """
name: trainer-quiet
aircraft: ./trainer
initial: {airspeed_mps: 50, altitude_m: 1500}
duration_s: 20
reference:
  p: [{sine: {amplitude_deg_s: 3, frequency_hz: 0.25}}]
  q: [{sine: {amplitude_deg_s: 3, frequency_hz: 0.2}}]
  r: [{sine: {amplitude_deg_s: 2, frequency_hz: 0.3}}]
uncertainty:
  inertia_coupling: {}
"""


@pytest.fixture(scope="module")
def trainer():
    return load("./trainer", FOLDER)


def quiet(**changes):
    return load_text(QUIET, folder=FOLDER).with_(changes)


def test_it_is_trimmed_by_its_own_surfaces_and_engine(trainer):
    plant = Plant(100, aircraft=trainer)
    slow, fast = (trim(50.0, 1500.0, plant=plant, thrust_n=thrust) for thrust in (600.0, 1400.0))
    assert max(map(abs, slow.residual)) < 1e-9
    assert fast.gamma_rad > slow.gamma_rad + 0.02
    assert set(slow.surfaces_rad) == set(trainer.surfaces)


def test_a_healthy_flight_raises_no_alarm_and_follows():
    flight = fly(quiet())
    assert flight.detection_time_s is None
    assert max(flight.pre_fault_rms_rad_s) < np.radians(0.3)
    assert flight.worst_residual_ratio < 0.5


@pytest.mark.parametrize("surface", ["aileron", "elevator", "rudder"])
@pytest.mark.parametrize("fault_class", ["published", "all"])
def test_the_loss_of_each_surface_is_detected_and_named(surface, fault_class):
    loss = {"actuator": surface, "type": "loss_of_effectiveness", "magnitude": 0.4, "at_s": 8}
    flight = fly(quiet(**{"faults": [loss], "fdi.fault_class": fault_class}))
    assert 8.0 <= flight.detection_time_s < 8.5
    assert flight.isolated == surface
    assert flight.estimate == pytest.approx(-0.4, abs=0.05)
    assert flight.departure is None


@pytest.mark.parametrize("surface", ["aileron", "elevator", "rudder"])
def test_a_jam_is_named_or_stays_possible(surface):
    jam = {"actuator": surface, "type": "stuck", "at_s": 8}
    flight = fly(quiet(**{"faults": [jam], "fdi.fault_class": "all"}))
    assert flight.isolated == surface
    assert "stuck" in (flight.isolation_type, *flight.candidates)


LOST = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.6, "at_s": 10.0}
RUNS_AWAY = {"type": "hardover", "actuator": "elevator", "direction": 1, "at_s": 10.0}


@pytest.mark.parametrize("scheme", sorted(set(registered(DETECTORS)) - {"none"}))
def test_every_detector_names_its_elevator(scheme):
    fault = RUNS_AWAY if scheme == "rls-monitor" else LOST  # without a model, a loss is learnt as it comes
    flight = fly(quiet(faults=[fault], **{"fdi.scheme": scheme}))
    assert flight.detection_time_s is not None
    assert flight.detection_time_s >= 10.0
    assert flight.isolated == "elevator"


@pytest.mark.parametrize("law", registered(LAWS))
def test_every_law_flies_it(law):
    flight = fly(quiet(**{"control.law": law}))
    assert flight.departure is None


def test_a_weak_elevator_at_its_stop_stays_in_use():
    fast = [{"square": {"amplitude_deg_s": 40, "frequency_hz": 0.25}}]
    log = bf.fly(quiet(**{"faults": [LOST | {"magnitude": 0.8}], "reference.q": fast})).log
    assert log.elevator_saturated.any()
    assert log.elevator_effectiveness_used.min() > 0.1


def test_a_result_folder_flies_it_again(tmp_path):
    kept = bf.fly(load_scenario(FLIGHT)).save(tmp_path, report=False)
    again = bf.fly(load_scenario(kept / "scenario.yaml"))
    pd.testing.assert_frame_equal(again.log, bf.open_run(kept).log)
    (kept / "aircraft" / "notes.txt").write_text("mine")
    with pytest.raises(bf.SimulationFailed, match=r"aircraft/notes\.txt"):
        bf.fly(load_scenario(FLIGHT)).save(tmp_path, report=False)
