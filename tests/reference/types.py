"""Fault types: where a surface was in each frame, and the types that explain it. Page: fault-types.md.

    u, delta   rad, position of a healthy surface, and of this one: a frame says lo <= delta <= hi
    k          the judged frame, counted from the alarm on: a frame is judged one frame later
    p          rad, place of a surface that returns after a repair

With gyros whose errors change, each frame here is a block of frames.
"""

from math import ceil, inf, pi, radians
from typing import NamedTuple

import numpy as np

from reference.declaration import Declaration, Hypothesis
from reference.isolation import theta_interval
from reference.prediction import possible_servos

Interval = tuple[float, float]
UNLIMITED, NOTHING = (-inf, inf), (inf, -inf)
BLOCK_S, DEFAULT_RATE_RAD_S, RUNAWAY_SHARE, FAST_GROWTH = 0.2, pi / 3.0, 0.5, 1.8
HEALTHY_RAD = 1e-14
LEAST_HALF_CYCLES = 3


def meet(a: Interval, b: Interval) -> Interval:
    """What two intervals have in common; low > high if nothing."""
    return max(a[0], b[0]), min(a[1], b[1])


class Rules:
    """What is the same for all surfaces. T: length of a (block of) frame(s), s; half: half a period of the
    slowest oscillation, frames; one_step: whether a (block of) frame(s) is one JSBSim step; coarse: whether
    any error of the effects is declared."""

    def __init__(self, declaration: Declaration, coarse: bool) -> None:
        gyros = [declaration.error(name) for name in "pqr"]
        vary = any(gyro.sigma or gyro.resolution or gyro.slope for gyro in gyros)
        self.n, self.coarse = declaration.n, coarse
        self.frames = ceil(BLOCK_S / declaration.dt) if vary else 1
        self.T, self.one_step = self.frames * declaration.dt, self.frames * self.n == 1
        self.half = ceil(pi / declaration["slowest_oscillation_rad_s"] / self.T)


class Seen(NamedTuple):
    """What a frame says of a surface, rad. shows: a healthy aircraft cannot cause the frame.

    u_min, u_max: extremes of u in it. kappa: (G_max - G_min) / (4 |G|): the mean, weighted with G, of a
    moving position may be off by kappa times its range. hidden: whether the lower, the upper stop may hide a
    deviation. command (frames,): within the stops.
    """

    u: float
    lo: float
    hi: float
    shows: bool
    u_min: float
    u_max: float
    kappa: float
    hidden: tuple[bool, bool]
    command: np.ndarray


class Surface:
    """A surface: its actuator, what each frame says of it, and its types."""

    def __init__(self, declaration: Declaration, rules: Rules, of: Hypothesis) -> None:
        s = self.s = of.surface
        self.rules, self.name, self.reach = rules, declaration.aircraft.surfaces[s], (of.low, of.high)
        self.stops: Interval = tuple(declaration.aircraft.travel[:, s].tolist())
        servos, band, of_limit = possible_servos(declaration)
        dt_s, self.band, self.lagged = declaration.dt / declaration.n, float(band[s]), not servos.ideal
        self.steps = {*zip(servos.share[:, s].tolist(), servos.step[:, s].tolist(), strict=True)}
        least_share, least_step = (min(each) for each in zip(*self.steps, strict=True))
        limit = least_step / dt_s if least_step < inf else DEFAULT_RATE_RAD_S * (1.0 - of_limit[s])
        self.runaway = RUNAWAY_SHARE * limit
        self.slow = min(radians(declaration["slowest_rate_deg_s"]) * dt_s, least_step)
        self.near = self.slow / least_share + self.band
        self.uncertain = bool(declaration["bounds.actuators"])
        self.seen: list[Seen] = []
        self.begin()

    def begin(self) -> None:
        """Nothing is known yet: every type remains."""
        self.types = [kind(self) for kind in TYPES]
        self.count = self.unhidden = 0
        self.first: int | None = None

    def within(self, delta: float) -> float:
        """delta, or the stop that it is beyond."""
        return min(max(delta, self.stops[0]), self.stops[1])

    def offset(self, k: int) -> Interval:
        """delta - u in frame k."""
        return self.seen[k].lo - self.seen[k].u, self.seen[k].hi - self.seen[k].u

    def moved(self, p: float, command: float, side: int) -> float:
        """The farthest place to one side (1 up, -1 down) after a JSBSim step from p, by the declared errors
        of the actuator."""
        target = self.within(command + side * self.band)
        ways = [min(max((target - p) * share, -step), step) for share, step in self.steps]
        return p + (max(ways) if side > 0 else min(ways))

    def returned(self, p: float, k: int, side: int, at_any: bool = False) -> tuple[float, float, float]:
        """A return that starts at p with frame k (at_any: or at any instant of it), the farthest to one side:
        its mean over the frame, its end, and how far the mean may be off by G."""
        total, least, most, start = 0.0, p, p, p
        for command in self.seen[k].command:
            for _ in range(self.rules.n):
                total, least, most = total + p, min(least, p), max(most, p)
                p = self.moved(p, command, side)
                if at_any:
                    p = max(p, start) if side > 0 else min(p, start)
        return total / (len(self.seen[k].command) * self.rules.n), p, self.seen[k].kappa * (most - least)

    def judge(self, k: int, counts: bool) -> None:
        """Test every type with frame k, if it counts."""
        for one in self.types:
            one.see(k, not counts)
        if counts:
            self.count, self.unhidden = self.count + 1, self.unhidden + 1
            if self.seen[k].lo <= self.seen[k].hi:
                self.first = k if self.first is None else self.first
                for one in self.types:
                    one.narrow(one.explains(k))
        for one in self.types:
            one.leave(k)


class Type:
    """A type of fault on a surface: the set (low, high) of its parameter, and whether it is excluded.

    must_show: half-cycles for which a verdict waits until it has shown itself. wait: half-cycles that a fault
    of another surface needs while this type is left. follows: whether no constant deviation is left under any
    command. like: constant types that it can look like.
    """

    name, constant = "", True
    span: Interval = UNLIMITED
    must_show, wait, follows = 0, 1, True
    like: tuple[str, ...] = ()

    def __init__(self, of: Surface) -> None:
        self.of, self.excluded = of, False
        self.low, self.high = self.span

    @property
    def shown(self) -> bool:
        """Whether it has shown itself, if it must."""
        return True

    def see(self, k: int, skipped: bool) -> None:
        """Frame k, before it is judged; skipped: it is not."""

    def explains(self, k: int) -> Interval:
        """The parameters that explain frame k."""
        return UNLIMITED

    def narrow(self, found: Interval) -> None:
        """Intersect the set with what explains a frame."""
        if found != NOTHING:
            self.low, self.high = meet((self.low, self.high), found)
        self.excluded |= found == NOTHING or self.low > self.high

    def leave(self, k: int) -> None:
        """Go on to the end of frame k."""

    def places(self, k: int) -> Interval:
        """Where a surface with this fault is in frame k."""
        return self.of.reach

    def rules_out(self, other: "Type") -> bool:
        """Whether the movement so far contradicts this type where it looks like the other one."""
        return False


class Loss(Type):
    """delta = (1 + theta) u, the set is that of 1 + theta."""

    name, span = "loss_of_effectiveness", (0.0, 1.0)

    def explains(self, k: int) -> Interval:
        """|delta - (1 + theta) u| <= (hi - lo) / 2 about the middle."""
        seen = self.of.seen[k]
        return theta_interval(0.5 * (seen.lo + seen.hi), 0.5 * (seen.hi - seen.lo), seen.u, 0.0, 1.0)

    def places(self, k: int) -> Interval:
        u = self.of.seen[k].u
        low, high = sorted((self.low * u, self.high * u))
        return low, high


class VaryingLoss(Loss):
    """The same with any theta in each frame. A block in which u changes its sign says nothing."""

    constant, span, wait = False, UNLIMITED, 2

    def explains(self, k: int) -> Interval:
        low, high = super().explains(k)
        seen = self.of.seen[k]
        turns = self.of.rules.frames > 1 and seen.u_min < 0.0 < seen.u_max
        return UNLIMITED if low <= high or turns else NOTHING


class Bias(Type):
    """delta = u + theta, limited by the stops."""

    name = "bias"

    def explains(self, k: int) -> Interval:
        """delta - u; open to a side on which the surface may have been at its stop in any instant."""
        seen, (lower, upper) = self.of.seen[k], self.of.stops
        if seen.hi < lower or seen.lo > upper:
            return 1.0, -1.0
        low, high = self.of.offset(k)
        return (
            -inf if seen.lo - max(seen.u - seen.u_min, 0.0) <= lower else low,
            inf if seen.hi + max(seen.u_max - seen.u, 0.0) >= upper else high,
        )

    def places(self, k: int) -> Interval:
        """u + theta; if a stop limits it in any instant, between the extremes."""
        seen = self.of.seen[k]
        found = []
        for theta, end in ((self.low, seen.u_min), (self.high, seen.u_max)):
            limited = seen.u_min + theta < self.of.stops[0] or seen.u_max + theta > self.of.stops[1]
            found.append(self.of.within(end + theta) if limited else seen.u + theta)
        return found[0], found[1]


class GrowingBias(Bias):
    """delta = u + theta; theta keeps its sign and never shrinks.

    slow: where a theta can be that grows more slowly than a hardover; ran: whether theta certainly ran as
    fast, down or up.
    """

    constant, follows, like = False, False, ("loss_of_effectiveness", "stuck", "float", "hardover")

    def __init__(self, of: Surface) -> None:
        super().__init__(of)
        self.up = self.down = 0.0
        self.slow, self.ran, self.growth = UNLIMITED, [False, False], FAST_GROWTH * of.runaway * of.rules.T

    def see(self, k: int, skipped: bool) -> None:
        more = inf if skipped else self.growth
        self.slow = self.slow[0] - more, self.slow[1] + more

    def explains(self, k: int) -> Interval:
        low, high = super().explains(k)
        if low <= high:
            self.ran = [self.ran[0] or high < self.slow[0], self.ran[1] or low > self.slow[1]]
            more = 0.0 if self.of.rules.one_step else self.growth
            self.slow = max(self.slow[0], low - more), min(self.slow[1], high + more)
        if low == -inf or high == inf:
            return UNLIMITED
        self.up, self.down = max(self.up, low), min(self.down, high)
        up, down = self.up > 0.0, self.down < 0.0
        shrinks = (up and high < self.up) or (down and low > self.down)
        return NOTHING if low > high or (up and down) or shrinks else UNLIMITED

    def rules_out(self, other: Type) -> bool:
        return isinstance(other, Hardover) and self.ran[other.side > 0]


class Oscillation(Type):
    """delta - u changes its sign within half a period. A half-cycle ends where the sign changes; the first
    one is cut off. square: sum of (delta - u)^2 over the present half-cycle, and over the whole ones."""

    name, constant, must_show, like = "oscillatory", False, 2, ("rate_limit",)

    def __init__(self, of: Surface) -> None:
        super().__init__(of)
        self.sign, self.since, self.ends, self.square = 0, 0, [], [0.0, 0.0]

    def see(self, k: int, skipped: bool) -> None:
        self.square[0] += (0.5 * sum(self.of.offset(k))) ** 2
        if skipped:
            self.since = k + 1

    def explains(self, k: int) -> Interval:
        low, high = self.of.offset(k)
        sign = 1 if low > 0.0 else -1 if high < 0.0 else 0
        if sign == 0 or (not self.of.rules.one_step and self.of.seen[k].hidden[sign < 0]):
            self.since = k + 1
            return UNLIMITED
        if sign != self.sign:
            if self.sign:
                self.square[1] += self.square[0] if self.ends else 0.0
                self.square[0] = 0.0
                self.ends.append(k)
            self.sign, self.since = sign, k
        return NOTHING if k - self.since > self.of.rules.half else UNLIMITED

    @property
    def shown(self) -> bool:
        return len(self.ends) >= LEAST_HALF_CYCLES


class RateLimit(Type):
    """delta moves only towards the command, by at least `slow` in each JSBSim step until it is near.

    bound: where delta can be while it stays on one side of the command."""

    name, constant, like = "rate_limit", False, ("stuck", "float", "hardover")

    def __init__(self, of: Surface) -> None:
        super().__init__(of)
        self.side, self.last, self.bound = 0, -2, UNLIMITED

    def explains(self, k: int) -> Interval:
        of, rules, seen = self.of, self.of.rules, self.of.seen[k]
        commands = of.seen[k - 1].command
        if not rules.one_step:  # the first step still follows the command before
            commands = np.concatenate([commands, seen.command])
        low, high = commands.min(), commands.max()
        side, away = (1 if seen.lo > high else -1 if seen.hi < low else 0), False
        if side == 0 or side != self.side or k != self.last + 1:
            self.bound = seen.lo, seen.hi
        else:
            way, (least, most) = rules.n * rules.frames * of.slow, self.bound
            away = seen.lo > most if side > 0 else seen.hi < least
            if side > 0:
                self.bound = least, min(most, max(most - way, high + of.near))
            else:
                self.bound = max(least, min(least + way, low - of.near)), most
        self.bound, self.side, self.last = meet(self.bound, (seen.lo, seen.hi)), side, k
        return NOTHING if away else UNLIMITED


class Held(Type):
    """The surface is held somewhere, and may be released (after a repair).

    back: where it can be on its way back, of [earlier, later] releases; sets: the set before them; held: a
    place where a release can begin within this block.
    """

    side = 0
    parameter_is_place = False

    def __init__(self, of: Surface) -> None:
        super().__init__(of)
        self.released, self.held = False, NOTHING
        self.back: list[Interval] = [NOTHING, of.stops]
        self.sets = [(self.low, self.high)] * 2

    def see(self, k: int, skipped: bool) -> None:
        """A release may have happened as frame k began, or within the frame before; from where the type held
        the surface, and where it was seen. Towards the stop to which it runs it may have been further."""
        rules = self.of.rules
        if not self.of.lagged:
            return
        seen = self.of.seen[k if rules.one_step else k - 1]
        if self.parameter_is_place and self.back[0] == NOTHING:
            self.back = [self.back[1], NOTHING]
            self.sets = [self.sets[1], (self.low, self.high)]
        self.held, (low, high) = NOTHING, self.places(k if rules.one_step else k - 1)
        if max(low, seen.lo) <= min(high, seen.hi) and not self.released:
            self.held = (
                max(low, seen.lo) if rules.one_step or self.side >= 0 else low,
                min(high, seen.hi) if rules.one_step or self.side <= 0 else high,
            )
            self.join(self.held)

    def join(self, more: Interval) -> None:
        """Add to the later releases."""
        self.back[1] = min(self.back[1][0], more[0]), max(self.back[1][1], more[1])

    def explains(self, k: int) -> Interval:
        """Held here, or else released and on its way back."""
        seen, (low, high) = self.of.seen[k], self.places(k)
        returns = self.of.lagged and self.returns(k)
        if low <= seen.hi and high >= seen.lo and not self.released:
            return (seen.lo, seen.hi) if self.parameter_is_place else UNLIMITED
        self.released |= returns
        return UNLIMITED if returns else NOTHING

    def returns(self, k: int) -> bool:
        """Whether a return explains frame k; those that do not are forgotten."""
        seen, found = self.of.seen[k], False
        if self.of.rules.frames > 1 and self.held != NOTHING:
            (low, _, less), (high, _, more) = self.both(self.held, k, True)
            found = low - less <= seen.hi and high + more >= seen.lo
        if not found:
            self.held = NOTHING
        for j, (a, b) in enumerate(self.back):
            if a > b:
                continue
            (low, _, less), (high, _, more) = self.both((a, b), k)
            off = max(less, more)
            healthy = max(abs(low - off - seen.u), abs(high + off - seen.u)) <= HEALTHY_RAD
            if healthy or low - off > seen.hi or high + off < seen.lo:
                self.back[j] = NOTHING
                continue
            found = True
            if not self.of.uncertain:  # the mean changes by no more than where the return began
                ends = a + max(seen.lo - low - off, 0.0), b - max(high - off - seen.hi, 0.0)
                self.back[j] = min(ends), max(ends)
        return found

    def both(self, ends: Interval, k: int, at_any: bool = False) -> list[tuple[float, float, float]]:
        """Returns from both ends, each the farthest to its side."""
        return [self.of.returned(p, k, side, at_any) for p, side in zip(ends, (-1, 1), strict=True)]

    def leave(self, k: int) -> None:
        """To the end of frame k. A surface that looks healthy may be held again; its set is then that before
        the earliest return that is still possible."""
        if not self.of.lagged:
            return
        healthy = not self.of.seen[k].shows
        for j in (1, 0):
            if self.back[j][0] <= self.back[j][1]:
                ends = [end for _, end, _ in self.both(self.back[j], k)]
                self.back[j] = min(ends), max(ends)
                if healthy:
                    self.low, self.high = self.sets[j]
        self.released &= not healthy
        if self.of.rules.frames > 1 and self.held != NOTHING:
            self.join((self.both(self.held, k, True)[0][1], self.both(self.held, k, True)[1][1]))


class Stuck(Held):
    """delta = theta."""

    name, parameter_is_place = "stuck", True

    def __init__(self, of: Surface) -> None:
        self.span = of.stops
        super().__init__(of)

    def places(self, k: int) -> Interval:
        return self.low, self.high


class Float(Held):
    """delta = 0, or the nearest stop."""

    name = "float"

    def places(self, k: int) -> Interval:
        return self.of.within(0.0), self.of.within(0.0)


class Hardover(Held):
    """delta moves to a stop at half its rate limit or faster, from where it was seen first."""

    name = "hardover"

    def places(self, k: int) -> Interval:
        of = self.of
        if of.first is None:
            return of.stops
        frames = k - of.first if of.rules.frames == 1 else max(k - of.first - 1, 0)
        way, first = of.runaway * of.rules.T * frames, of.seen[of.first]
        if self.side > 0:
            return min(of.stops[1], first.lo + way), of.stops[1]
        return of.stops[0], max(of.stops[0], first.hi - way)


class HardoverUp(Hardover):
    """To the upper stop."""

    side = 1


class HardoverDown(Hardover):
    """To the lower stop."""

    side = -1


TYPES = (
    Loss, Stuck, Float, HardoverUp, HardoverDown, Bias,
    VaryingLoss, Oscillation, RateLimit, GrowingBias,
)  # fmt: skip
