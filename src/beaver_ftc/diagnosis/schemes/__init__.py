"""The diagnosis as a whole: its record, its configuration, and the kernels of the scheme in charge.

`begin_scheme`, `advance_estimators_to_frame`, `update_verdict`, `prepare_next_frame` and
`accumulate_substep` call the kernel of a scheme by its number (adaptive_estimators.CompiledScheme;
state.SCHEME_KERNEL_PATHS). The frame (loop/frame.py) calls them.

fdi: of `fdi_dtype`; t s.
"""

from importlib import import_module

import numpy as np

from beaver_ftc.compiled import kernel, one_of, record, sized
from beaver_ftc.diagnosis import bounds, isolation, monitors, state
from beaver_ftc.diagnosis import conclusion as conclusions
from beaver_ftc.diagnosis.bounds import bound_dtype
from beaver_ftc.diagnosis.detection import filters, statistical
from beaver_ftc.diagnosis.detection.filters import max_residual_threshold_ratio
from beaver_ftc.diagnosis.detection.parity import USUAL_RECORD_SIZE, StatisticalRecordSize
from beaver_ftc.diagnosis.monitors import sensor_monitor
from beaver_ftc.diagnosis.monitors.redundancy import SENSOR_MONITOR_RECORD
from beaver_ftc.diagnosis.schemes import adaptive_estimators, published
from beaver_ftc.diagnosis.schemes.adaptive_estimators import CompiledScheme
from beaver_ftc.diagnosis.state import PLUGIN_SCHEME_NUMBER, SCHEME_KERNEL_PATHS, STATISTICAL_DETECTOR
from beaver_ftc.diagnosis.types import registry
from beaver_ftc.diagnosis.types.registry import FIRST_TYPE_WITH_SAME_NAME
from beaver_ftc.diagnosis.types.verdict import (
    DEDUCED_FAULTY,
    TYPE_UNDECIDED,
    any_type_of_name_remains,
)
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import pairs_refused


@sized
def fdi_dtype(n_surfaces: int, statistical_capacities: StatisticalRecordSize = USUAL_RECORD_SIZE) -> np.dtype:
    """The stages of the diagnosis of an aircraft with n surfaces; statistical_capacities: rooms of the
    statistical detector's record."""
    return record(
        config=state.SHARED_CONFIG_RECORD,
        bound=bound_dtype(n_surfaces, statistical_capacities.n_model_error_bound_boxes),
        bank=filters.BANK_RECORD,
        fdae=filters.FDAE_RECORD,
        verdict=conclusions.conclusion_dtype(n_surfaces), layout=state.layout_dtype(n_surfaces),
        isolation=isolation.isolation_dtype(n_surfaces),
        types=registry.fault_types_dtype(n_surfaces),
        statistical=statistical.statistical_dtype(statistical_capacities),
        sensor_monitor=SENSOR_MONITOR_RECORD, published=published.PUBLISHED_RECORD,
        engine_monitor=monitors.ENGINE_MONITOR_RECORD,
        plugin_verdict=state.plugin_verdict_dtype(n_surfaces),
    )  # fmt: skip


def configure_diagnosis(fdi: np.void, prediction: np.void, declared: Declared, travel: np.ndarray) -> None:
    """Fill in the stages of the diagnosis; prediction: already filled in. travel (2, n) rad: the stops."""
    config, aircraft, dt = declared.fdi, declared.aircraft, 1.0 / declared.rate_hz
    estimator_entries = isolation.list_isolation_estimators(config.fault_class, aircraft)
    state.configure_shared_config(fdi["config"], declared)
    fdi["config"]["isolation_variant"] = adaptive_estimators.isolation_variant_index(config)
    state.configure_layout(fdi["layout"], estimator_entries, aircraft)
    isolation.configure_isolation(fdi["isolation"], declared, estimator_entries, travel)
    if config.pairs:
        _refuse_unavailable_fault_pairs(declared)
    bounds.configure_uncertainty_bound(fdi["bound"], declared, prediction["design"])
    filters.fill_bank_decay_factors(fdi["bank"], config, declared, dt)
    filters.configure_fdae(fdi["fdae"], declared)
    monitors.configure_engine_monitor(fdi["engine_monitor"]["config"], aircraft)
    if config.is_published:
        published.reconfigure_diagnosis_as_published(fdi, declared, travel)
    registry.configure_fault_types(fdi["types"], fdi["layout"], prediction["actuators"], declared, travel)
    fdi["types"]["config"]["has_surface_term_errors"] = fdi["bound"]["has_surface_term_errors"]
    conclusions.reset_conclusion(fdi["verdict"])


def prepare_takeover_with_previous_maxima(fdi: np.void, previous_fdi: np.void, in_flight: bool) -> None:
    """Prepare a configured diagnosis to take over from the one in `previous_fdi`, of the same flight.

    Nothing of a diagnosis goes on but how close healthy flight has come to an alarm, by the same filters.
    in_flight: whether the air moves by then. The sensor monitor's first JSBSim frame begins a frame of the
    loop.
    """
    fdi["statistical"]["alarm"]["max_score_over_alarm_level_so_far"] = previous_fdi["statistical"]["alarm"][
        "max_score_over_alarm_level_so_far"
    ]
    if fdi["bank"]["config"]["n_filters"] == previous_fdi["bank"]["config"]["n_filters"]:
        fdi["bank"]["output"]["max_residual_over_threshold_so_far"] = previous_fdi["bank"]["output"][
            "max_residual_over_threshold_so_far"
        ]
    for gust_record_name in ("gust", "inertial_gust"):
        fdi["statistical"][gust_record_name]["config"]["starts_in_flight"] = in_flight
    fdi["sensor_monitor"]["memory"]["substep"] = 0


def _refuse_unavailable_fault_pairs(declared: Declared) -> None:
    """Raises BadInput where a change in flight declares errors with which pairs are not available."""
    if refusal := pairs_refused(declared.sensors.declared, declared.aircraft):
        raise BadInput(f"{declared.name}: fdi.pairs: {refusal}, allowed: false")


@kernel
def record_isolated_surfaces(fdi, t):
    """Record at t s which surfaces are isolated: those of a pair, or the isolated one; none once a sensor is
    found broken."""
    conclusion, monitor = fdi.verdict, fdi.sensor_monitor
    surface_conclusion_is_void = (
        sensor_monitor.has_alarm(monitor) and not monitor.output.keeps_surface_conclusion
    )
    sole_isolated_surface_index = conclusions.isolated_surface(conclusion, fdi.isolation.estimator)
    diagnoses_all_types, estimators = fdi.config.diagnoses_all_types, fdi.isolation.estimator
    for s, surface in enumerate(fdi.types.surface):
        is_surface_isolated, type_index = s == sole_isolated_surface_index, conclusion.fault_type
        if fdi.types.pair.enabled:
            is_surface_isolated, type_index = surface.status.is_isolated, surface.status.fault_type
        estimator_index = (
            fdi.layout.position_estimator[s] if diagnoses_all_types else fdi.layout.loss_estimator[s]
        )
        first_of_pair_is_refuted = (
            s == fdi.types.pair.first_pitch_fault_surface
            and surface.status.can_be_at_fault_basis == DEDUCED_FAULTY
        )
        named_type = conclusion.isolated_type[s] if is_surface_isolated else TYPE_UNDECIDED
        reason = conclusions.reason_of_withdrawal(
            fdi.config.scheme_number == PLUGIN_SCHEME_NUMBER,
            surface_conclusion_is_void,
            estimator_index >= 0 and estimators[estimator_index].excluded,
            not diagnoses_all_types
            or (any_type_of_name_remains(surface, named_type) and not first_of_pair_is_refuted),
        )
        conclusions.update_isolation_interval(
            conclusion,
            s,
            is_surface_isolated and not surface_conclusion_is_void,
            t,
            FIRST_TYPE_WITH_SAME_NAME[type_index] if type_index >= 0 else -1,
            reason,
        )


@kernel
def built_in_detection_threshold_ratio(
    filter_bank, statistical_alarm, alarm_authority, uses_statistical_estimates
):
    """The largest share of its threshold that the built-in detection reaches at this frame.

    statistical_alarm: `ALARM` of the statistical detector; uses_statistical_estimates: whether its estimates
    count.

    Of two detectors, the worst-case one counts beyond its bound only: it has no rate of false alarms that a
    lower level could trade for power.
    """
    statistical_threshold_ratio = (
        statistical_alarm.score_over_alarm_level if uses_statistical_estimates else 0.0
    )
    if alarm_authority == STATISTICAL_DETECTOR:
        return statistical_threshold_ratio
    worst_case_threshold_ratio = max_residual_threshold_ratio(filter_bank)
    return (
        max(statistical_threshold_ratio, worst_case_threshold_ratio)
        if worst_case_threshold_ratio > 1.0 or not uses_statistical_estimates
        else statistical_threshold_ratio
    )


def _load_scheme(scheme_location: str) -> CompiledScheme:
    """The scheme at `module` or `module:NAME`; without a name SCHEME."""
    module_name, _, variable_name = scheme_location.partition(":")
    scheme: CompiledScheme = getattr(import_module(module_name), variable_name or "SCHEME")
    return scheme


SCHEMES = tuple(map(_load_scheme, SCHEME_KERNEL_PATHS))

begin_scheme = one_of([scheme.begin_scheme for scheme in SCHEMES])
advance_estimators_to_frame = one_of([scheme.advance_estimators_to_frame for scheme in SCHEMES])
update_verdict = one_of([scheme.update_verdict for scheme in SCHEMES])
prepare_next_frame = one_of([scheme.prepare_next_frame for scheme in SCHEMES])
accumulate_substep = one_of([scheme.accumulate_substep for scheme in SCHEMES])
