"""The diagnosis at one frame, as certificates, studies and integrations read it: values with names and units.

The layout of the records is the business of their stages alone. A readout copies what it returns: it does not
change when the flight goes on. `fdi` is a record of `schemes.diagnosis_dtype`.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from beaver_ftc.diagnosis.detection.likelihood import N_SLOTS
from beaver_ftc.diagnosis.state import scheme_number


class Estimator(NamedTuple):
    """An isolation estimator, of the hypothesis that one surface has lost effectiveness (kind LOSS) or is at
    a position (kind POSITION).

    low, high: known set of its parameter. axes: those on which its residuals count. parity_direction (3,):
    direction in which the fault has no effect, zero where it is not used.
    """

    kind: int
    low: float
    high: float
    excluded: bool
    axes: tuple[int, ...]
    parity_direction: np.ndarray


class Layout(NamedTuple):
    """Of each surface the axis that it turns most, and the number of the estimator of its loss and of its
    position, -1 where there is none."""

    dominant_axis: tuple[int, ...]
    loss_estimator: tuple[int, ...]
    position_estimator: tuple[int, ...]


class TypesConfig(NamedTuple):
    """How fault types are examined.

    single_instant: a frame, or block, shows one instant. instants: JSBSim frames in a frame. returns: a
    released surface returns by its actuator. half_cycle_frames: blocks in half of the slowest oscillation.
    block_frames: frames in a block, 1 where every frame is examined by itself; block_s: its duration.
    """

    single_instant: bool
    instants: int
    returns: bool
    half_cycle_frames: int
    block_frames: int
    block_s: float
    dt_s: float


class Actuator(NamedTuple):
    """The actuator of a surface as fault types take it; rad, rad/s.

    least_runaway_rad_s: of a hardover. slowest_step_rad: of a rate limit, in an instant. approach: share of
    the way to the command that is made in an instant.
    """

    travel_low_rad: float
    travel_high_rad: float
    least_runaway_rad_s: float
    slowest_step_rad: float
    approach: float


class SurfaceTypes(NamedTuple):
    """What is concluded of the types of fault on one surface: excluded (types,), and its actuator."""

    actuator: Actuator
    excluded: np.ndarray


class Bound(NamedTuple):
    """The declared uncertainty, by axis (3,).

    eta_bar_rad_s2: bound on the model's error over the frame; noise_rad_s: change of a rate's reading by
    errors of its gyro. inertia: share of the inertial coupling; constant_rad_s2; earth_rate_rad_s. Of gyros:
    error offset + slope |rate|, of the offset what does not change, steady; zero where none is declared.
    """

    eta_bar_rad_s2: np.ndarray
    noise_rad_s: np.ndarray
    inertia: np.ndarray
    constant_rad_s2: np.ndarray
    earth_rate_rad_s: float
    gyro_offset_rad_s: np.ndarray
    gyro_steady_rad_s: np.ndarray
    gyro_slope: np.ndarray


class Air(NamedTuple):
    """Gusts as the vanes see them. moving: turbulence is declared; seen: its effect is subtracted from the
    innovation; acceleration_rad_s2 (3,): what the gust does now."""

    moving: bool
    seen: bool
    acceleration_rad_s2: np.ndarray


class MappedError(NamedTuple):
    """The design model's error where the aircraft is now, from the map that the aircraft declares: whether
    the map covers the place, and its bound (3,) rad/s2."""

    known: bool
    bound_rad_s2: np.ndarray


class Hypothesis(NamedTuple):
    """A fault that the statistical test compares with health.

    kind: of `likelihood`; surface, axis: which. raises_alarm: whether it may raise the alarm. score: largest
    log likelihood ratio over all onsets, in the unit of the alarm level.
    """

    kind: int
    surface: int
    axis: int
    raises_alarm: bool
    score: float


class Lanes(NamedTuple):
    """By hypothesis and onset (hypotheses, N_SLOTS): score, direction of the loss that is tested (0: either),
    and the part of the correlation that calm air and that gusts seen by the vanes explain."""

    score: np.ndarray
    sense: np.ndarray
    calm_prediction: np.ndarray
    gust_response: np.ndarray


class Block(NamedTuple):
    """One Kalman filter of the statistical detector and the hypotheses on its axes.

    axes: of its states. return_length: of the drift, m; 0 for none. drift_scale: factor on the variance of a
    gust seen roughly. tolerance (regressors,): of the constants that are not known, 0 for one not used.
    """

    axes: tuple[int, ...]
    return_length: float
    drift_scale: float
    tolerance: np.ndarray
    hypotheses: tuple[Hypothesis, ...]
    lanes: Lanes


class SensorTest(NamedTuple):
    """One redundancy test of the sensor monitor.

    residual, of the elapsed step; filtered and bound (poles,): through the filters. rate, noise: part of the
    bound that grows with time (per s) and that does not; air: share of `gust_change_bound` in it.
    """

    residual: float
    rate: float
    noise: float
    air: float
    filtered: np.ndarray
    bound: np.ndarray


class SensorMonitor(NamedTuple):
    """The sensor monitor. enabled; alarmed: an alarm of its own stands.

    largest_test: number of the test nearest its bound, share: how near, 1 at the bound; test: its numbers.
    named: number of the sensor that is named, -1 for none; replaced (sensors,): readings not used any more.
    step_s; gusts (poles,): a gust's changes through the filters. predicted, error (sensors,): readings as
    redundancy predicts them, and how far off each may be. engine (2,): speed rpm, manifold pressure inHg, as
    the command predicts them. SI otherwise.
    """

    enabled: bool
    alarmed: bool
    largest_test: int
    share: float
    test: SensorTest
    named: int
    replaced: np.ndarray
    step_s: float
    gusts: np.ndarray
    predicted: np.ndarray
    error: np.ndarray
    engine: np.ndarray


class DiagnosisReadout:
    """The diagnosis at the frame in which it is read first; see the types of what it returns."""

    def __init__(self, fdi: np.void) -> None:
        self._fdi = fdi

    @cached_property
    def enabled(self) -> bool:
        """Whether it runs."""
        return bool(self._fdi["config"]["enabled"])

    @cached_property
    def scheme(self) -> int:
        """Place of its scheme, as `state.scheme_number` says."""
        return int(self._fdi["config"]["scheme"])

    @cached_property
    def every_type(self) -> bool:
        """Whether it examines faults of every type."""
        return bool(self._fdi["config"]["every_type"])

    @cached_property
    def detected(self) -> bool:
        """Whether the alarm of the surfaces stands."""
        return bool(self._fdi["verdict"]["detected"])

    @cached_property
    def detected_at_s(self) -> float:
        """When that alarm was raised, s."""
        return float(self._fdi["verdict"]["detected_at_s"])

    @cached_property
    def isolated(self) -> int:
        """Number of the estimator whose fault is isolated; NOT_ISOLATED or UNANTICIPATED of `state`."""
        return int(self._fdi["verdict"]["isolated"])

    @cached_property
    def layout(self) -> Layout:
        """Axes and estimators of the surfaces."""
        return Layout(*(tuple(self._fdi["layout"][name].tolist()) for name in Layout._fields))

    @cached_property
    def excluded(self) -> np.ndarray:
        """(estimators,): whether each is excluded."""
        return estimators_of(self._fdi)["excluded"].astype(bool)

    @cached_property
    def estimators(self) -> tuple[Estimator, ...]:
        """The isolation estimators, in the bank's order; none where another scheme isolates."""
        return tuple(map(_estimator, estimators_of(self._fdi)))

    @cached_property
    def types_config(self) -> TypesConfig:
        """How fault types are examined."""
        config = self._fdi["types"]["config"]
        return TypesConfig(
            bool(config["whole"]), int(config["instants"]), bool(config["released_returns"]),
            int(config["half_cycle_frames"]),
            int(config["length"]), float(config["block_s"]), float(config["dt"]),
        )  # fmt: skip

    @cached_property
    def frames_in_block(self) -> int:
        """Frames that the block in progress has so far."""
        return int(self._fdi["types"]["block"]["filled"])

    @cached_property
    def surfaces(self) -> tuple[SurfaceTypes, ...]:
        """Of each surface its actuator, and which types are excluded on it."""
        return tuple(map(_surface, self._fdi["types"]["surface"]))

    @cached_property
    def bound(self) -> Bound:
        """The declared uncertainty."""
        bound = self._fdi["bound"]
        declared_errors = bound["declared_errors"]
        known = bool(declared_errors["any"])
        offset, steady, slope = (
            declared_errors[name][:3].copy() if known else np.zeros(3)
            for name in ("offset", "steady", "slope")
        )
        return Bound(
            eta_bar_rad_s2=bound["eta_bar"].copy(), noise_rad_s=bound["noise"].copy(),
            inertia=bound["inertia"].copy(), constant_rad_s2=bound["constant"].copy(),
            earth_rate_rad_s=float(bound["earth_rate"]), gyro_offset_rad_s=offset, gyro_steady_rad_s=steady,
            gyro_slope=slope,
        )  # fmt: skip

    @cached_property
    def air(self) -> Air:
        """Gusts as the vanes see them."""
        air = self._fdi["statistical"]["air"]["output"]
        return Air(bool(air["moving"]), bool(air["measures_gust"]), air["acceleration"].copy())

    @cached_property
    def mapped_error(self) -> MappedError:
        """The design model's error here, where the aircraft maps it."""
        error = self._fdi["bound"]["error_map"]
        return MappedError(not error["outside"], error["now"].copy())

    @cached_property
    def model_noise(self) -> np.ndarray:
        """Variance of the noise of the model's own inputs, (3,) (rad/s2)^2."""
        return np.array(self._fdi["statistical"]["noise"]["jitter"])

    @cached_property
    def alarm_level(self) -> float:
        """Log likelihood ratio at which the statistical detector raises its alarm."""
        return float(self._fdi["statistical"]["tests"]["alarm_level"])

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """The filters of the statistical detector."""
        return tuple(map(_block, self._fdi["statistical"]["block"]))

    @cached_property
    def sensor_monitor(self) -> SensorMonitor:
        """The sensor monitor."""
        return read_sensor_monitor(self._fdi["sensor_monitor"])


def estimators_of(fdi: np.void) -> np.ndarray:
    """The records of the estimators there are, not a copy."""
    isolation = fdi["isolation"]
    return np.asarray(isolation["estimator"][: int(isolation["config"]["n"])])


def run_statistical_tests(fdi: np.void, enabled: bool) -> None:
    """Switch the statistical tests on or off, for every scheme."""
    fdi["statistical"]["tests"]["enabled"] = enabled


def disable(fdi: np.void) -> None:
    """Stop the built-in diagnosis of surfaces and sensors from the next frame on: scheme `none` is in charge
    then. A plug-in goes on."""
    if fdi["config"]["enabled"]:
        fdi["config"]["scheme"] = scheme_number("none")
    fdi["config"]["enabled"] = fdi["sensor_monitor"]["config"]["enabled"] = False


def recorded_always(fdi: np.void, n: int, every_type: bool) -> dict[str, np.ndarray]:
    """The arrays of which a certificate wants every frame, not copies; n: how many estimators there are.

    eta_bar, noise: as of `Bound`. offset, slope, spread (n, 3): effect of each hypothesis' fault. excluded,
    types: what is excluded. Of faults of every type: least and greatest order to each surface, and position
    of a healthy one, rad.
    """
    estimators, surfaces = fdi["isolation"]["estimator"][:n], fdi["types"]["surface"]
    views = {
        "eta_bar": fdi["bound"]["eta_bar"], "noise": fdi["bound"]["noise"],
        "offset": estimators["effect"]["offset"], "slope": estimators["effect"]["Z"],
        "spread": estimators["effect"]["spread"], "excluded": estimators["excluded"],
        "types": surfaces["feasible"]["excluded"],
    }  # fmt: skip
    if every_type:
        commands = surfaces["commands"]
        views |= {"command_low": commands["low"], "command_high": commands["high"]}
        views |= {name: commands[name] for name in ("least", "greatest")}
    return views


# State, covariances and inputs of a filter of the statistical detector, of which a certificate wants the
# frames up to the alarm.
OF_BLOCK = (
    "keep", "pace", "state", "P_xx", "P_xd", "P_dd", "drift", "jitter", "noise", "calm_prediction",
    "gust_response", "regressor_state", "regressor_response",
)  # fmt: skip


def recorded_until_alarm(fdi: np.void, n: int, statistical: bool) -> dict[str, np.ndarray]:
    """The arrays of which a certificate wants the frames up to the alarm, not copies; n: as above.

    reach_low, reach_high: what each hypothesis' fault can have done to the detection filters. Of the
    statistical detector: OF_BLOCK of each filter, signatures of its hypotheses, what is bounded besides, and
    the gust as the vanes see it.
    """
    views = {name: fdi["isolation"]["estimator"][name][:n] for name in ("reach_low", "reach_high")}
    if statistical:
        detector = fdi["statistical"]
        blocks, air = detector["block"], detector["air"]["output"]
        views |= {name: blocks[name] for name in OF_BLOCK}
        views |= {"signature": blocks["hypothesis"]["signature"], "bounded": detector["noise"]["bounded"]}
        views |= {"air": air["mean"], "leap": air["turn_variance"]}
    return views


def alarm_flags(fdi: np.void) -> tuple[np.int64, np.int64]:
    """Whether the alarm of the surfaces stands, and that of the sensor monitor."""
    return fdi["verdict"]["detected"], fdi["sensor_monitor"]["output"]["alarmed"]


def _estimator(fie: np.void) -> Estimator:
    axes = tuple(np.flatnonzero(fie["ignored_axes"] == 0).tolist())
    ends = float(fie["low"]), float(fie["high"])
    return Estimator(int(fie["kind"]), *ends, bool(fie["excluded"]), axes, fie["parity_direction"].copy())


def _surface(surface: np.void) -> SurfaceTypes:
    names = "travel_low", "travel_high", "least_runaway_rate", "slowest_step", "approach"
    actuator = Actuator(*(float(surface["actuator"][name]) for name in names))
    return SurfaceTypes(actuator, surface["feasible"]["excluded"].astype(bool))


def _block(block: np.void) -> Block:
    hypotheses = tuple(map(_hypothesis, block["hypothesis"][: block["n_hypotheses"]]))
    n = len(hypotheses)
    lanes = (block["lanes"][name].reshape(-1, N_SLOTS)[:n].copy() for name in Lanes._fields)
    return Block(
        tuple(block["axis"][: block["n"]].tolist()),
        float(block["return_length"]), float(block["drift_scale"]),
        block["tolerance"][: block["n_regressors"]].copy(), hypotheses, Lanes(*lanes),
    )  # fmt: skip


def _hypothesis(one: np.void) -> Hypothesis:
    numbers = int(one["kind"]), int(one["surface"]), int(one["axis"])
    return Hypothesis(*numbers, bool(one["raises_alarm"]), float(one["score"]))


def read_sensor_monitor(monitor: np.void) -> SensorMonitor:
    """The sensor monitor, of its record (dtype `SENSOR_MONITOR`)."""
    output, config, memory = monitor["output"], monitor["step"]["config"], monitor["step"]["memory"]
    largest_test = int(output["largest_test"])
    test = monitor["step"]["test"][largest_test]
    residual, rate, noise, air = (float(test[name]) for name in ("residual", "rate", "noise", "air"))
    of_test = SensorTest(residual, rate, noise, air, test["filtered"].copy(), test["bound"].copy())
    return SensorMonitor(
        bool(monitor["config"]["enabled"]), bool(output["alarmed"]), largest_test, float(output["share"]),
        of_test, int(output["named"]),
        output["replaced"].astype(bool), float(config["h"]), config["gust_change_bound"].copy(),
        memory["predicted"].copy(), memory["error"].copy(), memory["command"].copy(),
    )  # fmt: skip
