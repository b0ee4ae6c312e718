"""What a surface cannot have done, whatever the type and the course of its fault.

A fault of surface s moves the rates along its column g_s of G and nowhere else. So they are looked at along
directions m that it does not move,

    m . x,     m . g_s = 0

each by a filter and tests of its own (likelihood.py): a step, and losses of other surfaces.
What is found there is another surface's doing. Directions are the axes, for the surfaces that do not move
them at all, and in a plane that several surfaces move, across the column of each: m = (-g_2, g_1) / |g|. The
planes are roll with yaw, and where accelerometers are read (forces.py) pitch with the normal force and yaw
with the side force.

Where declared errors may turn that column, a share of what goes along it shows across: at most
(|m_1| e_1 + |m_2| e_2) / (|g| - |m_2| e_1 - |m_1| e_2), e the error of the surface's own terms per rad. That
much is tolerated as an error of a coefficient is. What a test must reach is the level of the alarm: chance
and bounded uncertainty exclude no oftener than they alarm.

The gust that the vanes show is taken off the rates only where the forces are measured: else a surface that is
off its command has forces that would be taken for one, and every gust is reckoned with in full. So is the
rolling one, which no vane shows.

An error of a vane moves a rate and its force as well, and so do gusts that it makes up. So where vanes are
asked a surface is excluded only once something shows that is no vane's doing: across the vane's column, the
gust being that which the forces say, or in the force at the angle of inertial motion.

A broken accelerometer moves a force and no rate. Where accelerometers may break (air.read: they are taken at
their word) a force raises no alarm, so that it counts once the rates alone have raised it, and no gust is
known by them. Known to be broken, or suspected of it, they count no more.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.schema import MAX_TERMS_OF_ONE
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis.belief.air import along, drift_beside, whole_drift
from beaver_ftc.diagnosis.bounds.variances import axis_of
from beaver_ftc.diagnosis.detection import forces, likelihood, tones
from beaver_ftc.diagnosis.detection.forces import ASIDE, COMPONENTS, SETTLED, UP, terms_of
from beaver_ftc.diagnosis.detection.likelihood import (
    LATERAL,
    MAX_HYPOTHESES,
    N_READINGS,
    PITCH_BLOCK,
    SENSE,
    STEP,
    Rooms,
)
from beaver_ftc.diagnosis.detection.signatures import sign_view
from beaver_ftc.diagnosis.detection.tones import tones_dtype
from beaver_ftc.diagnosis.state import LOSS, NORMAL, PITCH, ROLL, SIDE, YAW

VANE_TOLERANCE = 0.1  # of what a vane's error does: its column is that of the trim
HOLDS = 5.0  # times as long as old evidence elsewhere a force is remembered
MOSTLY = 0.9  # of a direction of length one
LEAST_LENGTH = 0.1  # of a column: errors larger than that are not reckoned with
IN_PITCH, LATERALLY, IN_YAW = (PITCH, NORMAL), (ROLL, YAW), (YAW, SIDE)  # planes that several surfaces move

# The rates along a direction, `mix`, in a block of one axis. surface: whose column it is across,
# AN_AXIS of none, THE_VANE of an error of the incidence. plane: of the column; tolerated: anything at all;
# inertial: the force by an angle that no vane gave; clears: what it shows is no vane's doing; cleared_by: the
# force of the views that clear its vane, 0 where it asks none. held: its largest score, slowly forgotten.
# axis: that an alarm of it is said to be about. past_gust: across the rolling gust too. column: of length 1.
# Of the frame: whether it is weighed; which share of what goes along its column may show across.
AN_AXIS, THE_VANE = -1, -2


class Size(NamedTuple):
    """What a record has room for: of a block of the rates, of a view, and views; boxes of the error map."""

    rates: Rooms
    view: Rooms
    views: int
    boxes: int


USUAL = Size(Rooms(23, MAX_HYPOTHESES), Rooms(36, 3), 13, 6)  # of most aircraft: `size_for` says whose


@sized
def view_dtype(rooms: Rooms) -> np.dtype:
    """A view whose block has these rooms."""
    return record(
        surface=int, axis=int, mix=5, plane=(int, 2), past_gust=int, column=5, tolerated=int,
        inertial=int, clears=int, cleared_by=int, weighed=int, shows_across=float,
        bounded=1, by_rates=3, by_forces=3, held=float,
        block=likelihood.block_dtype(rooms), tones=tones_dtype(rooms.regressors),
    )  # fmt: skip


@kernel
def part(view, forces, air, inertial_air, innovation, i):
    """Component i of what is looked at, rad/s2: of the rates' innovation (3,), or of a force's."""
    if i < SIDE:
        return innovation[i] - (
            gust_of(view, air, inertial_air).output.mean[i] if knows_gust(view, air) else 0.0
        )
    force = forces.component[i - SIDE]
    return force.inertial if view.inertial else force.innovation


@kernel
def column_of(view, forces, bound, G, j):
    """The j-th of the two components of the column a view looks across, and how far off it can be."""
    i, s = view.plane[j], view.surface
    if s == THE_VANE:
        size = forces.component[view.plane[1] - SIDE].vane[j]
        return size, VANE_TOLERANCE * abs(size)
    if i >= SIDE:
        force = forces.component[i - SIDE]
        return force.foreseen[s], force.own[s]
    return G[i, s], bound.own_per_rad[i, s] if bound.own_errors else 0.0


@kernel
def turn(view, forces, air, bound, G):
    """Fill `mix` and `column` (5,), for a view across a column, G (3, n); returns which share of what goes
    along it the errors of the column let show across."""
    if view.past_gust:
        return turn_past_gust(view, forces, air)
    first, second = view.plane[0], view.plane[1]
    one, one_off = column_of(view, forces, bound, G, 0)
    other, other_off = column_of(view, forces, bound, G, 1)
    size = np.sqrt(one * one + other * other)
    if size == 0.0:
        return 0.0
    view.mix[first], view.mix[second] = -other / size, one / size
    view.column[first], view.column[second] = one / size, other / size
    across_it = abs(view.mix[first]) * one_off + abs(view.mix[second]) * other_off
    shorter = abs(view.mix[second]) * one_off + abs(view.mix[first]) * other_off
    return across_it / max(size - shorter, LEAST_LENGTH * size)


@kernel
def turn_past_gust(view, forces, air):
    """The same across the column of the side vane in roll, yaw and side force, and across what the rolling
    gust does to the rates: the vector product of the two."""
    force = forces.component[0]
    roll, yaw, side = force.vane_roll, force.vane[0], force.vane[1]
    roll_gust, yaw_gust = (
        along(air.output.damping[ROLL], air.output.axes, 0),
        along(air.output.damping[YAW], air.output.axes, 0),
    )
    by_roll, by_yaw, by_side = -side * yaw_gust, side * roll_gust, roll * yaw_gust - yaw * roll_gust
    length = np.sqrt(by_roll * by_roll + by_yaw * by_yaw + by_side * by_side)
    if length == 0.0:
        return 0.0
    size, shows = np.sqrt(roll * roll + yaw * yaw + side * side), 0.0
    for i, of_vane, by in ((ROLL, roll, by_roll), (YAW, yaw, by_yaw), (SIDE, side, by_side)):
        view.mix[i], view.column[i] = by / length, of_vane / size
        shows += VANE_TOLERANCE * abs(view.mix[i] * of_vane)
    return shows / ((1.0 - VANE_TOLERANCE) * size)


@kernel
def knows_gust(view, air):
    """Whether a view is told the gust: only one that the measured force clears of broken surfaces."""
    return view.cleared_by > 0 and air.output.read == 1


@kernel
def weighs(view):
    """Whether there is a force in a view."""
    return view.mix[SIDE] != 0.0 or view.mix[SIDE + 1] != 0.0


@kernel
def gust_of(view, air, inertial_air):
    """The air by which a view knows the gust: that the vanes show, or that follows without them."""
    return inertial_air if view.clears else air


@kernel
def feel_gust(view, forces, damping):
    """Fill `by_rates` and `by_forces` (3,), 1/s: what the air's rotation about body axes does in a view;
    damping (3, 3) 1/s: to the rates."""
    m = view.mix
    for k in range(3):
        roll, pitch, yaw = m[ROLL] * damping[ROLL, k], m[PITCH] * damping[PITCH, k], m[YAW] * damping[YAW, k]
        view.by_rates[k] = roll + pitch + yaw
        view.by_forces[k] = 0.0
        for f in range(2):
            view.by_forces[k] += m[SIDE + f] * forces.component[f].damping[k] * forces.strength


@kernel
def blur(view, noise, blocks, forces, air, inertial_air, V):
    """Fill noise, jitter, drift and bound of a view's block from what is declared; V m/s."""
    block, m = view.block, view.mix
    variance, jitter, bound, drift = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        variance += m[i] * m[i] * blocks[PITCH_BLOCK if i == PITCH else LATERAL].noise[i // 2]
        jitter += abs(m[i]) * np.sqrt(noise.jitter[i])
        if view.clears:
            jitter += abs(m[i]) * forces.blurred[i]
        bound += abs(m[i]) * (noise.bounded[i] + noise.beyond[i])
    for f, force in enumerate(forces.component):
        jitter += abs(m[SIDE + f]) * np.sqrt(force.jitter[view.inertial])
        if view.inertial:
            drift += (m[SIDE + f] * forces.strength) ** 2 * force.wander
        bound += abs(m[SIDE + f]) * (force.deflection * forces.strength + force.unsettled)
    if air.output.moving:
        feel_gust(view, forces, air.output.damping)
        if knows_gust(view, air):
            drift += drift_beside(gust_of(view, air, inertial_air), V, view.by_rates, view.by_forces)
        else:
            drift += whole_drift(air, V, view.by_rates, view.by_forces)
        for i in range(3):
            for j in range(3):
                block.P_dd[0, 0] += m[i] * m[j] * air.output.leap[i, j]
    size = max(bound, likelihood.LEAST_UNCERTAINTY_RAD_S2)
    block.noise[0], block.jitter[0], view.bounded[0] = variance, jitter * jitter, bound
    block.drift[0, 0] = drift + noise.rapidity * size * size


@kernel
def regress(view, blocks, forces, air, inertial_air, innovation):
    """Fill what constants multiply in a view; innovation (3,) rad/s2."""
    block, m = view.block, view.mix
    first, second = view.plane[0], view.plane[1]
    rates = blocks[PITCH_BLOCK if first == PITCH else LATERAL]
    for j in range(rates.n_regressors):
        if first == PITCH:
            block.regressor[j, 0] = m[PITCH] * rates.regressor[j, 0]
        else:
            block.regressor[j, 0] = m[ROLL] * rates.regressor[j, 0] + m[YAW] * rates.regressor[j, 1]
    n = rates.n_regressors
    if second >= SIDE and m[second] != 0.0:
        force = forces.component[second - SIDE]
        for j in range(force.n):
            block.regressor[n + j, 0] = m[second] * force.regressor[j]
        n += force.n
        if view.inertial:
            block.regressor[n, 0], n = m[second] * force.drifted, n + 1
    if view.surface != AN_AXIS:
        block.regressor[n, 0] = 0.0
        for i in range(m.size):
            if view.column[i] != 0.0:
                one = part(view, forces, air, inertial_air, innovation, i)
                block.regressor[n, 0] += view.shows_across * view.column[i] * one


@kernel
def face(views, forces, air, bound, G, Gu):
    """Turn each view to where it looks in this frame, with its signatures; G, Gu (3, n): of it."""
    for view in views:
        view.weighed = not weighs(view) or (forces.known and forces.begun == SETTLED)
        if view.weighed:
            view.shows_across = turn(view, forces, air, bound, G) if view.surface != AN_AXIS else 0.0
            sign_view(view, forces, Gu)


@kernel
def compose(views, tolerated, noise, blocks, forces, air, inertial_air, innovation, V):
    """Put together what each view sees of the frame, and what it may owe to noise and to constants that are
    `tolerated`; V m/s."""
    for view in views:
        if not view.weighed:
            continue
        blur(view, noise, blocks, forces, air, inertial_air, V)
        m, seen = view.mix, view.block.scratch
        seen[0] = 0.0
        for i in range(m.size):
            if m[i] != 0.0:
                seen[0] += m[i] * part(view, forces, air, inertial_air, innovation, i)
        if tolerated or view.tolerated:
            regress(view, blocks, forces, air, inertial_air, innovation)


@kernel
def observe(views, tests, listening, y, dt, k, latched):
    """Take in frame k of what the views see, as `statistical.observe`; y as measured."""
    heard = tones.usual(listening, y)
    keep, slot = tests.keep if latched else 1.0, likelihood.slot_to_start(k)
    for view in views:
        if not view.weighed:
            view.held = 0.0
            continue
        if not latched:
            likelihood.start(view.block, slot)
        tolerated = tests.tolerated or view.tolerated
        likelihood.take_in(view.block, view.bounded, tolerated, dt, keep)
        if not view.inertial:  # the angle followed is off by what integration is, which swings as the flight
            tones.listen(view, listening, tests.alarm_level, heard, tolerated, dt)
        view.held = max((1.0 - (1.0 - tests.keep) / HOLDS) * view.held, best(view))


@kernel
def feels(view, forces, s, column):
    """Whether a fault of surface s, of this column of G (3,), shows in a view."""
    if view.surface == s:
        return False
    m, shows = view.mix, 0.0
    for i in range(3):
        shows += m[i] * column[i]
    for f in range(2):
        shows += m[SIDE + f] * forces.component[f].column[s]
    return shows != 0.0


@kernel
def best(view):
    """The largest score in a view."""
    found = view.tones.score
    for h in range(view.block.n_hypotheses):
        found = max(found, view.block.hypothesis[h].score)
    return found


@kernel
def shown(view, views, tests, forces, air):
    """The score of what goes on in a view and is no vane's doing: no vane moves the rates alone. What a force
    shows, and what clears the vane, may come a moment apart. The latter asks for the naming level."""
    if weighs(view) and not forces.known:
        return 0.0
    if view.clears or not (weighs(view) or knows_gust(view, air)):
        return best(view)
    cleared = 0.0
    for other in views:
        if other.clears and other.plane[1] == view.cleared_by:
            cleared = max(cleared, other.held)
    return min(view.held, cleared * tests.alarm_level / np.sqrt(2.0 * tests.naming_level))


@kernel
def alarm(view, views, tests, forces, air):
    """The score with which a view raises the alarm, for what no block of the rates looks at: a tone about an
    axis, or a view of little but a force, of accelerometers that do not break."""
    if view.surface == AN_AXIS and not view.inertial:
        return view.tones.score
    mostly = view.plane[1] >= SIDE and abs(view.mix[view.plane[1]]) > MOSTLY
    if view.surface >= 0 and mostly and air.output.read == 1:
        return shown(view, views, tests, forces, air)
    return 0.0


@kernel
def excludes(views, tests, forces, air, s, column):
    """Whether something is going on that no fault of surface s does, of this column of G (3,)."""
    for view in views:
        blind = not view.clears and not feels(view, forces, s, column)
        if blind and shown(view, views, tests, forces, air) > tests.alarm_level:
            return True
    return False


class Direction(NamedTuple):
    """What a view looks along. across: a surface, THE_VANE or AN_AXIS; tries: whose losses."""

    across: int
    mix: tuple[float, ...]
    plane: tuple[int, int]
    tries: list[int]
    inertial: bool = False
    asks: bool = False  # the vanes, in moving air: they do not see it roll


def views_of(aircraft: Aircraft, with_force: bool = False) -> Iterator[Direction]:
    """The axes for themselves; in roll and yaw across the column of each surface that turns about
    one of them. With accelerometers, in a rate and its force across those of what moves both, and that of
    the vane."""
    in_pitch = [s for s, axis in enumerate(aircraft.dominant_axis) if axis == PITCH]
    lateral = [s for s, axis in enumerate(aircraft.dominant_axis) if axis != PITCH]
    yield Direction(AN_AXIS, _along((PITCH,)), IN_PITCH, in_pitch, asks=True)
    yield Direction(AN_AXIS, _along((ROLL,)), LATERALLY, lateral)
    yield Direction(AN_AXIS, _along((YAW,)), LATERALLY, lateral, asks=True)
    for s in lateral:
        past_roll, others = aircraft.dominant_axis[s] == ROLL, [other for other in lateral if other != s]
        yield Direction(s, _along((ROLL,)), LATERALLY, others, asks=past_roll)
    if not with_force:
        return
    for f, plane, movers in ((UP, IN_PITCH, in_pitch), (ASIDE, IN_YAW, lateral)):
        found = aircraft.separated_by_force(COMPONENTS[f])
        for s in found:
            own = aircraft.dominant_axis[s], plane[1]
            yield Direction(s, _along(own), own, [other for other in movers if other != s])
        if found:
            yield Direction(THE_VANE, _along(plane), plane, movers)
            yield Direction(AN_AXIS, _along(plane[1:]), plane, movers, inertial=True)


def _along(components: tuple[int, ...]) -> tuple[float, ...]:
    return tuple(float(i in components) for i in range(NORMAL + 1))


def size_for(aircraft: Aircraft) -> Size:
    """What an aircraft needs room for."""
    axes = [axis_of(term) for term in aircraft.moments]
    views = list(views_of(aircraft, aircraft.forces_separate_surfaces))
    rates = N_READINGS + max(axes.count(PITCH), axes.count(ROLL) + axes.count(YAW))
    errors = max(len(terms_of(aircraft, f)) for f in (ASIDE, UP)) + forces.MAX_ERRORS - MAX_TERMS_OF_ONE
    turns = [aircraft.dominant_axis[aircraft.surfaces.index(s)] for s in aircraft.class_of_losses]
    losses = max(turns.count(PITCH), turns.count(ROLL) + turns.count(YAW))
    tried = max(len(view.tries) for view in views)
    error_map = aircraft.file.model_error_map
    boxes = len(error_map.boxes) if error_map else 0
    return Size(Rooms(rates, 3 * losses + 2), Rooms(rates + errors + 2, tried + 1), len(views), boxes)


def set_up_views(statistical: np.void, aircraft: Aircraft) -> None:
    """Fill the views of a statistical record whose blocks, and normal force, are set up."""
    forces = statistical["forces"]
    separated = [aircraft.separated_by_force(COMPONENTS[f]) for f in (ASIDE, UP)]
    with_air = forces["known"] and statistical["air"]["output"]["moving"] and all(separated)
    views = list(views_of(aircraft, bool(forces["known"])))[: len(statistical["views"])]
    statistical["n_views"] = len(views)
    for view, (surface, mix, plane, movers, inertial, asks) in zip(statistical["views"], views, strict=False):
        view["surface"], view["mix"], view["plane"], block = surface, mix, plane, view["block"]
        view["axis"] = mix.index(1.0) if surface == AN_AXIS and not inertial else plane[0]
        axes = statistical["block"][PITCH_BLOCK if plane == IN_PITCH else LATERAL]
        # A law answers a gust by the vanes before the gyros feel it pitch, and the vanes are not asked here:
        # what an elevator does in moving air goes along with the noise, and no test of its loss is fair.
        answered = statistical["air"]["output"]["moving"] and mix[PITCH]
        tried = [] if answered else movers[: len(block["hypothesis"]) - 1]
        kinds, n = [STEP, *(LOSS for _ in tried)], int(axes["n_regressors"])
        block["n"], block["n_hypotheses"], block["keep"] = 1, len(kinds), 1.0
        block["P_xx"][0, 0], block["P_dd"][0, 0] = axes["noise"].max(), likelihood.PRIOR_DRIFT_RAD_S2**2
        for name in ("level", "chance", "pace"):
            block[name] = axes[name]
        block["tolerance"][:n] = axes["tolerance"][:n]
        if asks and with_air:  # the vanes for the gust
            view["cleared_by"] = NORMAL if plane == IN_PITCH else SIDE
        if any(mix[SIDE:]):
            force, view["cleared_by"] = forces["component"][plane[1] - SIDE], plane[1]
            view["tolerated"], of_force = 1, int(force["n"])
            block["tolerance"][n : n + of_force] = force["tolerance"][:of_force]
            n += of_force
            if inertial:
                block["tolerance"][n], n = force["drift"], n + 1
        block["n_regressors"] = n + (surface != AN_AXIS)
        block["tolerance"][n] = float(surface != AN_AXIS)  # of how far errors turn the column, in flight
        hypotheses = block["hypothesis"][: len(kinds)]
        hypotheses["kind"], hypotheses["surface"] = kinds, [-1, *tried]
        view["past_gust"] = surface == THE_VANE and plane == IN_YAW and statistical["air"]["output"]["moving"]
        view["inertial"], view["clears"] = inertial, inertial or surface == THE_VANE
        sense = block["lane"]["sense"].reshape(-1, likelihood.N_SLOTS)
        sense[:] = 0.0
        sense[: len(kinds)] = [[SENSE[kind]] for kind in kinds]
