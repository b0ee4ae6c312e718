"""Flights in which nothing can be concluded: metrics, reasons and words, against the log."""

import re
import shutil

import numpy as np
import pytest
import yaml

import beaver_ftc as bf
from beaver_ftc.aircraft import aircraft
from beaver_ftc.diagnosis.error_map import UNMAPPED_ERROR_RAD_S2

FULL = {
    "p_rad_s": [-9, 9], "q_rad_s": [-9, 9], "r_rad_s": [-9, 9], "alpha_rad": [-1, 1], "beta_rad": [-1, 1],
    "airspeed_mps": [1, 90], "density_kg_m3": [1.0, 1.05], "signals": {"dpt": [-9, 9]},
    **{f"error_{axis}_rad_s2": [[0.001]] for axis in "pqr"},
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The built-in aircraft with a map that holds between 1,550 and 2,060 m, for the first 15 s."""
    own = tmp_path_factory.mktemp("mapped")
    source = aircraft.load("beaver").folder
    shutil.copytree(source, own / "mapped")
    data = yaml.safe_load((source / aircraft.FILE).read_text())
    error_map = {"travel_share": [1.0], "until_s": [15.0], "boxes": [FULL]}
    text = yaml.safe_dump(data | {"name": "mapped", "model_error_map": error_map})
    (own / "mapped" / aircraft.FILE).write_text(text)
    return own


def flown(folder, **keys):
    given = {
        "name": "x", "aircraft": "./mapped", "duration_s": 8, "expect": {"detected_within_s": 1},
        "faults": [{"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.9, "at_s": 4}],
        "reference": {"q": [{"sine": {"amplitude_deg_s": 4, "frequency_hz": 0.3}}]},
    }  # fmt: skip
    path = folder / "x.yaml"
    path.write_text(yaml.safe_dump(given | keys))
    return bf.fly(bf.load(path))


def share_by_log(flight):
    return float(np.mean(np.asarray(flight.log["q_eta_bar_rad_s2"]) > 0.4 * UNMAPPED_ERROR_RAD_S2))


def test_outside_of_the_altitudes_nothing_is_concluded_and_it_is_said(folder):
    flight = flown(folder, initial={"altitude_m": 3000})
    found = flight.metrics["detection"]["inconclusive"]
    assert found["share"] == share_by_log(flight) == 1.0
    assert found["from_s"] == 0.0
    (reason,) = found["reasons"]
    assert (reason["quantity"], reason["share"]) == ("altitude_m", 1.0)
    assert reason["measured"] == pytest.approx([1560, 2060], abs=20)
    assert reason["flown"] == pytest.approx([3000, 3000], abs=40)
    (expected,) = flight.metrics["expectations"]
    assert not expected["passed"]
    says = r"nothing can be concluded in 100 % of the frames: outside the altitudes .*: 1,5.0 to 2,0.0 m"
    assert re.match(says, expected["reason"])
    assert not any("fdi.bounds" in hint for hint in flight.metrics["hints"])
    warned = [line for line in flight.scenario.warnings() if "measured" in line]
    assert len(warned) == 1
    assert warned[0].startswith(
        "initial.altitude_m: 3000: nothing can be detected or named outside the altitudes"
    )
