"""The diagnosis as a whole: its record, its configuration, and the kernels of the scheme in charge.

`begin`, `predict`, `conclude`, `prepare` and `accumulate` call the kernel of a scheme by its number
(contract.CompiledScheme; state.SCHEME_KERNELS). The frame (loop/frame.py) calls them.

fdi: of `diagnosis_dtype`; t s.
"""

from importlib import import_module

import numpy as np

from beaver_ftc.compiled import kernel, one_of, record, sized
from beaver_ftc.diagnosis import bounds, isolation, state
from beaver_ftc.diagnosis import conclusion as conclusions
from beaver_ftc.diagnosis.bounds import bound_dtype
from beaver_ftc.diagnosis.detection import filters, statistical
from beaver_ftc.diagnosis.detection.filters import largest_share
from beaver_ftc.diagnosis.detection.parity import USUAL_SIZE, RecordSize
from beaver_ftc.diagnosis.monitors import engine_symmetry, sensor_monitor
from beaver_ftc.diagnosis.monitors.redundancy import SENSOR_MONITOR
from beaver_ftc.diagnosis.schemes import adaptive_estimators, published
from beaver_ftc.diagnosis.schemes.contract import CompiledScheme
from beaver_ftc.diagnosis.state import SCHEME_KERNELS, STATISTICAL_DETECTOR
from beaver_ftc.diagnosis.types import registry
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import pairs_refused
from beaver_ftc.scenario.schema import Scenario


@sized
def diagnosis_dtype(n: int, size: RecordSize = USUAL_SIZE) -> np.dtype:
    """The stages of the diagnosis of an aircraft with n surfaces; size: rooms of its record."""
    return record(
        config=state.CONFIG, bound=bound_dtype(n, size.boxes), bank=filters.BANK, fdae=filters.FDAE,
        verdict=conclusions.conclusion_dtype(n), layout=state.layout_dtype(n),
        isolation=isolation.isolation_dtype(n),
        types=registry.types_dtype(n), statistical=statistical.statistical_dtype(size),
        sensor_monitor=SENSOR_MONITOR, published=published.PUBLISHED_RECORD, engines=engine_symmetry.ENGINES,
        plugin_verdict=state.plugin_verdict_dtype(n),
    )  # fmt: skip


def configure_diagnosis(fdi: np.void, belief: np.void, scenario: Scenario, travel: np.ndarray) -> None:
    """Fill in the stages of the diagnosis; belief: already filled in. travel (2, n) rad: the stops."""
    config, aircraft, dt = scenario.fdi, scenario.airframe, 1.0 / scenario.rate_hz
    members = isolation.members_of(config.fault_class, aircraft)
    state.configure_shared(fdi["config"], scenario)
    fdi["config"]["fault_class"] = adaptive_estimators.fault_class_number(config)
    state.configure_layout(fdi["layout"], members, aircraft)
    isolation.configure_isolation(fdi["isolation"], scenario, members, travel)
    if config.pairs:
        _check_pairs(scenario)
    declared = Declared.of(scenario)
    bounds.configure_bound(fdi["bound"], scenario, declared, belief["design"])
    filters.configure_bank(fdi["bank"], config, declared, dt)
    filters.configure_fdae(fdi["fdae"], scenario)
    engine_symmetry.configure_engine_monitor(fdi["engines"]["config"], aircraft)
    if config.is_published:
        published.configure_published(fdi, scenario, travel)
    registry.configure_types(fdi["types"], fdi["layout"], belief["actuators"], scenario, travel)
    fdi["types"]["config"]["has_surface_errors"] = fdi["bound"]["has_surface_errors"]
    conclusions.configure_conclusion(fdi["verdict"])


def restart_diagnosis(fdi: np.void, before: np.void, in_flight: bool) -> None:
    """Prepare a configured diagnosis to take over from the one in `before`, of the same flight.

    Nothing of a diagnosis goes on but how close healthy flight has come to an alarm, by the same filters.
    in_flight: whether the air moves by then. The sensor monitor's first JSBSim frame begins a frame of the
    loop.
    """
    fdi["statistical"]["alarm"]["closest"] = before["statistical"]["alarm"]["closest"]
    if fdi["bank"]["config"]["n"] == before["bank"]["config"]["n"]:
        fdi["bank"]["output"]["closest"] = before["bank"]["output"]["closest"]
    for air in ("air", "inertial_air"):
        fdi["statistical"][air]["config"]["in_flight"] = in_flight
    fdi["sensor_monitor"]["memory"]["substep"] = 0


def _check_pairs(scenario: Scenario) -> None:
    """Raises BadInput where a change in flight declares errors with which pairs are not available."""
    if why := pairs_refused(Declared.of(scenario).sensors.declared, scenario.airframe):
        raise BadInput(f"{scenario.name}: fdi.pairs: {why}, allowed: false")


@kernel
def record_named_surfaces(fdi, t):
    """Record at t s which surfaces are named: those of a pair, or the isolated one; none once a sensor is
    found broken."""
    found, monitor = fdi.verdict, fdi.sensor_monitor
    void = sensor_monitor.has_alarm(monitor) and not monitor.output.keeps_surface
    only = conclusions.isolated_surface(found, fdi.isolation.estimator)
    for s in range(fdi.types.surface.size):
        named = fdi.types.surface[s].status.named if fdi.types.pair.enabled else s == only
        conclusions.record_named(found, s, named and not void, t)


@kernel
def built_in_statistic(bank, alarm, authority, uses_estimates):
    """The largest share of its threshold that the built-in detection reaches at this frame; alarm: `ALARM` of
    the statistical detector; likely: whether its estimates count.

    Of two detectors, the worst-case one counts beyond its bound only: it has no rate of false alarms that a
    lower level could trade for power.
    """
    score = alarm.score if uses_estimates else 0.0
    if authority == STATISTICAL_DETECTOR:
        return score
    certain = largest_share(bank)
    return max(score, certain) if certain > 1.0 or not uses_estimates else score


def _scheme(place: str) -> CompiledScheme:
    """The scheme at `module` or `module:NAME`; without a name SCHEME."""
    module, _, name = place.partition(":")
    found: CompiledScheme = getattr(import_module(module), name or "SCHEME")
    return found


SCHEMES = tuple(map(_scheme, SCHEME_KERNELS))

begin = one_of([scheme.begin for scheme in SCHEMES])
predict = one_of([scheme.predict for scheme in SCHEMES])
conclude = one_of([scheme.conclude for scheme in SCHEMES])
prepare = one_of([scheme.prepare for scheme in SCHEMES])
accumulate = one_of([scheme.accumulate for scheme in SCHEMES])
