"""What a scenario may say, its defaults, and what it carries to the flight."""

import pickle

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.faults import LossOfEffectiveness
from beaver_ftc.scenario.schema import Scenario, load_text

CONTRACT = """
name: elevator-partial-loss          # letters, digits, - and _
description: 40 % loss of elevator effectiveness at 12 s, as published.
aircraft: beaver
duration_s: 30
rate_hz: 100                         # frame rate of FDI and control
substeps: 1                          # JSBSim frames per such frame
seed: 1
initial: {airspeed_mps: 45, altitude_m: 1828.8, engine_rpm: 1800, manifold_pressure_inhg: 20, flap_deg: 0}
reference:                           # rad/s loops; amplitudes in deg/s; a missing axis is 0
  p: [{sine: {amplitude_deg_s: 3, frequency_hz: 0.25}}]       # a list is summed
  q: [{sine: {amplitude_deg_s: 3, frequency_hz: 0.2}}]
  r: [{doublet: {amplitude_deg_s: 2, start_s: 5, width_s: 2}}] # also step, square, ramp, chirp, csv
faults:
  - {actuator: elevator, type: loss_of_effectiveness, magnitude: 0.4, at_s: 12, profile: abrupt}
uncertainty:
  inertia_coupling: {p: 0.25, q: -0.25, r: 0.25}
  sinusoid: {p: {amplitude_rad_s2: 0.02, frequency_rad_s: 10}, q: {amplitude_rad_s2: 0.02, frequency_rad_s: 15}, r: {amplitude_rad_s2: 0.02, frequency_rad_s: 10}}
  coefficients: {Cm_alpha: 1.05}     # truth / design ratio
actuators: ideal                     # or {bandwidth_rad_s: 20, rate_limit_deg_s: 60} or per surface
sensors: ideal                       # or standard deviations, biases, delay per signal
environment: {turbulence: none}      # or {turbulence: dryden, severity: light|moderate|severe}, wind_mps: [n, e, d]
fdi: {scheme: adaptive-estimators}   # gains and bounds, all with defaults; scheme names a registered detector
control: {law: fault-tolerant}       # nominal | adaptive | fault-tolerant | oracle, or a registered law
expect:                              # what CI asserts; each is optional
  detected_within_s: 0.5
  isolated_as: elevator
  isolated_within_s: 1.0
  no_false_alarm: true
  no_departure: true
  post_fault_rms_deg_s: {q: 1.0}
"""  # noqa: E501


def scenario(text: str = "") -> Scenario:
    return load_text("name: x\n" + text)


def test_the_contract_s_example_loads():
    example = load_text(CONTRACT)
    assert example.initial.altitude_m == 1828.8
    assert example.faults == (
        LossOfEffectiveness(type="loss_of_effectiveness", actuator="elevator", magnitude=0.4, at_s=12.0),
    )
    assert example.uncertainty.coefficients == {"Cm_alpha": 1.05}
    assert example.expect.post_fault_rms_deg_s.model_dump(exclude_none=True) == {"q": 1.0}
    (line,) = example.warnings()  # it declares nothing of the coefficient it has wrong
    assert line.startswith("uncertainty.coefficients.Cm_alpha: 1.05 is beyond")


def test_a_scenario_crosses_a_process_boundary():
    example = load_text(CONTRACT)
    assert pickle.loads(pickle.dumps(example)) == example


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
