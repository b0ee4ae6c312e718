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
from beaver_ftc.diagnosis.detection.filters import bank_share
from beaver_ftc.diagnosis.detection.parity import USUAL_SIZE, StatisticalSize
from beaver_ftc.diagnosis.monitors import sensor_monitor
from beaver_ftc.diagnosis.monitors.redundancy import SENSOR_MONITOR_RECORD
from beaver_ftc.diagnosis.schemes import adaptive_estimators, published
from beaver_ftc.diagnosis.schemes.adaptive_estimators import CompiledScheme
from beaver_ftc.diagnosis.state import PLUGIN_SCHEME_NUMBER, SCHEME_KERNEL_PATHS, STATISTICAL_DETECTOR
from beaver_ftc.diagnosis.types import registry
from beaver_ftc.diagnosis.types.registry import SAME_NAME
from beaver_ftc.diagnosis.types.verdict import DEDUCED_FAULTY, TYPE_UNDECIDED, name_remains
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import pairs_refused


@sized
def fdi_dtype(n: int, size: StatisticalSize = USUAL_SIZE) -> np.dtype:
    """The stages of the diagnosis of an aircraft with n surfaces; size: rooms of the
    statistical detector's record."""
    return record(
        config=state.SHARED_CONFIG_RECORD, bound=bound_dtype(n, size.n_map_boxes), bank=filters.BANK_RECORD,
        fdae=filters.FDAE_RECORD, verdict=conclusions.conclusion_dtype(n), layout=state.layout_dtype(n),
        isolation=isolation.isolation_dtype(n), types=registry.fault_types_dtype(n),
        statistical=statistical.statistical_dtype(size), sensor_monitor=SENSOR_MONITOR_RECORD,
        published=published.PUBLISHED_RECORD, engine_monitor=monitors.ENGINE_MONITOR_RECORD,
        plugin_verdict=state.plugin_verdict_dtype(n),
    )  # fmt: skip


def configure_diagnosis(fdi: np.void, pred: np.void, declared: Declared, travel: np.ndarray) -> None:
    """Fill in the stages of the diagnosis; pred: already filled in. travel (2, n) rad: the stops."""
    config, aircraft, dt = declared.fdi, declared.aircraft, 1.0 / declared.rate_hz
    rows = isolation.list_estimators(config.fault_class, aircraft)
    state.configure_shared(fdi["config"], declared)
    fdi["config"]["variant"] = adaptive_estimators.whose_exclusions(config)
    state.configure_layout(fdi["layout"], rows, aircraft)
    isolation.configure_isolation(fdi["isolation"], declared, rows, travel)
    if config.pairs:
        _refuse_pairs(declared)
    bounds.configure_bound(fdi["bound"], declared, pred["design"])
    filters.configure_bank(fdi["bank"], config, declared, dt)
    filters.configure_fdae(fdi["fdae"], declared)
    monitors.configure_balance(fdi["engine_monitor"]["config"], aircraft)
    if config.is_published:
        published.reconfigure_published(fdi, declared, travel)
    registry.configure_types(fdi["types"], fdi["layout"], pred["actuators"], declared, travel)
    fdi["types"]["config"]["has_eG"] = fdi["bound"]["has_eG"]
    conclusions.reset_conclusion(fdi["verdict"])


def prepare_takeover(fdi: np.void, earlier: np.void, in_flight: bool) -> None:
    """Prepare a configured diagnosis to take over from the one in `earlier`, of the same flight.

    Nothing of a diagnosis goes on but how close healthy flight has come to an alarm, by the same filters.
    in_flight: whether the air moves by then. The sensor monitor's first JSBSim frame begins a frame of the
    loop.
    """
    fdi["statistical"]["alarm"]["peak"] = earlier["statistical"]["alarm"]["peak"]
    if fdi["bank"]["config"]["n_filters"] == earlier["bank"]["config"]["n_filters"]:
        fdi["bank"]["output"]["peak"] = earlier["bank"]["output"]["peak"]
    for name in ("gust", "vaneless", "vaned"):
        fdi["statistical"][name]["config"]["starts_in_flight"] = in_flight
    fdi["sensor_monitor"]["substep"] = 0


def _refuse_pairs(declared: Declared) -> None:
    """Raises BadInput where a change in flight declares errors with which pairs are not available."""
    if refusal := pairs_refused(declared.sensors.declared, declared.aircraft):
        raise BadInput(f"{declared.name}: fdi.pairs: {refusal}, allowed: false")


@kernel
def record_isolated_surfaces(fdi, t):
    """Record at t s which surfaces are isolated: those of a pair, or the isolated one; none once a sensor is
    found broken."""
    found, monitor = fdi.verdict, fdi.sensor_monitor
    void = sensor_monitor.has_alarm(monitor) and not monitor.output.keeps_surface
    sole = conclusions.isolated_surface(found, fdi.isolation.estimator)
    all_types, fies = fdi.config.diagnoses_all_types, fdi.isolation.estimator
    for s, surf in enumerate(fdi.types.surface):
        isolated, kind = s == sole, found.fault_type
        if fdi.types.pair.enabled:
            isolated, kind = surf.status.is_isolated, surf.status.fault_type
        j = fdi.layout.position[s] if all_types else fdi.layout.loss[s]
        refuted = s == fdi.types.pair.first_pitch and surf.status.basis == DEDUCED_FAULTY
        named = found.isolated_type[s] if isolated else TYPE_UNDECIDED
        reason = conclusions.reason_of_withdrawal(
            fdi.config.scheme_number == PLUGIN_SCHEME_NUMBER,
            void,
            j >= 0 and fies[j].excluded,
            not all_types or (name_remains(surf, named) and not refuted),
        )
        conclusions.update_interval(
            found, s, isolated and not void, t, SAME_NAME[kind] if kind >= 0 else -1, reason
        )


@kernel
def detection_share(bank, alarm, authority, likely):
    """The largest share of its threshold that the built-in detection reaches at this frame.

    alarm: of the statistical detector (ALARM_RECORD); likely: whether its estimates count. Of two detectors,
    the worst-case one counts beyond its bound only: it has no rate of false alarms that a lower level could
    trade for power.
    """
    score = alarm.ratio if likely else 0.0
    if authority == STATISTICAL_DETECTOR:
        return score
    share = bank_share(bank)
    return max(score, share) if share > 1.0 or not likely else score


def _load_scheme(path: str) -> CompiledScheme:
    """The scheme at `module` or `module:NAME`; without a name SCHEME."""
    module, _, name = path.partition(":")
    scheme: CompiledScheme = getattr(import_module(module), name or "SCHEME")
    return scheme


SCHEMES = tuple(map(_load_scheme, SCHEME_KERNEL_PATHS))

begin_scheme, advance_estimators_to_frame, update_verdict, prepare_next_frame, accumulate_substep = map(
    one_of, zip(*SCHEMES, strict=True)
)
