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


def test_a_readout_stays_when_the_flight_goes_on(flown):
    _, first, now, *_ = flown
    assert (first.rates_rad_s != now.rates_rad_s).any()
    assert first.k != 1 or now.k > 1
