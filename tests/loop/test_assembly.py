"""From a scenario to the record a flight is flown by: numbers in their units, per frame or JSBSim frame."""

from math import exp, pi, radians

import numpy as np
import pytest

from beaver_ftc.aircraft.schema import MAX_EFFECTORS
from beaver_ftc.loop.assembly import Trim, assemble
from beaver_ftc.scenario.schema import Scenario

TRAVEL = np.array([[-0.5, -0.4, -0.3, -0.1], [0.5, 0.45, 0.35, 1.0]])
TRIM, Y = np.array([0.01, -0.02, 0.03, 0.04]), np.array([0.1, 0.02, 45.0, 1036.0, 0.3])
AILERON, ELEVATOR, RUDDER, FLAP = range(4)
DT, SUBSTEPS = 0.02, 2
GIVEN = {
    "name": "assembled", "rate_hz": 50, "substeps": SUBSTEPS, "duration_s": 5,
    "initial": {"engine_rpm": 2000, "manifold_pressure_inhg": 21.0},
    "actuators": {"elevator": {"bandwidth_rad_s": 25.0, "rate_limit_deg_s": 90.0},
                  "rudder": {"bandwidth_rad_s": 12.0}},
    "control": {
        "law": "fault-tolerant", "proportional_per_s": 3.0, "integral_per_s2": 1.5,
        "network_gain_per_s2": 45.0, "network_leak_per_s": 0.8, "network_weight_limit_rad_s2": 15.0,
        "effectiveness_rate_per_s": 2.5, "least_effectiveness": 0.15, "hand_over_s": 1.6,
        "power": {"lowest_inhg": 11.0, "highest_inhg": 30.0, "rate_inhg_s": 4.0, "patience_s": 1.25,
                  "release_s": 8.0, "smoothing_s": 0.4, "speed_gain_inhg_per_mps": 0.7,
                  "attitude_gain_inhg_per_deg": 0.3, "washout_s": 9.0, "attitude_memory_s": 7.0},
    },
    "fdi": {
        "fault_class": "all", "thresholds": "published", "authority": "statistical", "statistical": {},
        "forgetting_time_s": 2.0, "detection_pole_per_s": 1.5, "isolation_pole_per_s": 2.5,
        "slowest_oscillation_rad_s": 1.2, "slowest_rate_deg_s": 3.0, "pole_bank_per_s": [0.5, 4.0],
        "sharpen": {"pole_bank": True, "memory": False, "set_membership": True},
        "probing": {"amplitude_deg": 1.5, "frequency_hz": 1.25, "duration_s": 3.0},
        "bounds": {"inertia_coupling": {"p": 0.1, "q": 0.2, "r": 0.3},
                   "constant_rad_s2": {"p": 0.01, "q": 0.02, "r": 0.03}},
    },
}  # fmt: skip


def assembled(**keys):
    return assemble(Scenario.model_validate(GIVEN | keys), Trim(np.zeros(3), Y, TRIM, TRIM), TRAVEL)[0]


@pytest.fixture(scope="module")
def frame():
    return assembled()


def at(record, path):
    for name in path.split("."):
        record = record[int(name)] if name.isdigit() else record[name]
    return record


EXPECTED = {
    "dt": DT, "prediction.w": 0.5, "prediction.u": TRIM, "prediction.commanded": TRIM,
    "control.layout.trim": TRIM,
    "control.allocation.output.command": TRIM,
    "fdi.config.enabled": 1, "fdi.config.dt": DT, "fdi.isolation.config.forget": exp(-DT / 2.0),
    "fdi.isolation.config.a": exp(-2.5 * DT),
    "fdi.fdae.config.pole_per_s": 1.5, "fdi.fdae.config.a": exp(-1.5 * DT),
    "fdi.isolation.config.n_estimators": 8,
    "fdi.fdae.network.config.gain": 45.0, "fdi.fdae.network.config.leak": 0.8,
    "fdi.fdae.network.config.w_max": 15.0,
    "fdi.bound.inertia_coupling_error_share": (0.1, 0.2, 0.3),
    "fdi.bound.const": (0.01, 0.02, 0.03),
    "fdi.bound.earth_rate_rad_s": 7.292115e-5,  # rad/s [WGS84]
    "fdi.verdict.detected_at_s": -1.0, "fdi.verdict.isolated_at_s": -1.0, "fdi.verdict.fault_type": -1,
    "fdi.verdict.typed_at_s": -1.0, "fdi.verdict.target": -1,
    "fdi.verdict.accommodation_mode": -1, "accounts.guarantee.certain_after_s": -1.0,
    "fdi.layout.main": (AILERON, ELEVATOR, RUDDER), "fdi.layout.dominant_axis": (0, 1, 2, 1),
    "fdi.layout.partner": (RUDDER, FLAP, AILERON, ELEVATOR),
    "fdi.config.diagnoses_all_types": 1, "fdi.types.config.frames_per_block": 1,
    "fdi.types.config.block_duration_s": DT,
    "fdi.types.config.single_instant": 0, "fdi.config.n_substeps": 2,
    "fdi.types.config.returns_lagged": 1,
    "fdi.types.config.half_frames": 131,
    # of 2.618 s
    "fdi.types.pair.enabled": 0, "fdi.types.pair.first_pitch": -1,
    "fdi.types.surface.0.actuator.stop_lo": -0.5, "fdi.types.surface.3.actuator.stop_hi": 1.0,
    "fdi.types.surface.1.accommodation.mode": -1,
    "fdi.types.surface.1.status.fault_type": -1, "fdi.types.surface.0.status.may_be_sole": 1,
    "fdi.types.surface.1.actuator.approach_share": 1.0 - exp(-25.0 * DT / 2),
    "fdi.types.surface.1.actuator.step": pi / 2 * DT / 2,
    "fdi.types.surface.1.actuator.runaway": pi / 4,
    "fdi.types.surface.1.actuator.slow_step": radians(3.0) * DT / 2,
    "fdi.bank.config.n_filters": 3, "fdi.isolation.config.reach": 0,
    "fdi.isolation.config.narrows": 1,
    "control.reference.config.dt": DT,
    "control.surfaces.output.effectiveness": 1.0,
    "control.surfaces.config.effectiveness_step": 2.5 * DT, "control.reference.memory.scale": 1.0,
    "control.surfaces.config.least_effectiveness": 0.15,
    "control.layout.low": TRAVEL[0], "control.layout.high": TRAVEL[1],
    "control.allocation.config.hand_over_step": DT / 1.6,
    "control.layout.main": (AILERON, ELEVATOR, RUDDER), "control.layout.stand_in": FLAP,
    "control.probe.config.amplitude": radians(1.5), "control.probe.config.step": 2 * pi * 1.25 * DT,
    "control.probe.config.frames": 150,
    "control.probe.memory.from_s": -1.0,
    "control.probe.memory.to_s": -1.0,
    "prediction.actuators.real": 1,
    "prediction.actuators.low": TRAVEL[0], "prediction.actuators.high": TRAVEL[1],
    "prediction.actuators.approach.2": 1.0 - exp(-12.0 * DT / 2),
    "prediction.actuators.approach.1": 1 - exp(-0.25),
    "prediction.actuators.step.1": pi / 2 * DT / 2,
    "control.power.config.enabled": 1,
    "control.power.output.from_s": -1.0,
    "control.power.config.impatience": DT / 1.25,
    "control.power.config.forgiveness": DT / 8.0, "control.power.config.speed_gain": 0.7,
    "control.power.config.attitude_gain": 0.3 * 180 / pi,
    "control.power.config.smoothing": 1 - exp(-DT / 0.4),
    "control.power.config.washout": 1 - exp(-DT / 9.0), "control.power.config.leak": 1 - exp(-DT / 7.0),
    "control.power.config.trim": 21.0, "control.power.output.command": [21.0, *MAX_EFFECTORS * [0.0]],
    "control.power.output.least": 21.0,
    "control.power.output.greatest": 21.0,
    "control.power.config.low": 11.0,
    "control.power.config.high": 30.0,
    "control.power.config.step": 4.0 * DT,
    # half of the rudder's smaller travel holds the propeller: 0.08265 0.3 / 2 = 0.003026 dpt^3 [TM88]
    "control.power.config.highest_dpt": (0.08265 * 0.15 / 0.003026) ** (1 / 3),
    "truth.declared": 1,
}  # fmt: skip


@pytest.mark.parametrize("path", EXPECTED)
def test_a_number_of_the_record(path, frame):
    found, rel = np.array(at(frame, path)), 1e-6 if path.endswith("earth_rate_rad_s") else 1e-9
    assert found == pytest.approx(np.broadcast_to(EXPECTED[path], found.shape), rel=rel)


def test_the_slipstream_per_manifold_pressure_is_that_of_the_engine(frame):
    """dpt = 0.08696 + 191.18 P / (rho V^3 / 2), P = 0.7355 (0.00412 (pz + 7.4) (n + 2010) + ...) [FDC]."""
    per_inhg_kw = 0.7355 * 0.00412 * (2000 + 2010)
    assert frame["control"]["power"]["config"]["dpt_factor"] == pytest.approx(
        2 * 191.18 * per_inhg_kw, rel=1e-6
    )


def test_the_model_of_the_reference_is_a_critically_damped_second_order():
    """x'' = w^2 (r - x) - 2 w x': its step response after a second is 1 - (1 + w) e^-w."""
    control = assembled()["control"]
    A, B, x = control["reference"]["config"]["A"], control["reference"]["config"]["B"], np.zeros(2)
    for _ in range(50):
        x = A @ x + B.ravel()
    assert x[0] == pytest.approx(1 - 11 * np.exp(-10.0))
