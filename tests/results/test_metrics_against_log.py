"""The numbers of metrics.json, computed again from the log of the same flight by NumPy alone."""

import numpy as np
import pytest

import beaver_ftc as bf

SURFACES = ("aileron", "elevator", "rudder", "flap")
FAULT_S = 6.0
SCENARIO = """\
name: hard
duration_s: 14
reference: {p: [{sine: {amplitude_deg_s: 25, frequency_hz: 0.25}}]}
faults: [{actuator: aileron, type: loss_of_effectiveness, magnitude: 0.8, at_s: 6.0}]
"""


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    path = tmp_path_factory.mktemp("flown") / "hard.yaml"
    path.write_text(SCENARIO)
    flight = bf.fly(bf.load(path))
    return flight.metrics, {name: np.asarray(flight.log[name]) for name in flight.log.columns}


def first(log, column):
    """The time from which a flag stands, None if it never does."""
    return next((float(t_s) for t_s, flag in zip(log["t_s"], log[column], strict=True) if flag), None)


def test_the_flight_shows_what_is_compared(flown):
    metrics, _ = flown
    assert metrics["detection"]["detected"]
    assert max(metrics["saturation_s"].values()) > 0.1


def test_frames_and_times(flown):
    metrics, log = flown
    assert metrics["frames"] == len(log["t_s"])
    assert metrics["flight"]["flown_s"] == pytest.approx(len(log["t_s"]) / metrics["flight"]["rate_hz"])
    assert metrics["detection"]["time_s"] == pytest.approx(first(log, "detected"))
    assert metrics["detection"]["delay_s"] == pytest.approx(first(log, "detected") - FAULT_S)


def test_what_the_surfaces_did(flown):
    metrics, log = flown
    dt_s = 1.0 / metrics["flight"]["rate_hz"]
    for surface in SURFACES:
        step = np.diff(np.rad2deg(log[f"{surface}_pos_rad"]))
        travel, energy = np.abs(step).sum(), (step**2).sum() / dt_s
        assert metrics["tracking"]["surface_travel_deg"][surface] == pytest.approx(travel, abs=1e-6)
        assert metrics["tracking"]["surface_energy_deg2_s"][surface] == pytest.approx(energy, abs=1e-3)
        saturated = log[f"{surface}_saturated"].sum() * dt_s
        assert metrics["saturation_s"][surface] == pytest.approx(saturated, abs=1e-9)


def test_how_the_rates_were_tracked(flown):
    metrics, log = flown
    after = log["t_s"] >= FAULT_S - 1e-9
    for axis in "pqr":
        off = np.rad2deg(log[f"{axis}_model_rad_s"] - log[f"{axis}_rad_s"])
        for name, rows in (("pre", ~after), ("post", after)):
            rms = metrics["tracking"][f"{name}_fault_rms_deg_s"][axis]
            assert rms == pytest.approx(np.sqrt((off[rows] ** 2).mean()), rel=1e-6)


def test_when_the_envelope_was_left(flown):
    metrics, log = flown
    outside = log["envelope_valid"] == 0
    dt_s = 1.0 / metrics["flight"]["rate_hz"]
    assert metrics["envelope"]["outside_s"] == pytest.approx(outside.sum() * dt_s, abs=1e-9)
    assert metrics["envelope"]["exits"] == int((np.diff(outside.astype(int), prepend=0) == 1).sum())
