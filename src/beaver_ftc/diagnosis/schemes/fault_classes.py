"""The fault classes as rows: how the one fault that is possible is sought, by the detectors in authority.

    class        of the bank of estimators excludes  and decides
    published    worst case, statistics, or either   the estimator that is left: a loss of one surface
    all          worst case, or parity views as well  the type of a fault on each surface, alone or in pairs

`place_of` chooses the row when a flight is assembled.
"""

from collections.abc import Callable
from typing import NamedTuple

from beaver_ftc.choice import one_of
from beaver_ftc.compiled import apart, kernel
from beaver_ftc.diagnosis import conclusion
from beaver_ftc.diagnosis.detection import parity
from beaver_ftc.diagnosis.isolation import by_chance, estimators
from beaver_ftc.diagnosis.monitors import sensor_monitor
from beaver_ftc.diagnosis.types import examine, pairs, verdict
from beaver_ftc.scenario.diagnosis import FdiConfig


class FaultClass(NamedTuple):
    """Lazy kernels of a row.

    begin(fdi): start, at the alarm, with no knowledge of any fault.
    observe(fdi, belief): record what each surface was commanded in the elapsed frame.
    isolate(fdi, measured, t, started): exclude faults at t s, and decide; started: a frame or more ago.
    """

    begin: Callable[..., None]
    observe: Callable[..., None]
    isolate: Callable[..., None]


@kernel
def isolate_fault(fdi, measured, t, known):
    """From the alarm on, exclude faults and decide; known: whether the alarm came a frame or more ago.

    Where sensors are monitored, the isolation starts one frame after the alarm, because the attitude reveals
    a gyro fault one frame late (later where it is noisy). With a broken sensor or engine nothing is isolated.
    """
    row, monitor = fdi.config.fault_class, fdi.sensor_monitor
    if not known:
        estimators.start(fdi.isolation, fdi.bound.noise, measured.x)
        begin(row, fdi)
    sound = not sensor_monitor.alarm_is_at_start(monitor, fdi.verdict.detected_at_s)
    if sound and sensor_monitor.allows_isolation(monitor, known) and not fdi.engines.output.failed:
        isolate(row, fdi, measured, t, known)


@kernel
def is_possible(fdi, fie, x, started):
    """Whether the fault of estimator fie is possible in the worst case; x (3,) rad/s: measured."""
    return estimators.possible(fdi.isolation, fie, fdi.bank, fdi.bound.frame, fdi.config.abrupt, x, started)


@kernel
def is_improbable(fdi, fie):
    """Whether the statistical detector excludes the loss of estimator fie, once it has raised its alarm."""
    detector, config = fdi.statistical, fdi.config
    if detector.alarm.detected_at_s < 0.0:
        return False
    hidden = fdi.sensor_monitor.config.enabled and detector.air.output.moving
    by_chance.update_exclusion(
        fie, detector.tests, detector.block, fdi.isolation, fdi.layout.loss_of, config.abrupt, hidden
    )
    return fie.excluded_by_likelihood == 1


@kernel
def is_off_the_column(fdi, fie):
    """Whether a parity view shows motion that the surface of estimator fie cannot cause."""
    detector, position = fdi.statistical, fdi.layout.position_of[fie.surface]
    views, column = detector.views[: detector.n_views], fdi.isolation.estimator[position].effect.Z
    return parity.excludes(views, detector.tests, detector.forces, detector.air, fie.surface, column)


@kernel
def exclude_by_worst_case(fdi, x, t, started):
    """Exclude the faults that are not possible in the worst case."""
    for fie in fdi.isolation.estimator[: fdi.isolation.config.n]:
        if not is_possible(fdi, fie, x, started):
            estimators.exclude(fie, t)


@kernel
def decide_loss(fdi, t):
    """Isolate the loss of effectiveness whose estimator is the only one left."""
    conclusion.note_isolated(fdi.verdict, estimators.decide(fdi.isolation, t), t)


@apart
def isolate_loss(fdi, measured, t, started):
    """Isolate by the worst case alone (FaultClass)."""
    exclude_by_worst_case(fdi, measured.x, t, started)
    decide_loss(fdi, t)


@apart
def isolate_loss_by_either(fdi, measured, t, started):
    """Isolate by the worst case and the statistical detector (FaultClass)."""
    for fie in fdi.isolation.estimator[: fdi.isolation.config.n]:
        if not is_possible(fdi, fie, measured.x, started) or is_improbable(fdi, fie):
            estimators.exclude(fie, t)
    decide_loss(fdi, t)


@apart
def isolate_loss_by_statistics(fdi, measured, t, started):
    """Isolate by the statistical detector alone (FaultClass); the residuals are logged all the same."""
    for fie in fdi.isolation.estimator[: fdi.isolation.config.n]:
        is_possible(fdi, fie, measured.x, started)
        if is_improbable(fdi, fie):
            estimators.exclude(fie, t)
    decide_loss(fdi, t)


@apart
def isolate_type(fdi, measured, t, started):
    """Isolate a fault of any type by the worst case alone (FaultClass)."""
    exclude_by_worst_case(fdi, measured.x, t, started)
    decide_type(fdi, t, started)


@apart
def isolate_type_by_either(fdi, measured, t, started):
    """Isolate a fault of any type by the worst case and the parity views (FaultClass)."""
    for fie in fdi.isolation.estimator[: fdi.isolation.config.n]:
        if not is_possible(fdi, fie, measured.x, started) or is_off_the_column(fdi, fie):
            estimators.exclude(fie, t)
    decide_type(fdi, t, started)


@kernel
def decide_type(fdi, t, started):
    """Decide which fault of every type, alone or two at a time, is there."""
    types, found, layout, bank = fdi.types, fdi.verdict, fdi.layout, fdi.bank
    records, bound = fdi.isolation.estimator, fdi.bound
    verdict.note_refuted(types.surface, layout, records)
    if types.pair.enabled:
        pairs.examine(types, layout, records, bank, bound.frame)
        conclusion.note_type(found, pairs.decide(types, found, layout, t))
        return
    if started or fdi.isolation.config.memory:
        examine.examine(types, layout, records, bank.output.innovation, bound)
    conclusion.note_type(found, verdict.decide(types, found, layout, records, t))


@apart
def begin_loss(fdi):
    """The estimators are all that a loss needs (FaultClass)."""


@apart
def begin_type(fdi):
    """Start the feasible sets of all types (FaultClass)."""
    examine.start(fdi.types)


@apart
def observe_loss(fdi, belief):
    """The estimators have observed all that a loss needs (FaultClass)."""


@apart
def observe_type(fdi, belief):
    """Record the orders to each surface (FaultClass)."""
    examine.note_orders(fdi.types, belief.commanded, belief.means)


ROWS = {
    ("published", "worst-case"): FaultClass(begin_loss, observe_loss, isolate_loss),
    ("published", "either"): FaultClass(begin_loss, observe_loss, isolate_loss_by_either),
    ("published", "statistical"): FaultClass(begin_loss, observe_loss, isolate_loss_by_statistics),
    ("all", "worst-case"): FaultClass(begin_type, observe_type, isolate_type),
    ("all", "either"): FaultClass(begin_type, observe_type, isolate_type_by_either),
}
PUBLISHED = 0  # the place of the published class without statistics

begin = one_of([row.begin for row in ROWS.values()])
observe = one_of([row.observe for row in ROWS.values()])
isolate = one_of([row.isolate for row in ROWS.values()])


def place_of(config: FdiConfig) -> int:
    """The place of a diagnosis' row. The worst case excludes types of fault whatever the authority is."""
    authority = config.authority if config.weighs_chance else "worst-case"
    if config.fault_class == "all" and authority == "statistical":
        authority = "either"
    return list(ROWS).index((config.fault_class, authority))
