"""What a scenario may say, its defaults, and what it carries to the flight."""

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.schema import Scenario, load_text


def scenario(text: str = "") -> Scenario:
    return load_text("name: x\n" + text)


@pytest.mark.parametrize(
    ("key", "least", "most"),
    [
        ("duration_s", 0.01, 360_000),
        ("rate_hz", 20, 1000),
        ("substeps", 1, 50),
        ("initial.airspeed_mps", 20, 70),
        ("initial.altitude_m", -300, 6000),
    ],
)
def test_the_contract_s_ranges_are_inclusive(key, least, most):
    *section, last = key.split(".")
    for value in (least, most):
        text = f"{section[0]}: {{{last}: {value}}}" if section else f"{last}: {value}"
        scenario(text)
    for value in (least - 1, most + 1):
        text = f"{section[0]}: {{{last}: {value}}}" if section else f"{last}: {value}"
        with pytest.raises(BadInput, match=f"{key}: .* out of range"):
            scenario(text)


FAULTS = {
    "loss_of_effectiveness": {"magnitude": 0.4},
    "stuck": {"position_deg": 3},
    "hardover": {"direction": -1},
    "float": {},
    "bias": {"bias_deg": 2},
    "rate_limit": {"scale": 0.1},
    "oscillatory": {"amplitude_deg": 1, "frequency_rad_s": 5},
}


@pytest.mark.parametrize("kind", FAULTS)
@pytest.mark.parametrize("surface", ["aileron", "elevator", "rudder", "flap"])
def test_every_fault_type_on_every_surface(kind, surface):
    fault = {"type": kind, "actuator": surface, "at_s": 1, "end_s": 2, "profile": "abrupt", **FAULTS[kind]}
    read = Scenario.model_validate({"name": "x", "faults": [fault]}).faults[0]
    assert read.type == kind
    assert read.model_dump(exclude_none=True) == fault


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("initial: {airspeed_mps: 29}", "initial.airspeed_mps: 29 is outside"),
        ("initial: {airspeed_mps: 56}", "30 to 55 m/s"),
        (
            "reference: {q: [{sine: {amplitude_deg_s: 1, frequency_hz: 51}}]}",
            "reference.q[0]: 51 Hz is over the Nyquist",
        ),
        (
            "reference: {p: [{chirp: {amplitude_deg_s: 1, end_s: 9, "
            "start_frequency_hz: 9, end_frequency_hz: 60}}]}",
            "reference.p[0]: 60 Hz",
        ),
        (
            "uncertainty: {sinusoid: {r: {amplitude_rad_s2: 0.01, frequency_rad_s: 700}}}",
            "uncertainty.sinusoid.r: 111",
        ),
        (
            "faults: [{type: oscillatory, actuator: flap, at_s: 1, amplitude_deg: 1, frequency_rad_s: 400}]\n"
            "fdi: {fault_class: all}",
            "faults[0].frequency_rad_s: 63.662 Hz",
        ),
        (
            "faults: [{sensor: q, type: bias, magnitude: 1, at_s: 20}]",
            "faults: sensor q bias at 20 s: outside the declared class; set fdi.fault_class: all",
        ),
        (
            "faults: [{actuator: flap, type: stuck, at_s: 2}]",
            "faults: flap stuck at 2 s: outside the declared",
        ),
        ("fdi: {sensor_monitor: auto}", "fdi.sensor_monitor: auto is a former value"),
    ],
)
def test_what_is_unwise_is_a_warning(text, says):
    (warning,) = scenario(text).warnings()
    assert says in warning
