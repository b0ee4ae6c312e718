"""What joins stages of the diagnosis, a few of them at a time; the frame (loop/frame.py) joins them all.

conclusion: of `conclusion_dtype`; estimators: those of the isolation; bank, types, layout: records of their
stages. k: number of the diagnosis' frame; t s.
"""

import numpy as np

from beaver_ftc.compiled import apart, kernel, record, sized
from beaver_ftc.design.model import AIRSPEED
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
    BESIDE_DAMAGE,
    IN_PITCH,
    NOT_ISOLATED,
    STATISTICS,
    WORST_CASE,
)
from beaver_ftc.diagnosis.types import examine, pairs, registry, verdict
from beaver_ftc.diagnosis.types.contract import FIXED, LAGS, LOSES, SHIFTED
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.pairs import pairs_refused
from beaver_ftc.scenario.schema import Scenario

PATIENCE_S = 4.0  # in still air what damage left over was excluded within 3.2 s, in 210 flights


@sized
def diagnosis_dtype(n: int, size: Size = USUAL) -> np.dtype:
    """The stages of the diagnosis of an aircraft with n surfaces; size: rooms of its record."""
    return record(
        config=state.CONFIG, bound=bound_dtype(n, size.boxes), bank=bank.BANK, fdae=fdae.FDAE,
        verdict=state.conclusion_dtype(n), layout=state.layout_dtype(n),
        isolation=estimators.isolation_dtype(n),
        types=registry.types_dtype(n), statistical=statistical.statistical_dtype(size), watch=WATCH,
        published=zhang2005.PUBLISHED, balance=engine_symmetry.BALANCE,
    )  # fmt: skip


def configure(fdi: np.void, belief: np.void, scenario: Scenario, travel: np.ndarray) -> None:
    """Fill in the stages of the diagnosis; belief: already filled in. travel (2, n) rad: the stops."""
    config, aircraft, dt = scenario.fdi, scenario.airframe, 1.0 / scenario.rate_hz
    members, conclusion = estimators.members_of(config.fault_class, aircraft), fdi["verdict"]
    state.configure(fdi["config"], scenario)
    state.configure_layout(fdi["layout"], members, aircraft)
    estimators.configure(fdi["isolation"], config, dt, members, travel)
    # Damage is outside the class: who is merely left when chance has excluded the others is not yet at fault.
    doubted = BESIDE_DAMAGE if config.weighs_chance and aircraft.damage else 0
    fdi["isolation"]["estimator"]["doubted"] = doubted
    fdi["isolation"]["patience_s"] = PATIENCE_S if aircraft.damage else 0.0
    lost = {surface for case in aircraft.damage.values() for surface in case.takes}
    fdi["isolation"]["taken"] = [surface in lost for surface in aircraft.surfaces]
    if config.pairs:
        _ask_each_plane(fdi, scenario)
    declared = Declared.of(scenario)
    admitted.configure(fdi["bound"], scenario, declared, belief["design"])
    bank.configure(fdi["bank"], config, declared, dt)
    fdae.configure(fdi["fdae"], scenario)
    engine_symmetry.configure(fdi["balance"], aircraft)
    if config.is_published:
        zhang2005.configure(fdi, scenario, travel)
    registry.configure(fdi["types"], fdi["layout"], belief["actuators"], scenario, travel)
    fdi["types"]["config"]["own_errors"] = fdi["bound"]["own_errors"]
    conclusion["detected_at_s"] = conclusion["isolated_at_s"] = -1.0
    conclusion["isolated"], conclusion["named_from_s"] = NOT_ISOLATED, -1.0
    conclusion["type"] = conclusion["lead"] = conclusion["lead_kind"] = conclusion["type_at_s"] = -1


def _ask_each_plane(fdi: np.void, scenario: Scenario) -> None:
    """Each plane is asked for itself: pitch by its two surfaces, roll and yaw by theirs.

    Raises BadInput where a change in flight declares what pairs are not available with.
    """
    if why := pairs_refused(scenario.fdi.bounds.sensors, scenario.airframe):
        raise BadInput(f"{scenario.name}: fdi.pairs: {why}, allowed: false")
    for fie in fdi["isolation"]["estimator"][: fdi["isolation"]["n"]]:
        fie["unasked"] = (1, 0, 1) if fdi["layout"]["group"][fie["surface"]] == IN_PITCH else (0, 1, 0)


@kernel
def expect_known_faults(expected, mean, effectiveness, offset, offsets_count):
    """Take off `expected` (3,) rad/s2 what the surfaces have lost, as known; add what they give unasked."""
    for s in range(effectiveness.size):
        lost = 1.0 - effectiveness[s]
        for i in range(3):
            expected[i] -= lost * mean.Gu[i, s]
    if offsets_count:
        for s in range(offset.size):
            for i in range(3):
                expected[i] += mean.G[i, s] * offset[s]


@kernel
def begin_isolation(isolation, types, every_type, noise, x):
    """Begin, at the measured x (3,) rad/s, with no knowledge of any fault; noise as in `isolation.start`."""
    start(isolation, noise, x)
    if every_type:
        examine.start(types)


@kernel
def is_unlikely(fie, tests, blocks, isolation, loss_of, abrupt, hidden):
    """Whether chance excludes a loss of the class, of estimator fie. One that shows by itself it never does.

    A fault that only the end of a loss that nobody saw would explain is `doubted`. So are all, where a gust
    may hide a vane's error from the watch (`hidden`): what that excludes leaves a surface by accident.
    loss_of (n,): the estimator of each surface's loss; abrupt: whether a fault stays as it is.
    """
    others, s = isolation.estimator, fie.surface
    if not fie.shown and (fie.doubted or not abrupt):
        fie.shown = statistical.shows(tests, blocks, others, loss_of, s)  # later may be its end
    if fie.shown or not statistical.excludes(tests, blocks, others, loss_of, s, False, abrupt):
        return False
    fie.doubted = max(fie.doubted, 1)
    if not statistical.excludes(tests, blocks, others, loss_of, s, True, abrupt):
        return False
    if hidden:
        for other in others[: isolation.n]:
            other.doubted = max(other.doubted, 1)
    return True


@apart
def isolate_type(types, conclusion, layout, isolation, bank, bound, t, started):
    """Of faults of every type, alone or two at a time, decide which it is."""
    estimators = isolation.estimator
    verdict.note_refuted(types.surface, layout, estimators)
    if types.pair.enabled:
        pairs.examine(types, layout, estimators, bank, bound.frame)
        pairs.decide(types, conclusion, layout, t)
        return
    if started or isolation.memory:
        examine.examine(types, layout, estimators, bank.innovation, bound)
    verdict.decide(types, conclusion, layout, estimators, t)


@kernel
def see_air(seen, inertial, felt, belief, measured, k, dt):
    """Take in the air as the vanes see it, and what the accelerometers say of it (forces.py)."""
    if seen.moving:
        air.reach_height(seen, measured.altitude)
        air.follow(seen, measured.y, measured.attitude, belief.share * dt, k)
    if (felt.known or seen.read) and not measured.inertial:
        forces.do_without(felt, seen, inertial)
    if felt.known or seen.read:
        seen.felt[:] = measured.force
    if felt.known:
        weigh_forces(seen, inertial, felt, belief, measured, k, dt)


@kernel
def weigh_forces(seen, inertial, felt, belief, measured, k, dt):
    """Take in what the accelerometers say, and the air as it follows from them without the vanes."""
    forces.look(felt, seen, measured, belief.u, dt)
    if inertial.moving:
        forces.without_vanes(felt, inertial.rotation, measured.y)
        inertial.felt[:] = measured.force
        air.reach_height(inertial, measured.altitude)
        air.follow(inertial, felt.y, measured.attitude, dt, k)
        air.effect(inertial, belief.design, measured.x, felt.y, belief.u)
        air.begin_frame(inertial, felt.y[AIRSPEED], dt)


@kernel
def note_verdict(conclusion, estimators, given, t):
    """Write a plug-in's verdict, `given` (`verdict_dtype`), where the built-in one stands."""
    if given.detected and not conclusion.detected:
        conclusion.detected, conclusion.detected_at_s, conclusion.detected_axis = 1, t, given.axis
    isolated = given.isolated if conclusion.detected else NOT_ISOLATED
    if isolated != conclusion.isolated:
        conclusion.isolated, conclusion.isolated_at_s = isolated, t
    if isolated >= 0:
        estimators[isolated].theta[:] = given.theta
    conclusion.estimates = given.estimates
    conclusion.effectiveness[:] = given.effectiveness


@kernel
def isolated_surface(conclusion, estimators):
    """The surface of the isolated fault, or -1."""
    return estimators[conclusion.isolated].surface if conclusion.isolated >= 0 else -1


@kernel
def is_unknown(conclusion):
    """Whether no surface is named, or thought likeliest, and nobody estimates any: what is left is open."""
    return conclusion.isolated < 0 and conclusion.lead < 0 and not conclusion.estimates


@kernel
def note_name(conclusion, s, named, t):
    """Note whether surface s is named, and what is withdrawn; of more than there is room for, the latest
    stays."""
    since = conclusion.named_from_s[s]
    if named and since < 0.0:
        conclusion.named_from_s[s] = t
    elif since >= 0.0 and not named:
        gone = conclusion.withdrawn[min(conclusion.n_withdrawn, state.MAX_WITHDRAWN - 1)]
        gone.surface, gone.from_s, gone.to_s = s, since, t
        conclusion.n_withdrawn += 1
        conclusion.named_from_s[s] = -1.0


@kernel
def likelihood_counts(tests, authority):
    """Whether the statistical detector's estimates are the ones to use."""
    return tests.enabled and authority != WORST_CASE


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


@kernel
def assess_type(assessment, types, layout, estimators, s):
    """What the diagnosis of every type makes of surface s, for the law (`assessment_dtype`)."""
    surface = types.surface[s]
    at_fault = verdict.possible(surface)
    if surface.measure == LOSES:
        assessment.effectiveness[s] = verdict.effectiveness_left(types, layout, estimators, s)
    elif surface.measure == FIXED:
        assessment.effectiveness[s], assessment.at_once[s] = 0.0, 1
        assessment.offset[s] = surface.command + verdict.deflection_error(surface, at_fault)
    elif surface.measure == SHIFTED:
        assessment.offset[s] = verdict.deflection_error(surface, at_fault)
    elif surface.measure == LAGS:
        assessment.lag[s] = 0.5 * (surface.low + surface.high) - surface.command
        assessment.hedge = 1
