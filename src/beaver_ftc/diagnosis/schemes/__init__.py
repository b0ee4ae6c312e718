"""The diagnosis as a whole: its record, its configuration, and the kernels of the scheme in charge.

`begin_scheme`, `advance_estimators_to_frame`, `update_verdict`, `prepare_next_frame` and
`accumulate_substep` say which kernels fly for which scheme, in the order in which the frame (loop/frame.py)
calls them.

Arguments of the kernels: fdi, of `fdi_dtype`; prediction, of `model_prediction.prediction_dtype`; measured,
the readings of the sensors; k, number of the frame; t s, its time.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from beaver_ftc.compiled import apart, fill, kernel, record, sized
from beaver_ftc.diagnosis import bounds_design, conclusion, isolation
from beaver_ftc.diagnosis.assessment import weighs_statistics
from beaver_ftc.diagnosis.bounds import bound_dtype
from beaver_ftc.diagnosis.config import (
    ADAPTIVE_SCHEME,
    NO_SCHEME,
    PLUGIN_SCHEME,
    PUBLISHED_SCHEME,
    SHARED_CONFIG_RECORD,
    STATISTICAL_DETECTOR,
    WORST_CASE_DETECTOR,
    configure_shared,
)
from beaver_ftc.diagnosis.detection import directions, fdae, filters, statistical
from beaver_ftc.diagnosis.detection.filters import bank_share
from beaver_ftc.diagnosis.detection.parity import USUAL_SIZE, StatisticalSize
from beaver_ftc.diagnosis.monitors import engine_monitor
from beaver_ftc.diagnosis.monitors.records import SENSOR_MONITOR_RECORD
from beaver_ftc.diagnosis.schemes import adaptive_estimators, statistical_frame, zhang2005
from beaver_ftc.diagnosis.types import records
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.pairs import pairs_refused


@sized
def fdi_dtype(n: int, size: StatisticalSize = USUAL_SIZE) -> np.dtype:
    """The stages of the diagnosis of an aircraft with n surfaces; size: capacities of the
    statistical detector's record."""
    return record(
        config=SHARED_CONFIG_RECORD, bound=bound_dtype(n, size.n_map_boxes), bank=filters.BANK_RECORD,
        fdae=fdae.FDAE_RECORD, verdict=conclusion.conclusion_dtype(n), layout=isolation.layout_dtype(n),
        isolation=isolation.isolation_dtype(n), types=records.fault_types_dtype(n),
        statistical=statistical.statistical_dtype(size), sensor_monitor=SENSOR_MONITOR_RECORD,
        published=zhang2005.PUBLISHED_RECORD, engine_monitor=engine_monitor.ENGINE_MONITOR_RECORD,
        plugin_verdict=conclusion.plugin_verdict_dtype(n),
    )  # fmt: skip


def configure_diagnosis(fdi: np.void, pred: np.void, declared: Declared, travel: np.ndarray) -> None:
    """Fill in the stages of the diagnosis that need no trim; pred: already filled in. travel (2, n) rad: the
    stops.

    Raises BadInput if pairs are asked for and the declared errors of the sensors do not allow them.
    """
    config = declared.fdi
    aircraft = declared.aircraft
    dt = 1.0 / declared.rate_hz
    rows = isolation.list_estimators(config.fault_class, aircraft)
    configure_shared(fdi["config"], declared)
    isolation.configure_layout(fdi["layout"], rows, aircraft)
    isolation.configure_isolation(fdi["isolation"], declared, rows, travel)
    if config.pairs and (refusal := pairs_refused(declared.sensors.declared, aircraft)):
        raise BadInput(f"{declared.name}: fdi.pairs: {refusal}, allowed: false")
    bounds_design.configure_bound(fdi["bound"], declared, pred["design"])
    filters.configure_bank(fdi["bank"], config, declared, dt)
    fdae.configure_fdae(fdi["fdae"], declared)
    engine_monitor.configure_engine_monitor(fdi["engine_monitor"]["config"], aircraft)
    if config.is_published:
        zhang2005.reconfigure(fdi, declared, travel)
    records.configure_types(fdi["types"], fdi["layout"], pred["actuators"], declared, travel)
    fdi["types"]["config"]["has_eG"] = fdi["bound"]["has_eG"]
    conclusion.reset_conclusion(fdi["verdict"])


def prepare_takeover(fdi: np.void, in_flight: bool) -> None:
    """Prepare a configured diagnosis to take over from another one in the same flight. No state of that one
    continues, and the next sample of the sensor monitor is the first of a frame of the loop. in_flight:
    whether the air already moves.
    """
    for name in ("gust", "vaneless", "vaned"):
        memory = fdi["statistical"][name]["memory"]
        fill(memory, turn_past=in_flight, start_share=in_flight, start_left=in_flight)
    fdi["sensor_monitor"]["substep"] = 0


@kernel
def detection_share(fdi):
    """The largest share of its threshold that the built-in detection reaches at this frame, |E| / T of the
    bank or score / z of the statistical detector.

    Of two detectors, the worst-case one counts beyond its bound only: it has no rate of false alarms that a
    lower level could trade for power.
    """
    stat = fdi.statistical
    authority = fdi.config.authority
    share = 0.0 if authority == STATISTICAL_DETECTOR else bank_share(fdi.bank)
    if not weighs_statistics(stat, authority):
        return share
    return max(stat.alarm.ratio, share) if share > 1.0 else stat.alarm.ratio


@apart
def begin_scheme(fdi, prediction, measured):
    """Begin the detection filters at the first frame, with the bound on the errors of the gyros; fix the
    parity direction of each fault."""
    fdae.start(fdi.bank, fdi.fdae, measured.x, fdi.bound.n_gyro)
    directions.set_directions(fdi.isolation, prediction.G)


@kernel
def advance_estimators_to_frame(fdi, prediction, measured, k, t):
    """Bring the estimators from the frame before to frame k at t s."""
    scheme = fdi.config.scheme_number
    if scheme == PUBLISHED_SCHEME:
        zhang2005.advance_estimators_to_frame(fdi, prediction, measured)
    elif scheme != NO_SCHEME:
        adaptive_estimators.advance_estimators_to_frame(fdi, prediction, measured, k, t)


@kernel
def update_verdict(fdi, prediction, measured, t):
    """From residuals to the alarm, and from then on to a verdict, at t s."""
    scheme = fdi.config.scheme_number
    if scheme == ADAPTIVE_SCHEME:
        adaptive_estimators.update_verdict(fdi, prediction, measured, t)
    elif scheme == PUBLISHED_SCHEME:
        zhang2005.update_verdict(fdi, prediction, measured, t)
    elif scheme == PLUGIN_SCHEME:
        adaptive_estimators.plugin_update(fdi, measured, t)


@kernel
def prepare_next_frame(fdi, prediction, measured, k):
    """Prepare the statistical detector for the frame after frame k."""
    if fdi.statistical.test.enabled and fdi.config.scheme_number != NO_SCHEME:
        statistical_frame.prepare_gusts(fdi, prediction, measured, k)


@kernel
def accumulate_substep(fdi, prediction, measured):
    """Add one JSBSim frame inside the next frame."""
    if fdi.statistical.test.enabled and fdi.config.scheme_number != NO_SCHEME:
        statistical_frame.add_gust_instant(fdi, prediction, measured)


def kernels_of_scheme(fdi: np.void) -> Iterator[Any]:
    """The kernels that a flight of one instant a frame compiles apart, of its scheme."""
    cfg = fdi["config"]
    ours = adaptive_estimators
    scheme = cfg["scheme_number"]
    yield begin_scheme
    if scheme == PUBLISHED_SCHEME:
        yield from (zhang2005.advance_estimators_to_frame, zhang2005.update_verdict)
    elif scheme != NO_SCHEME:
        yield ours.advance_estimators_to_frame
        yield ours.plugin_update if scheme == PLUGIN_SCHEME else ours.update_verdict
        if cfg["diagnoses_all_types"]:
            yield from (ours.begin_types, ours.record_orders, ours.decide_type)
        if cfg["exclusion_authority"] != WORST_CASE_DETECTOR:
            yield ours.weigh_position if cfg["diagnoses_all_types"] else ours.weigh_loss
        if fdi["statistical"]["test"]["enabled"]:
            yield from (statistical_frame.update_tests, statistical_frame.prepare_gusts)
