"""What joins stages of the diagnosis, a few of them at a time; the frame (loop/frame.py) joins them all.

conclusion: of `conclusion_dtype`; estimators: those of the isolation; bank, types, layout: records of their
stages. k: number of the diagnosis' frame; t s.
"""

import numpy as np

from beaver_ftc.compiled import apart, kernel, record, sized
from beaver_ftc.design.model import AIRSPEED
from beaver_ftc.diagnosis import conclusion as conclusions
from beaver_ftc.diagnosis import state, zhang2005
from beaver_ftc.diagnosis.belief import air
from beaver_ftc.diagnosis.bounds import admitted
from beaver_ftc.diagnosis.bounds.worst_case import bound_dtype
from beaver_ftc.diagnosis.detection import bank, fdae, forces, statistical
from beaver_ftc.diagnosis.detection.bank import largest_share
from beaver_ftc.diagnosis.detection.parity import USUAL, Size
from beaver_ftc.diagnosis.isolation import estimators
from beaver_ftc.diagnosis.isolation.estimators import start
from beaver_ftc.diagnosis.monitors import engine_symmetry
from beaver_ftc.diagnosis.monitors.sensor_records import WATCH
from beaver_ftc.diagnosis.state import (
    STATISTICS,
)
from beaver_ftc.diagnosis.types import examine, pairs, registry, verdict
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.pairs import pairs_refused
from beaver_ftc.scenario.schema import Scenario


@sized
def diagnosis_dtype(n: int, size: Size = USUAL) -> np.dtype:
    """The stages of the diagnosis of an aircraft with n surfaces; size: rooms of its record."""
    return record(
        config=state.CONFIG, bound=bound_dtype(n, size.boxes), bank=bank.BANK, fdae=fdae.FDAE,
        verdict=conclusions.conclusion_dtype(n), layout=state.layout_dtype(n),
        isolation=estimators.isolation_dtype(n),
        types=registry.types_dtype(n), statistical=statistical.statistical_dtype(size), watch=WATCH,
        published=zhang2005.PUBLISHED, engines=engine_symmetry.ENGINES,
    )  # fmt: skip


def configure(fdi: np.void, belief: np.void, scenario: Scenario, travel: np.ndarray) -> None:
    """Fill in the stages of the diagnosis; belief: already filled in. travel (2, n) rad: the stops."""
    config, aircraft, dt = scenario.fdi, scenario.airframe, 1.0 / scenario.rate_hz
    members = estimators.members_of(config.fault_class, aircraft)
    state.configure(fdi["config"], scenario)
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


def _check_pairs(scenario: Scenario) -> None:
    """Raises BadInput where a change in flight declares errors with which pairs are not available."""
    if why := pairs_refused(Declared.of(scenario).sensors.declared, scenario.airframe):
        raise BadInput(f"{scenario.name}: fdi.pairs: {why}, allowed: false")


@kernel
def begin_isolation(isolation, types, every_type, noise, x):
    """Begin, at the measured x (3,) rad/s, with no knowledge of any fault; noise as in `isolation.start`."""
    start(isolation, noise, x)
    if every_type:
        examine.start(types)


@apart
def isolate_type(types, conclusion, layout, isolation, bank, bound, t, started):
    """Of faults of every type, alone or two at a time, decide which it is."""
    estimators = isolation.estimator
    verdict.note_refuted(types.surface, layout, estimators)
    if types.pair.enabled:
        pairs.examine(types, layout, estimators, bank, bound.frame)
        conclusions.note_type(conclusion, pairs.decide(types, conclusion, layout, t))
        return
    if started or isolation.config.memory:
        examine.examine(types, layout, estimators, bank.output.innovation, bound)
    conclusions.note_type(conclusion, verdict.decide(types, conclusion, layout, estimators, t))


@kernel
def see_air(seen, inertial, felt, belief, measured, k, dt):
    """Take in the air as the vanes see it, and what the accelerometers say of it (forces.py)."""
    if seen.output.moving:
        air.reach_height(seen, measured.altitude)
        air.follow(seen, measured.y, measured.attitude, belief.share * dt, k)
    if (felt.known or seen.output.read) and not measured.inertial:
        forces.do_without(felt, seen, inertial)
    if felt.known or seen.output.read:
        air.take_force(seen, measured.force)
    if felt.known:
        weigh_forces(seen, inertial, felt, belief, measured, k, dt)


@kernel
def weigh_forces(seen, inertial, felt, belief, measured, k, dt):
    """Take in what the accelerometers say, and the air as it follows from them without the vanes."""
    forces.look(felt, seen, measured, belief.u, dt)
    if inertial.output.moving:
        forces.without_vanes(felt, inertial.memory.rotation, measured.y)
        air.take_force(inertial, measured.force)
        air.reach_height(inertial, measured.altitude)
        air.follow(inertial, felt.y, measured.attitude, dt, k)
        air.effect(inertial, belief.design, measured.x, felt.y, belief.u)
        air.begin_frame(inertial, felt.y[AIRSPEED], dt)


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
