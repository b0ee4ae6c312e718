"""Instruments of a grade, from data sheets."""

import pytest

from beaver_ftc.scenario.sensors import Sensors

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
    assert found.keys() >= expected.keys()
    for name, errors in expected.items():
        assert found[name] == pytest.approx(errors, rel=0.045), name
