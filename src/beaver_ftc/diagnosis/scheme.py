"""What joins stages of the diagnosis, a few of them at a time; the frame (loop/frame.py) joins them all.

fdi: of `diagnosis_dtype`; t s.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis import conclusion as conclusions
from beaver_ftc.diagnosis import state, zhang2005
from beaver_ftc.diagnosis.bounds import admitted
from beaver_ftc.diagnosis.bounds.worst_case import bound_dtype
from beaver_ftc.diagnosis.detection import bank, fdae, statistical
from beaver_ftc.diagnosis.detection.bank import largest_share
from beaver_ftc.diagnosis.detection.parity import USUAL_SIZE, Size
from beaver_ftc.diagnosis.isolation import estimators
from beaver_ftc.diagnosis.monitors import engine_symmetry, sensor_monitor
from beaver_ftc.diagnosis.monitors.sensor_records import SENSOR_MONITOR
from beaver_ftc.diagnosis.schemes import fault_classes
from beaver_ftc.diagnosis.state import STATISTICS
from beaver_ftc.diagnosis.types import registry
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import pairs_refused
from beaver_ftc.scenario.schema import Scenario


@sized
def diagnosis_dtype(n: int, size: Size = USUAL_SIZE) -> np.dtype:
    """The stages of the diagnosis of an aircraft with n surfaces; size: rooms of its record."""
    return record(
        config=state.CONFIG, bound=bound_dtype(n, size.boxes), bank=bank.BANK, fdae=fdae.FDAE,
        verdict=conclusions.conclusion_dtype(n), layout=state.layout_dtype(n),
        isolation=estimators.isolation_dtype(n),
        types=registry.types_dtype(n), statistical=statistical.statistical_dtype(size),
        sensor_monitor=SENSOR_MONITOR, published=zhang2005.PUBLISHED, engines=engine_symmetry.ENGINES,
        plugin_verdict=state.verdict_dtype(n),
    )  # fmt: skip


def configure(fdi: np.void, belief: np.void, scenario: Scenario, travel: np.ndarray) -> None:
    """Fill in the stages of the diagnosis; belief: already filled in. travel (2, n) rad: the stops."""
    config, aircraft, dt = scenario.fdi, scenario.airframe, 1.0 / scenario.rate_hz
    members = estimators.members_of(config.fault_class, aircraft)
    state.configure(fdi["config"], scenario)
    fdi["config"]["fault_class"] = fault_classes.place_of(config)
    state.configure_layout(fdi["layout"], members, aircraft)
    estimators.configure(fdi["isolation"], scenario, members, travel)
    if config.pairs:
        _check_pairs(scenario)
    declared = Declared.of(scenario)
    admitted.configure(fdi["bound"], scenario, declared, belief["design"])
    bank.configure(fdi["bank"], config, declared, dt)
    fdae.configure(fdi["fdae"], scenario)
    engine_symmetry.configure(fdi["engines"]["config"], aircraft)
    if config.is_published:
        zhang2005.configure(fdi, scenario, travel)
    registry.configure(fdi["types"], fdi["layout"], belief["actuators"], scenario, travel)
    fdi["types"]["config"]["own_errors"] = fdi["bound"]["own_errors"]
    conclusions.configure(fdi["verdict"])


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
    fdi["sensor_monitor"]["memory"]["past"] = 0


def _check_pairs(scenario: Scenario) -> None:
    """Raises BadInput where a change in flight declares errors with which pairs are not available."""
    if why := pairs_refused(Declared.of(scenario).sensors.declared, scenario.airframe):
        raise BadInput(f"{scenario.name}: fdi.pairs: {why}, allowed: false")


@kernel
def begin_filters(fdi, x):
    """Begin the detection filters at the first measurement x (3,) rad/s."""
    fdae.begin(fdi.fdae, fdi.bound.noise, x)
    bank.begin(fdi.bank, fdi.bound.noise)


@kernel
def predict_estimators(fdi, belief):
    """Bring the isolation estimators from the frame before to this one, once the bank has its innovation."""
    config, bound, records, mean = fdi.config, fdi.bound, fdi.isolation, belief.means
    known = fdi.verdict.detected
    estimators.update_hypotheses(records, fdi.bank, bound, config, known, mean.G, mean.Gu, mean.Gu_spread)
    if known:
        estimators.predict_all(records, bound, belief.x_then, mean.acceleration, config.dt)


@kernel
def note_named_surfaces(fdi, t):
    """Record at t s which surfaces are named: those of a pair, or the isolated one; none once a sensor is
    found broken."""
    found, monitor = fdi.verdict, fdi.sensor_monitor
    void = sensor_monitor.has_alarm(monitor) and not monitor.output.keeps_surface
    only = conclusions.isolated_surface(found, fdi.isolation.estimator)
    for s in range(fdi.types.surface.size):
        named = fdi.types.surface[s].status.named if fdi.types.pair.enabled else s == only
        conclusions.note_name(found, s, named and not void, t)


@kernel
def built_in_statistic(bank, alarm, authority, likely):
    """The largest share of its threshold that the built-in detection reaches at this frame; alarm: `ALARM` of
    the statistical detector; likely: whether its estimates count.

    Of two detectors, the worst-case one counts beyond its bound only: it has no rate of false alarms that a
    lower level could trade for power.
    """
    score = alarm.score if likely else 0.0
    if authority == STATISTICS:
        return score
    certain = largest_share(bank)
    return max(score, certain) if certain > 1.0 or not likely else score
