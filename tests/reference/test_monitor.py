"""Compiled flights with the sensor monitor beside the executable reference: the largest ratio of residual to
threshold and its test until a reading is replaced, the alarm, and the name, by the page's "changed by"."""

from pathlib import Path

import numpy as np
import yaml

import beaver_ftc as bf
from reference.flights import declared, instruments
from reference.monitor import ratios
from reference.test_against_flights import DERIVES

DATA = yaml.safe_load(Path(__file__).with_name("monitored.yaml").read_text())


def differences(document):
    """Where a flight differs from the page. A residual may be a difference of readings that agree in ten
    digits."""
    declaration = declared(document)
    flight = bf.fly(document)
    ratio = ratios(declaration, *instruments(document, flight.log, declaration))
    frames = len(ratio) // declaration.n
    log = flight.log[1 : frames + 1]
    ratio = ratio[: frames * declaration.n].reshape(len(log), -1, 11).max(axis=1)
    ours = [ratio.max(axis=1), ratio[np.arange(len(log)), log["watch_test"].astype(int)]]
    same = np.isclose(ours, log["watch_share"], rtol=1e-7, atol=1e-12).all(axis=0)
    missing = log["watch_missing"].notna()
    beyond = ours[0] > 1.0
    sensor = str(flight.isolation.fault).partition("sensor ")[2]
    if sensor:  # inside this frame, the reading is replaced
        same |= log["t_s"] > flight.isolation.time_s - (declaration.n > 1) * declaration.dt / 2.0
    names = ["", *DATA["changed_by"][ratio[beyond.argmax()].argmax()]]
    if missing.any():
        names = [document["faults"][0]["sensor"]]
    return [same.all(), log["detected"][beyond | missing].all(), sensor in names]


def test_ratios_alarms_and_names_of_the_sensor_monitor_are_those_of_the_page():
    flown = [one for one in DATA["flights"] if DERIVES or one["aircraft"][:6] == "beaver"]
    assert [one["seed"] for one in flown if not all(differences(one))] == []
