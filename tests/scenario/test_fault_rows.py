"""What a type of fault does to the failure properties, twice over, and what its row says of it."""

import pytest

from beaver_ftc.scenario.airframe import checked_against
from beaver_ftc.scenario.faults import (
    TYPES,
    Past,
)
from beaver_ftc.scenario.interventions import fault_of
from beaver_ftc.scenario.sensors import Sensors
from scenario.damageable import damageable

GIVEN = {
    "loss_of_effectiveness": {"magnitude": 0.4},
    "stuck": {"position_deg": 45.0},
    "hardover": {"direction": -1},
    "float": {},
    "bias": {"bias_deg": -18.0},
    "rate_limit": {"scale": 0.2},
    "oscillatory": {"amplitude_deg": 36.0, "frequency_rad_s": 5.0},
    "unanticipated": {"Cm_alpha3": 8.0},
    "damage": {"case": "tail-off"},
}
BEFORE = {
    "effectiveness": 0.8, "stuck": 0.0, "stuck-at-rad": 0.1, "hardover": 0.0, "float": 0.0, "bias-rad": 0.1,
    "rate-scale": 0.5, "oscillation-amplitude-rad": 0.0, "oscillation-frequency-rad_sec": 0.0,
    "Cm-alpha3": 3.0,
}  # fmt: skip
PI = 3.14159265358979
QUARTER = {
    "loss_of_effectiveness": {"effectiveness": 0.8 * 0.9},
    "bias": {"bias-rad": 0.1 - 0.25 * PI / 10},
    "rate_limit": {"rate-scale": 0.5 * 0.8},
    "oscillatory": {"oscillation-amplitude-rad": PI / 20, "oscillation-frequency-rad_sec": 5.0},
    "unanticipated": {"Cm-alpha3": 3.0 + 2.0},
}
AFTER = {
    "loss_of_effectiveness": {"effectiveness": 0.8 * 0.9 * 0.6},
    "stuck": {"stuck": 1.0, "stuck-at-rad": PI / 4},
    "hardover": {"hardover": -1.0},
    "float": {"float": 1.0},
    "bias": {"bias-rad": 0.1 - 1.25 * PI / 10},
    "rate_limit": {"rate-scale": 0.5 * 0.8 * 0.2},
    "oscillatory": {"oscillation-amplitude-rad": PI / 5, "oscillation-frequency-rad_sec": 5.0},
    "unanticipated": {"Cm-alpha3": 3.0 + 2.0 + 8.0},
    "damage": {"tail-off": 1.0},
}


def fault(kind, **keys):
    actuator = {} if kind in ("unanticipated", "damage") else {"actuator": "flap"}
    with checked_against(damageable()):
        return fault_of({"type": kind, **actuator, **keys}, 1.0)


@pytest.mark.parametrize("kind", TYPES)
def test_a_quarter_of_a_fault_and_then_the_whole_of_it(kind):
    found = dict(BEFORE)
    for share, after in ((0.25, QUARTER.get(kind, AFTER[kind])), (1.0, AFTER[kind])):
        fault(kind, **GIVEN[kind]).strike(found, share, Past(at_rad=0.7))
        assert found == pytest.approx(BEFORE | after)


G = 9.80665
GRADES = {  # from data sheets: a random walk over an hour is a sample's noise at 100 Hz; else as assumed
    "tactical-grade": {
        ("p", "q", "r"): {
            "noise_std_deg_s": 0.125 / 60 * 10, "bias_deg_s": 1 / 3600, "scale_error": 150e-6,
        },
        ("alpha", "beta"): {"noise_std_deg": 0.025, "bias_deg": 0.1},
        ("phi", "theta", "psi"): {"noise_std_deg": 0.005, "bias_deg": 0.2, "drift_deg_h": 1.0},
        ("ax", "ay", "az"): {
            "noise_std_mps2": 0.065 * 0.3048 / 60 * 10, "bias_mps2": 1e-3 * G, "scale_error": 300e-6,
        },
        ("V",): {"noise_std_mps": 0.05, "bias_mps": 0.2}, ("qdyn",): {"noise_std_pa": 2.0, "bias_pa": 5.0},
        ("altitude",): {"noise_std_m": 0.2, "bias_m": 3.0},
        ("engine_rpm",): {"noise_std_rpm": 1.0, "bias_rpm": 2.0},
        ("manifold_pressure",): {"noise_std_inhg": 0.01, "bias_inhg": 100.0 / 3386.39},
    },
    "consumer-grade": {
        ("p", "q", "r"): {
            "noise_std_deg_s": 0.1, "bias_deg_s": 30.0 * 2.0 / 125.0, "scale_error": 0.03,
            "quantum_deg_s": 1 / 65.5,
        },
        ("alpha", "beta"): {"noise_std_deg": 0.043, "bias_deg": 0.5, "quantum_deg": 360 / 4096},
        ("phi", "theta", "psi"): {"noise_std_deg": 0.05, "bias_deg": 1.0},
        ("ax", "ay", "az"): {
            "noise_std_mps2": 300e-6 * G * 144**0.5, "bias_mps2": 60e-3 * G, "scale_error": 0.03,
            "quantum_mps2": G / 8192,
        },
        ("V",): {"noise_std_mps": 0.1, "bias_mps": 0.4},
        ("qdyn",): {"noise_std_pa": 3.0, "bias_pa": 0.0025 * 6894.76},
        ("altitude",): {"noise_std_m": 0.5, "bias_m": 5.0},
        ("engine_rpm",): {"noise_std_rpm": 5.0, "bias_rpm": 10.0},
        ("manifold_pressure",): {"noise_std_inhg": 0.05, "bias_inhg": 0.1},
    },
}  # fmt: skip


@pytest.mark.parametrize("grade", GRADES)
def test_instruments_of_a_grade_are_those_of_their_data_sheets(grade):
    """To the digits that the presets have; of a bias that is zeroed 2 K away to 4 %."""
    expected = {name: errors for names, errors in GRADES[grade].items() for name in names}
    found = {name: sensor.model_dump(exclude_unset=True) for name, sensor in Sensors.model_validate(grade)}
    assert found.keys() == expected.keys()
    for name, errors in expected.items():
        assert found[name] == pytest.approx(errors, rel=0.045), name
