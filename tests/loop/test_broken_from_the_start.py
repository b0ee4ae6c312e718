"""Flights whose diagnosis begins with a broken instrument: it is named, or nothing is."""

import pytest

import beaver_ftc as bf
from beaver_ftc.scenario.schema import load

MOVING = {
    "p": [{"sine": {"amplitude_deg_s": 4, "frequency_hz": 0.3}}],
    "q": [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.2}}],
    "r": [{"sine": {"amplitude_deg_s": -4, "frequency_hz": 0.5, "phase_deg": 90}}],
}
ANEW = [{"at_s": 1.3, "scheme": "adaptive-estimators"}]


def last_name(sensor, kind, magnitude, at_s=0.0, fdi=None, **more):
    """Who is named as the flight ends."""
    more["fdi"] = {"sensor_monitor": "always", **(fdi or {})}
    fault = {"sensor": sensor, "type": kind, "at_s": at_s, "magnitude": magnitude}
    flown = bf.fly(load({"name": "x", "duration_s": 4, "faults": [fault], **more}), log=False)
    return flown.isolation.fault


@pytest.mark.parametrize(
    ("sensor", "kind", "magnitude", "more"),
    [
        ("phi", "bias", -30.0, {"rate_hz": 50, "reference": MOVING}),
        ("phi", "bias", 3.0, {"rate_hz": 20, "control": {"law": "lqr"}}),
        ("phi", "bias", -4.0, {"changes": ANEW, "at_s": 1.27, "reference": MOVING}),
        ("theta", "scale", -0.18, {}),
        ("theta", "bias", 6.0, {"reference": MOVING}),
        ("alpha", "bias", -2.4, {"rate_hz": 20}),
        ("alpha", "scale", 0.6, {"reference": MOVING}),
        ("beta", "bias", -1.2, {"rate_hz": 200, "fdi": {"fault_class": "all"}}),
        ("beta", "bias", 8.0, {"reference": MOVING}),
        ("V", "bias", -8.0, {"reference": MOVING}),
        ("V", "scale", -0.8, {"reference": MOVING}),
        ("qdyn", "bias", 170.0, {"rate_hz": 20}),
        ("q", "bias", 0.4, {}),
        ("q", "bias", 3.0, {"changes": ANEW, "at_s": 1.0, "rate_hz": 20}),
        ("p", "scale", -0.65, {"changes": ANEW, "at_s": 1.28, "reference": MOVING}),
        ("p", "noise", 10.0, {}),
        ("p", "noise", 10.0, {"changes": ANEW, "at_s": 0.5}),
        ("p", "noise", 0.7, {"rate_hz": 20}),
    ],
)
def test_no_sound_instrument_and_no_surface_is_named(sensor, kind, magnitude, more):
    named = last_name(sensor, kind, magnitude, **more)
    assert named in (None, "unanticipated", f"sensor {sensor}")
    if sensor in "pq":
        assert named == f"sensor {sensor}", "all of a gyro's error shows at every look"
