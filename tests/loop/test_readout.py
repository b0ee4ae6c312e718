"""Readouts say what the log says of the same frame, and what a scenario and its aircraft declare."""

import pytest

import beaver_ftc as bf
from beaver_ftc.loop import Stepping

FLIGHT = {
    "name": "read", "duration_s": 3.0, "sensors": "consumer-grade",
    "control": {"law": "fault-tolerant"},
    "fdi": {
        "fault_class": "all", "statistical": {}, "sensor_monitor": "always",
        "bounds": {"sensors": "consumer-grade"},
    },
    "faults": [{"type": "stuck", "actuator": "elevator", "at_s": 1.0, "position_deg": 8.0}],
}  # fmt: skip


@pytest.fixture(scope="module")
def flown():
    """Step to the end; the readouts of the first and last frame, the last row, when the alarm was raised."""
    flight = Stepping(bf.load(FLIGHT))
    first = flight.readout
    first.rates_rad_s  # noqa: B018  # read, so that it stays
    alarm_s = None
    while not flight.done:
        flight.step()
        if alarm_s is None and flight.verdict.detected:
            alarm_s = flight.t_s
    row = dict(zip(flight.columns, flight.values, strict=True))
    yield flight, first, flight.readout, row, alarm_s
    flight.release()


def by_axis(row, name):
    return [row[f"{axis}_{name}"] for axis in "pqr"]


def test_a_frame_is_read_as_the_log_has_it(flown):
    flight, _, now, row, _ = flown
    assert (now.k, now.dt_s, now.since) == (flight.frames, 1.0 / flight.rate_hz, 0)
    assert now.rates_rad_s.tolist() == by_axis(row, "measured_rad_s")
    assert now.airspeed_mps == row["airspeed_mps"]
    assert now.diagnosis.declared_bounds.eta_bar_rad_s2.tolist() == by_axis(row, "eta_bar_rad_s2")
    assert now.alarmed == bool(row["detected"])


def test_the_diagnosis_is_read_as_the_log_has_it(flown):
    flight, _, now, row, alarm_s = flown
    diagnosis, verdict = now.diagnosis, flight.verdict
    assert diagnosis.detected
    columns = [name for name in row if name.startswith("fie_") and name.endswith("_excluded")]
    names = [name.removeprefix("fie_").removesuffix("_excluded") for name in columns]
    assert diagnosis.detected_at_s == alarm_s
    assert names[diagnosis.isolated_estimator].removesuffix("_position") == verdict.isolated
    assert diagnosis.is_estimator_excluded.tolist() == [bool(row[f"fie_{name}_excluded"]) for name in names]
    assert [one.is_excluded for one in diagnosis.estimators] == diagnosis.is_estimator_excluded.tolist()
    assert (diagnosis.enabled, diagnosis.diagnoses_all_types) == (True, True)
    aircraft = bf.load(FLIGHT).airframe
    for s, name in enumerate(aircraft.surfaces):
        stops, actuator = aircraft.travel[name], diagnosis.surface_fault_types[s].actuator
        assert (actuator.travel_low_rad, actuator.travel_high_rad) == (stops.min_rad, stops.max_rad)
        assert names[diagnosis.layout.position_estimator_index_by_surface[s]] == f"{name}_position"
        assert names[diagnosis.layout.loss_estimator_index_by_surface[s]] == name
        assert diagnosis.layout.dominant_axis_by_surface[s] == aircraft.dominant_axis[s]


def test_a_readout_stays_when_the_flight_goes_on(flown):
    _, first, now, *_ = flown
    assert (first.rates_rad_s != now.rates_rad_s).any()
    assert first.k != 1 or now.k > 1
