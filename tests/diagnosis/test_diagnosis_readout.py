"""Each number of the diagnosis is read from its own field of the record: no two numbers in it are alike."""

from collections.abc import Mapping

import numpy as np
import pytest

from beaver_ftc.diagnosis import readout
from beaver_ftc.diagnosis.readout import DiagnosisReadout
from beaver_ftc.diagnosis.schemes import fdi_dtype
from beaver_ftc.diagnosis.state import scheme_number
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


def test_inside_of_the_map_is_not_outside_of_all_boxes(fdi):
    assert not DiagnosisReadout(fdi).mapped_error.is_inside_map
    fdi["bound"]["error_map"]["outside"] = 0
    assert DiagnosisReadout(fdi).mapped_error.is_inside_map


def test_there_are_as_many_parts_as_the_record_counts(fdi):
    fdi["isolation"]["estimator"][1]["skip"] = (0, 1, 0)
    diagnosis = DiagnosisReadout(fdi)
    assert len(diagnosis.estimators) == len(diagnosis.is_estimator_excluded) == N_ESTIMATORS
    assert [one.active_axes for one in diagnosis.estimators] == [(), (0, 2), (), ()]
    assert len(diagnosis.surface_fault_types) == N_SURFACES
    blocks = fdi["statistical"]["block"]
    for found, block, n_axes, n_hypotheses, n_regressors in zip(
        diagnosis.statistical_filters, blocks, N_AXES, N_HYPOTHESES, N_REGRESSORS, strict=True
    ):
        assert found.axis_indices == tuple(block["axes"][:n_axes])
        tolerances = found.regressor_coefficient_error_bound
        assert tolerances.tolist() == block["tol"][:n_regressors].tolist()
        assert [one.score_in_std for one in found.hypotheses] == block["hypothesis"]["score"][
            :n_hypotheses
        ].tolist()
        by_onset, tests = found.hypothesis_tests_by_onset, block["tests"]
        for name, field in {
            "score": "score",
            "supporting_correlation_sign": "supporting_correlation_sign",
            "correlation_predictable_in_calm_air": "N_p",
            "correlation_from_coarse_gust": "correlation_from_coarse_gust",
        }.items():
            shown, in_record = getattr(by_onset, name), tests[field].ravel()
            assert shown.shape == (n_hypotheses, readout.N_SLOTS), name
            assert shown.ravel().tolist() == in_record[: shown.size].tolist(), name


def test_gyros_have_bounds_where_errors_are_declared(fdi):
    errors = fdi["bound"]["declared_errors"]
    found = DiagnosisReadout(fdi).declared_bounds
    at_rest = found.gyro_error_bound_at_rest_rad_s.tolist()
    assert at_rest == errors["e0"][:3].tolist()
    assert found.gyro_error_bound_per_rate.tolist() == errors["e1"][:3].tolist()
    errors["given"] = 0
    none = DiagnosisReadout(fdi).declared_bounds
    for name in (
        "gyro_error_bound_at_rest_rad_s",
        "constant_gyro_error_bound_rad_s",
        "gyro_error_bound_per_rate",
    ):
        assert getattr(none, name).tolist() == [0.0, 0.0, 0.0]
    assert none.eta_bar_rad_s2.tolist() == found.eta_bar_rad_s2.tolist()


# What a certificate wants of each frame, by the name it has there; of the estimators the first two.
OF_EVERY_FRAME = {
    "eta_bar": "bound.eta_bar", "noise": "bound.n_gyro",
    "offset": "isolation.estimator.effect.base",
    "slope": "isolation.estimator.effect.regressor",
    "spread": "isolation.estimator.effect.e",
    "excluded": "isolation.estimator.excluded", "types": "types.surface.sets.excluded",
}  # fmt: skip
OF_EVERY_TYPE = {
    "command_low": "types.surface.commands.cmd_min",
    "command_high": "types.surface.commands.cmd_max",
    "least": "types.surface.commands.u_min",
    "greatest": "types.surface.commands.u_max",
}
UNTIL_THE_ALARM = {
    "reach_low": "isolation.estimator.reach_lo",
    "reach_high": "isolation.estimator.reach_hi",
}
OF_THE_STATISTICAL_DETECTOR = {name: f"statistical.block.{name}" for name in (
    "a", "eta_rate", "state", "P_xx", "P_xd", "P_dd",
    "Q_d", "Q_x", "R_y", "p",
    "g_c", "x_Z", "g_Z",
)} | {
    "signature": "statistical.block.hypothesis.signature",
    "bounded": "statistical.noise.eta",
    "air": "statistical.gust.output.acc_mean",
    "leap": "statistical.gust.output.var_turn",
}  # fmt: skip


@pytest.mark.parametrize("more", [False, True])
def test_a_certificate_takes_each_array_from_its_own_field(fdi, more):
    def held(found: Mapping[str, np.ndarray], paths: Mapping[str, str]):
        assert set(found) == set(paths)
        for name, path in paths.items():
            wanted = of_record(fdi, path)
            wanted = wanted[:2] if path.startswith("isolation.estimator.") else wanted
            assert np.array_equal(found[name], wanted), name
            assert np.shares_memory(found[name], fdi), name

    every = readout.frame_arrays(fdi, 2, more)
    held(every, OF_EVERY_FRAME | (OF_EVERY_TYPE if more else {}))
    early = readout.alarm_arrays(fdi, 2, more)
    held(early, UNTIL_THE_ALARM | (OF_THE_STATISTICAL_DETECTOR if more else {}))


def test_alarms_are_those_of_the_surfaces_and_of_the_sensors(fdi):
    fdi["verdict"]["detected"], fdi["sensor_monitor"]["output"]["alarmed"] = 1, 0
    assert readout.alarm_flags(fdi) == (1, 0)


@pytest.mark.parametrize(("enabled", "scheme"), [(1, "none"), (0, None)])
def test_a_diagnosis_that_is_stopped_is_none(fdi, enabled, scheme):
    """Of a plug-in, which goes on, the scheme stays what it is."""
    fdi["config"]["enabled"], before = enabled, int(fdi["config"]["scheme_number"])
    readout.disable_diagnosis(fdi)
    assert fdi["config"]["scheme_number"] == (before if scheme is None else scheme_number(scheme))
    assert (fdi["config"]["enabled"], fdi["sensor_monitor"]["config"]["enabled"]) == (0, 0)


@pytest.mark.parametrize("enabled", [False, True])
def test_statistical_tests_are_switched_alone(fdi, enabled):
    before = fdi.copy()
    readout.switch_statistical_tests(fdi, enabled)
    assert fdi["statistical"]["test"]["enabled"] == enabled
    before["statistical"]["test"]["enabled"] = enabled
    assert fdi == before
