"""Each number of the diagnosis is read from its own field of the record: no two numbers in it are alike."""

import numpy as np
import pytest

from beaver_ftc.diagnosis.readout import DiagnosisReadout
from beaver_ftc.diagnosis.schemes import fdi_dtype
from telling import fill

N_SURFACES, N_ESTIMATORS, WORST_TEST = 3, 4, 2
N_HYPOTHESES, N_AXES, N_REGRESSORS = (3, 2, 4), (1, 2, 2), (5, 2, 3)

# What is a truth value, and where it is in the record.
FLAGS = {
    "enabled": "config.enabled",
    "diagnoses_all_types": "config.diagnoses_all_types",
    "detected": "verdict.detected",
    "types_config.single_instant": "types.config.single_instant",
    "types_config.returns_lagged":
        "types.config.returns_lagged",
    "gust.is_turbulence_declared": "statistical.gust.output.gusty",
    "gust.subtracts_measured_gust": "statistical.gust.output.measured",
    "sensor_monitor.enabled": "sensor_monitor.config.enabled",
    "sensor_monitor.has_raised_alarm": "sensor_monitor.output.alarmed",
    "estimators.3.is_excluded": "isolation.estimator.3.excluded",
    "statistical_filters.2.hypotheses.3.may_raise_alarm": "statistical.block.2.hypothesis.3.alarms",
    "is_estimator_excluded.2": "isolation.estimator.2.excluded",
    "surface_fault_types.1.is_type_excluded.2": "types.surface.1.sets.excluded.2",
    "sensor_monitor.is_reading_unused.5": "sensor_monitor.output.is_reading_unused.5",
}  # fmt: skip

# What is a number or an array of them.
NUMBERS = {
    "scheme_number": "config.scheme_number",
    "detected_at_s": "verdict.detected_at_s",
    "isolated_estimator": "verdict.isolated_estimator",
    "layout.dominant_axis_by_surface": "layout.dominant_axis",
    "layout.loss_estimator_index_by_surface": "layout.loss",
    "layout.position_estimator_index_by_surface": "layout.position",
    "estimators.1.hypothesis_kind": "isolation.estimator.1.hypothesis_kind",
    "estimators.1.theta_min": "isolation.estimator.1.theta_min",
    "estimators.1.theta_max": "isolation.estimator.1.theta_max",
    "estimators.1.parity_direction": "isolation.estimator.1.parity_direction",
    "types_config.n_substeps": "types.config.n_substeps",
    "types_config.half_blocks": "types.config.half_frames",
    "types_config.frames_per_block": "types.config.frames_per_block",
    "types_config.block_duration_s": "types.config.block_duration_s",
    "types_config.dt_s": "types.config.dt",
    "n_frames_in_block_so_far": "types.block.n_so_far",
    "surface_fault_types.2.actuator.travel_low_rad": "types.surface.2.actuator.stop_lo",
    "surface_fault_types.2.actuator.travel_high_rad": "types.surface.2.actuator.stop_hi",
    "surface_fault_types.2.actuator.min_runaway_rate_rad_s": "types.surface.2.actuator.runaway",
    "surface_fault_types.2.actuator.slow_step_rad":
        "types.surface.2.actuator.slow_step",
    "surface_fault_types.2.actuator.approach_share":
        "types.surface.2.actuator.approach_share",
    "declared_bounds.eta_bar_rad_s2": "bound.eta_bar",
    "declared_bounds.changing_gyro_error_bound_rad_s": "bound.n_gyro",
    "declared_bounds.inertia_coupling_error_share": "bound.inertia_coupling_error_share",
    "declared_bounds.constant_error_rad_s2": "bound.const",
    "declared_bounds.earth_rate_rad_s": "bound.earth_rate_rad_s",
    "declared_bounds.constant_gyro_error_bound_rad_s": "bound.declared_errors.steady",
    "gust.gust_acceleration_rad_s2": "statistical.gust.output.acc",
    "mapped_error.error_bound_rad_s2": "bound.error_map.e_now",
    "acceleration_variance_from_input_noise": "statistical.noise.Q",
    "statistical_alarm_level": "statistical.test.alarm_level",
    "statistical_filters.1.drift_correlation_length_m": "statistical.block.1.drift_correlation_length_m",
    "statistical_filters.1.factor_on_gust_drift_intensity":
        "statistical.block.1.Q_scale",
    "statistical_filters.2.hypotheses.3.hypothesis_kind": "statistical.block.2.hypothesis.3.kind",
    "statistical_filters.2.hypotheses.3.surface": "statistical.block.2.hypothesis.3.surface",
    "statistical_filters.2.hypotheses.3.axis": "statistical.block.2.hypothesis.3.axis",
    "statistical_filters.2.hypotheses.3.score_in_std": "statistical.block.2.hypothesis.3.score",
    "sensor_monitor.worst_test_index": "sensor_monitor.output.worst_test_index",
    "sensor_monitor.top_ratio": "sensor_monitor.output.top_ratio",
    "sensor_monitor.worst_test.residual": "sensor_monitor.redundancy.test.2.residual",
    "sensor_monitor.worst_test.bound_per_s": "sensor_monitor.redundancy.test.2.bound_per_s",
    "sensor_monitor.worst_test.bound_per_sample": "sensor_monitor.redundancy.test.2.bound_per_sample",
    "sensor_monitor.worst_test.gust_gain":
        "sensor_monitor.redundancy.test.2.gust_gain",
    "sensor_monitor.worst_test.filtered_residual":
        "sensor_monitor.redundancy.test.2.r",
    "sensor_monitor.worst_test.filtered_bound": "sensor_monitor.redundancy.test.2.B",
    "sensor_monitor.isolated_sensor_index": "sensor_monitor.output.isolated_sensor",
    "sensor_monitor.sample_time_s": "sensor_monitor.redundancy.config.sample_time_s",
    "sensor_monitor.gust_change_mps":
        "sensor_monitor.redundancy.config.gust_change",
    "sensor_monitor.predicted_reading": "sensor_monitor.redundancy.memory.predicted_reading",
    "sensor_monitor.reading_bound": "sensor_monitor.redundancy.memory.reading_bound",
    "sensor_monitor.engine_commands":
        "sensor_monitor.redundancy.memory.engine_commands",
}  # fmt: skip


def of_record(record, path):
    for part in path.split("."):
        record = record[int(part) if part.isdigit() else part]
    return record


def of_readout(found, path):
    for part in path.split("."):
        found = found[int(part)] if part.isdigit() else getattr(found, part)
    return found


def put(record, path, value):
    *way, last = path.split(".")
    of_record(record, ".".join(way))[int(last) if last.isdigit() else last] = value


@pytest.fixture(scope="module")
def filled():
    fdi = fill(np.zeros(1, fdi_dtype(N_SURFACES))[0])
    fdi["isolation"]["config"]["n_estimators"] = N_ESTIMATORS
    fdi["sensor_monitor"]["output"]["worst_test_index"] = WORST_TEST
    blocks = fdi["statistical"]["block"]
    blocks["n_h"], blocks["n"], blocks["n_Z"] = N_HYPOTHESES, N_AXES, N_REGRESSORS
    return fdi


@pytest.fixture
def fdi(filled):
    return filled.copy()


def test_each_number_of_a_diagnosis_is_read_from_its_own_field_and_stays(fdi):
    given = {name: np.array(of_record(fdi, path)) for name, path in NUMBERS.items()}
    diagnosis = DiagnosisReadout(fdi)
    for name in NUMBERS:
        of_readout(diagnosis, name)  # it is kept from here
    for name in fdi.dtype.names:
        fdi[name] = np.zeros((), fdi.dtype[name])
    for name, value in given.items():
        assert np.array_equal(of_readout(diagnosis, name), value), name
        assert value.all(), name


def test_each_truth_value_of_a_diagnosis_is_read_from_its_own_field(fdi):
    """One after the other is false; all others stay true."""
    for off, path in FLAGS.items():
        kept = np.copy(of_record(fdi, path))
        put(fdi, path, 0)
        diagnosis = DiagnosisReadout(fdi)
        for name, other in FLAGS.items():
            assert of_readout(diagnosis, name) == (other != path), (off, name)
        put(fdi, path, kept)
