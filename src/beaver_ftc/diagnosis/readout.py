"""The diagnosis at one frame, as certificates, studies and integrations read it: values with names and units.

The layout of the records is the business of their stages alone. A readout copies each part when it is
first read, which does not change from then on. `fdi` is a record of `schemes.fdi_dtype`.
"""

from collections.abc import Callable
from functools import cached_property, reduce
from operator import getitem
from typing import Any, NamedTuple, TypeVar, get_type_hints

import numpy as np

from beaver_ftc.diagnosis.config import scheme_number
from beaver_ftc.diagnosis.detection.blocks import N_SLOTS

Read = TypeVar("Read")


class IsolationEstimator(NamedTuple):
    """An isolation estimator, of the hypothesis that one surface has lost effectiveness (kind LOSS) or is at
    a position (kind POSITION_HYPOTHESIS).

    theta_min, theta_max    known set of its parameter
    active_axes             the axes on which its residuals count
    parity_direction        (3,): direction in which the fault has no effect; 0 if the surface moves neither
                            roll nor yaw, or before the first frame
    """

    hypothesis_kind: int
    theta_min: float
    theta_max: float
    is_excluded: bool
    active_axes: tuple[int, ...]
    parity_direction: np.ndarray


class SurfaceLayout(NamedTuple):
    """Layout of the surfaces: the axis that each turns most, and the number of the estimator of its loss and
    of its position, -1 where there is none."""

    dominant_axis: tuple[int, ...]
    loss_estimator: tuple[int, ...]
    position_estimator: tuple[int, ...]


class FaultTypesConfig(NamedTuple):
    """How fault types are examined.

    single_instant      whether a frame, or block, shows one instant
    n_substeps          number of JSBSim frames in a frame
    returns_lagged      whether a released surface returns with the lag of its actuator
    frames_per_block    number of frames in a block, 1 if every frame is examined by itself
    block_duration_s    duration of a block
    """

    single_instant: bool
    n_substeps: int
    returns_lagged: bool
    frames_per_block: int
    block_duration_s: float


class Actuator(NamedTuple):
    """The actuator of a surface, as the fault types use it.

    travel_low_rad, travel_high_rad    the stops
    min_runaway_rate_rad_s             smallest rate of a hardover
    slow_step_rad                      smallest step of an instant under a rate-limit fault
    lag_distance_rad                   distance from the command within which steps may be smaller than that
    """

    travel_low_rad: float
    travel_high_rad: float
    min_runaway_rate_rad_s: float
    slow_step_rad: float
    lag_distance_rad: float


class SurfaceFaultTypes(NamedTuple):
    """The conclusion on the fault types of one surface: is_type_excluded (types,), and its actuator."""

    actuator: Actuator
    is_type_excluded: np.ndarray


class DeclaredBounds(NamedTuple):
    """The declared uncertainty, by axis (3,).

    eta_bar_rad_s2         bound on the model's error, mean over the frame
    gyro_change_rad_s      bound on the changing part of a gyro's error
    coupling_share,
    constant_rad_s2        the c and b of eta_bar (bounds.py)
    earth_rate_rad_s       rate of the Earth, a scalar
    gyro_error_rad_s,
    gyro_slope             e_0, e_1: the error of a gyro is at most e_0 + e_1 |rate|
    gyro_constant_rad_s    the part of e_0 that does not change

    The last three are 0 if no error is declared.
    """

    eta_bar_rad_s2: np.ndarray
    gyro_change_rad_s: np.ndarray
    coupling_share: np.ndarray
    constant_rad_s2: np.ndarray
    earth_rate_rad_s: float
    gyro_error_rad_s: np.ndarray
    gyro_slope: np.ndarray
    gyro_constant_rad_s: np.ndarray


class GustReadout(NamedTuple):
    """is_turbulence_declared: whether turbulence is declared; subtracts_measured_gust: whether the effect of
    the gust that the vanes measure is subtracted from the innovation; in still air that effect is zero."""

    is_turbulence_declared: bool
    subtracts_measured_gust: bool


class StatisticalHypothesis(NamedTuple):
    """A fault that the statistical test compares with health.

    kind               LOSS, or a kind of blocks.py
    surface, axis      numbers of its surface, or -1, and of its axis
    may_raise_alarm    whether its score counts for the alarm
    score_in_std       largest normalised evidence over all onsets, standard deviations, as the alarm level
    """

    kind: int
    surface: int
    axis: int
    may_raise_alarm: bool
    score_in_std: float


class OnsetTests(NamedTuple):
    """Tests by hypothesis and onset, (hypotheses, N_SLOTS) each.

    score          normalised evidence, standard deviations
    sign           sign of the correlation N that supports the hypothesis, 0: either
    calm_part      part of N that air calmer than declared explains
    coarse_part    part of N that a gust explains which vanes show coarsely
    """

    score: np.ndarray
    sign: np.ndarray
    calm_part: np.ndarray
    coarse_part: np.ndarray


class StatisticalBlock(NamedTuple):
    """One Kalman filter of the statistical detector and the hypotheses on its axes.

    axes                  the axes of its states
    drift_length_m        length over which the drift returns to zero, 0 for a random walk
    gust_drift_factor     Q_scale, on the intensity of the drift by gusts
    tolerance             (regressors,): bound on each unknown constant
    hypotheses, onset_tests
    """

    axes: tuple[int, ...]
    drift_length_m: float
    gust_drift_factor: float
    tolerance: np.ndarray
    hypotheses: tuple[StatisticalHypothesis, ...]
    onset_tests: OnsetTests


class SensorTest(NamedTuple):
    """One redundancy test of the sensor monitor, in the unit of its residual.

    residual                             residual of the last sample
    bound_per_s, bound_per_sample        parts of the bound on it: h times the first, and the second for this
                                         sample and for the one before
    gust_gain                            effect on it of a gust that changes by 1 m/s
    filtered_residual, filtered_bound    (poles,): residual and bound through the filters
    """

    residual: float
    bound_per_s: float
    bound_per_sample: float
    gust_gain: float
    filtered_residual: np.ndarray
    filtered_bound: np.ndarray


class SensorMonitor(NamedTuple):
    """The sensor monitor.

    enabled, has_raised_alarm      whether it runs; whether its own alarm stands
    worst_test_index, top_ratio    test with the largest ratio of residual to bound, and that ratio
    isolated_sensor_index          the isolated sensor, or -1
    sample_time_s                  time between two samples
    gust_change_mps                (poles,): bound on the changes of a gust through the filters
    predicted_reading,
    reading_bound                  (sensors,), SI: prediction, of the engine its commands; bound on the error
    worst_test                     residual and bounds of the test with the largest ratio
    is_reading_unused              (sensors,): whether the reading is no longer used
    """

    enabled: bool
    has_raised_alarm: bool
    worst_test_index: int
    top_ratio: float
    isolated_sensor_index: int
    sample_time_s: float
    gust_change_mps: np.ndarray
    predicted_reading: np.ndarray
    reading_bound: np.ndarray
    worst_test: SensorTest
    is_reading_unused: np.ndarray


def value(kind: Callable[[Any], Read], *path: str | int) -> cached_property[Read]:
    """A property of a readout: one value of a kind, at a path of names and numbers in its record."""
    return cached_property(lambda readout: kind(reduce(getitem, path, readout._record)))


class Readout:
    """Values of a record, each copied when it is read first, so a readout is for one frame."""

    def __init__(self, record: np.void) -> None:
        self._record = record


class DiagnosisReadout(Readout):
    """The diagnosis at one frame; the classes above document the values.

    enabled, scheme_number       whether the diagnosis runs; number of its scheme (`config.scheme_number`)
    diagnoses_all_types          whether it examines faults of every type
    detected, detected_at_s      whether the alarm of the surfaces stands; when it was raised, s
    isolated_estimator           number of the estimator whose fault is isolated, NOT_ISOLATED or
                                 UNANTICIPATED
    frames_so_far                frames that the block in progress has so far
    statistical_alarm_level      statistic at which the statistical detector raises its alarm, standard
                                 deviations
    input_noise_variance         variance of the acceleration by the noise of the model's own inputs and of
                                 the gust estimate, (3,) (rad/s2)^2
    """

    enabled = value(bool, "config", "enabled")
    scheme_number = value(int, "config", "scheme_number")
    diagnoses_all_types = value(bool, "config", "diagnoses_all_types")
    detected = value(bool, "verdict", "detected")
    detected_at_s = value(float, "verdict", "detected_at_s")
    isolated_estimator = value(int, "verdict", "isolated_estimator")
    frames_so_far = value(int, "types", "block", "n_so_far")
    statistical_alarm_level = value(float, "statistical", "test", "alarm_level")
    input_noise_variance = value(np.array, "statistical", "noise", "Q")

    @cached_property
    def layout(self) -> SurfaceLayout:
        """Axes and estimators of the surfaces."""
        paths = {"loss_estimator": "loss", "position_estimator": "position"}
        return _read(SurfaceLayout, self._record["layout"], **paths)

    @cached_property
    def is_estimator_excluded(self) -> np.ndarray:
        """(estimators,): whether each is excluded."""
        return estimator_records(self._record)["excluded"].astype(bool)

    @cached_property
    def estimators(self) -> tuple[IsolationEstimator, ...]:
        """The isolation estimators, in the bank's order; none where another scheme isolates."""
        return tuple(map(_read_estimator, estimator_records(self._record)))

    @cached_property
    def types_config(self) -> FaultTypesConfig:
        """How fault types are examined."""
        return _read(FaultTypesConfig, self._record["types"]["config"])

    @cached_property
    def surface_fault_types(self) -> tuple[SurfaceFaultTypes, ...]:
        """Return for each surface its actuator and the types excluded on it."""
        return tuple(map(_read_surface, self._record["types"]["surface"]))

    @cached_property
    def declared_bounds(self) -> DeclaredBounds:
        """The declared uncertainty."""
        errors = self._record["bound"]["declared_errors"]
        e_0, e_1, constant = (errors[name][:3] * bool(errors["given"]) for name in ("e0", "e1", "steady"))
        return _read(
            DeclaredBounds, self._record["bound"], eta_bar_rad_s2="eta_bar", gyro_change_rad_s="n_gyro",
            constant_rad_s2="const", gyro_error_rad_s=e_0, gyro_slope=e_1, gyro_constant_rad_s=constant,
        )  # fmt: skip

    @cached_property
    def gust(self) -> GustReadout:
        """Gusts as the vanes see them."""
        paths = {"is_turbulence_declared": "gusty", "subtracts_measured_gust": "measured"}
        return _read(GustReadout, self._record["statistical"]["gust"]["output"], **paths)

    @cached_property
    def statistical_filters(self) -> tuple[StatisticalBlock, ...]:
        """The filters of the statistical detector."""
        return tuple(map(_read_block, self._record["statistical"]["block"]))

    @cached_property
    def sensor_monitor(self) -> SensorMonitor:
        """The sensor monitor."""
        return _read_sensor_monitor(self._record["sensor_monitor"])


def estimator_records(fdi: np.void) -> np.ndarray:
    """The records of the estimators there are, not a copy."""
    isolation = fdi["isolation"]
    return np.asarray(isolation["estimator"][: int(isolation["config"]["n_estimators"])])


def switch_statistical_tests(fdi: np.void, is_enabled: bool) -> None:
    """Switch the statistical tests on or off, for every scheme."""
    fdi["statistical"]["test"]["enabled"] = is_enabled


def disable_diagnosis(fdi: np.void) -> None:
    """Stop the built-in diagnosis of surfaces and sensors from the next frame on: scheme `none` is in charge
    then. A plug-in goes on."""
    if fdi["config"]["enabled"]:
        fdi["config"]["scheme_number"] = scheme_number("none")
    fdi["config"]["enabled"] = fdi["sensor_monitor"]["config"]["enabled"] = False


# State, covariances and inputs of a filter of the statistical detector, of which a certificate wants the
# frames up to the alarm.
RECORDED_BLOCK_FIELDS = (
    "a", "eta_rate", "state", "P_xx", "P_xd", "P_dd",
    "Q_d", "Q_x", "R_y", "p",
    "g_c", "x_Z", "g_Z",
)  # fmt: skip


def certificate_arrays(
    fdi: np.void, n_estimators: int, diagnoses_all_types: bool, has_statistical_detector: bool
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """The arrays of which a certificate wants every frame, and those of which it wants the frames up to the
    alarm; not copies.

    Every frame:

        offset, slope, spread     h, Z, r of each estimator's fault, (n_estimators, 3) rad/s2
        excluded, types           whether each estimator, and each type on each surface, is excluded
        command_low, _high        fault class `all` only: least and greatest command of each surface, rad
        least, greatest           the same of the position of a healthy surface, rad

    Up to the alarm:

        reach_low, reach_high     L and U of each estimator's fault, (n_estimators, MAX_POLES, 4) rad/s
        RECORDED_BLOCK_FIELDS     of each filter of the statistical detector
        signature, bounded        of its hypotheses, rad/s2; bound eta of its rates, (3,) rad/s2
        air, leap                 gust estimate: acc_mean, (3,) rad/s2, and var_turn, (3, 3) (rad/s2)2
    """
    est = fdi["isolation"]["estimator"][:n_estimators]
    srf = fdi["types"]["surface"]
    always = _columns(est["effect"], offset="h", slope="Z", spread="r")
    always |= _columns(est, excluded="excluded") | _columns(srf["sets"], types="excluded")
    if diagnoses_all_types:
        ends = {"command_low": "cmd_min", "command_high": "cmd_max", "least": "u_min", "greatest": "u_max"}
        always |= _columns(srf["commands"], **ends)
    early = _columns(est, reach_low="reach_lo", reach_high="reach_hi")
    if has_statistical_detector:
        stat = fdi["statistical"]
        blk = stat["block"]
        early |= {name: blk[name] for name in RECORDED_BLOCK_FIELDS}
        early |= _columns(blk["hypothesis"], signature="signature")
        early["bounded"] = stat["rows"]["eta"][0, :3]
        early |= _columns(stat["gust"]["output"], air="acc_mean", leap="var_turn")
    return always, early


def _columns(record: np.void | np.ndarray, **fields: str) -> dict[str, np.ndarray]:
    """Fields of a record, or of an array of records, by the names that a certificate gives them."""
    return {name: record[field] for name, field in fields.items()}


def alarm_flags(fdi: np.void) -> tuple[np.int64, np.int64]:
    """(surfaces, sensors): whether the alarm of a surface fault stands, and that of the sensor monitor."""
    return fdi["verdict"]["detected"], fdi["sensor_monitor"]["output"]["alarmed"]


def _read(kind: type[Read], record: np.void, **given: Any) -> Read:
    """An object of a class. Each field is a copy of the record's field of this name, or of that at the path
    that is given for it (`a.b`: field b of field a), in the type of the field; or it is another given value.
    """

    def one(name: str, hint: Any) -> Any:
        found = given.get(name, name)
        if not isinstance(found, str):
            return found
        return _COPIES.get(hint, hint)(reduce(getitem, found.split("."), record))

    return kind(**{name: one(name, hint) for name, hint in get_type_hints(kind).items()})


_COPIES: dict[Any, Callable[[Any], Any]] = {
    np.ndarray: np.array, tuple[int, ...]: lambda values: tuple(values.tolist())
}  # fmt: skip


def _read_estimator(fie: np.void) -> IsolationEstimator:
    axes = tuple(np.flatnonzero(fie["skip"] == 0).tolist())
    return _read(IsolationEstimator, fie, is_excluded="excluded", active_axes=axes)


def _read_surface(srf: np.void) -> SurfaceFaultTypes:
    actuator = _read(
        Actuator, srf["actuator"], travel_low_rad="stop_lo", travel_high_rad="stop_hi",
        min_runaway_rate_rad_s="runaway", slow_step_rad="slow_step", lag_distance_rad="near",
    )  # fmt: skip
    return SurfaceFaultTypes(actuator, srf["sets"]["excluded"].astype(bool))


def _read_block(blk: np.void) -> StatisticalBlock:
    hypotheses = tuple(
        _read(StatisticalHypothesis, hyp, may_raise_alarm="alarms", score_in_std="score")
        for hyp in blk["hypothesis"][: blk["n_h"]]
    )
    n = len(hypotheses)
    names = {"score": "score", "sign": "sign", "calm_part": "N_p", "coarse_part": "N_c"}
    tests = {field: blk["tests"][name].reshape(-1, N_SLOTS)[:n].copy() for field, name in names.items()}
    return _read(
        StatisticalBlock, blk, axes=tuple(blk["axes"][: blk["n"]].tolist()),
        gust_drift_factor="Q_scale",
        tolerance=blk["tol"][: blk["n_Z"]].copy(), hypotheses=hypotheses, onset_tests=OnsetTests(**tests),
    )  # fmt: skip


def _read_sensor_monitor(mon: np.void) -> SensorMonitor:
    output = mon["output"]
    names = {
        "residual": "residual", "bound_per_s": "per_s", "bound_per_sample": "per_sample", "gust_gain": "gust",
        "filtered_residual": "r", "filtered_bound": "B",
    }  # fmt: skip
    worst = {field: mon["tests"][name][output["worst_test_index"]].copy() for field, name in names.items()}
    return _read(
        SensorMonitor, mon, enabled="config.enabled", has_raised_alarm="output.alarmed",
        worst_test_index="output.worst_test_index", top_ratio="output.top_ratio",
        isolated_sensor_index="output.isolated_sensor", sample_time_s="config.h",
        gust_change_mps="air.gust_change", predicted_reading="sample.y_pred", reading_bound="errors.e",
        worst_test=SensorTest(**worst), is_reading_unused=output["is_reading_unused"].astype(bool),
    )  # fmt: skip
