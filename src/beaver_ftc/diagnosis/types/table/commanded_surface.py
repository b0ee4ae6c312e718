"""Surfaces that move by their command, but wrongly: loss, bias, oscillation, rate limit.

*Loss of effectiveness*: p = (1 + theta) u, one 1 + theta in [0, 1], or any in every frame (incipient).

*Bias*: p = u + b, cut off by the stops; b constant, or of one sign and never smaller than before. At a stop
an offset that grows looks like a runaway. The speed on the way to the stop distinguishes them: an offset that
grows almost as fast as a runaway counts as one.

*Oscillation*: p - u swings about 0, no half-cycle longer than that of the slowest oscillation. Counting
half-cycles above a level that noise cannot reach is how oscillatory failures are monitored in service
[Goupil2010].

*Rate limit*: p moves only towards its command, at any rate down to the slowest declared. A slower surface
counts as stuck: the two types are each other's limit, and only a least rate distinguishes them.
"""

from math import pi, sqrt

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis import isolation
from beaver_ftc.diagnosis.types.contract import (
    EMPTY_SET,
    REST_EXCLUDES,
    REST_HIDES,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    UNLIMITED_SET,
    WAIT_FOR_SURFACE,
    FaultType,
    feasible_set,
    observed_error_of,
    set_middle,
    set_middle_of,
    within_travel,
)


@kernel
def consistent_effectiveness(surface):
    """The interval of 1 + theta in [0, 1] that agrees with the judged frame; low > high if none."""
    low, high = surface.judged.low, surface.judged.high
    return isolation.consistent_parameters(
        0.5 * (low + high), 0.5 * (high - low), surface.judged.command, 0.0, 1.0
    )


@kernel
def effectiveness_range(surface):
    """Of 1 + theta: between nothing and all may be left."""
    return 0.0, 1.0


@kernel
def judge_loss(config, surface, kind, k):
    """The effectiveness that explains this frame."""
    return consistent_effectiveness(surface)


@kernel
def loss_deflection(config, surface, kind, k):
    """The command times what can be left."""
    low, high, u = surface.feasible.low[kind], surface.feasible.high[kind], surface.elapsed.command
    return min(low * u, high * u), max(low * u, high * u)


@kernel
def judge_varying_loss(config, surface, kind, k):
    """Some effectiveness explains this frame; over a block in which the command changes sign, any mean."""
    low, high = consistent_effectiveness(surface)
    swung = config.length > 1 and surface.commands.least[1] < 0.0 < surface.commands.greatest[1]
    return EMPTY_SET if low > high and not swung else UNLIMITED_SET


def loss_estimate(fdi: np.void, s: int, kind: int) -> float | None:
    """theta; with a second fault present the estimator, which fits all axes of its surface, is not used."""
    return set_middle_of(fdi, s, kind) - 1.0 if fdi["types"]["pair"]["enabled"] else fitted_loss(fdi, s, kind)


def fitted_loss(fdi: np.void, s: int, kind: int) -> float:
    """theta as the estimator of a loss has it."""
    estimator = fdi["isolation"]["estimator"][int(fdi["layout"]["loss_estimator"][s])]
    return float(estimator["theta"][int(fdi["layout"]["dominant_axis"][s])])


def loss_interval(fdi: np.void, s: int, kind: int) -> tuple[float, float] | None:
    """Of theta."""
    low, high = feasible_set(fdi, s, kind)
    return low - 1.0, high - 1.0


LOSS = FaultType(
    name="loss_of_effectiveness", constant=True, rank=1,
    whole_range=effectiveness_range, judge=judge_loss, deflection=loss_deflection,
    accommodation=SCALE_COMMAND, limit="float", estimate=loss_estimate, interval=loss_interval,
)  # fmt: skip
VARYING_LOSS = FaultType(
    name="loss_of_effectiveness", words="loss_of_effectiveness that varies", constant=False, rank=1,
    judge=judge_varying_loss, half_cycles=2, accommodation=SCALE_COMMAND, estimate=fitted_loss,
)  # fmt: skip


RUNAWAY_RATE_RATIO = 1.8  # times the least pace of a runaway, half of the rate limit at which it runs


@kernel
def judged_offset(surface):
    """How far off its command the surface was in the judged frame, (low, high) rad: unlimited at a stop.

    A surface at its stop may be off by more than it shows; so may one that was there at an instant of it.
    Nothing but a loss takes it beyond.
    """
    low, high, u, commands = surface.judged.low, surface.judged.high, surface.judged.command, surface.commands
    if high < surface.actuator.travel_low or low > surface.actuator.travel_high:
        return isolation.EMPTY_SET
    least, greatest = low - max(u - commands.least[1], 0.0), high + max(commands.greatest[1] - u, 0.0)
    off_low = low - u if least > surface.actuator.travel_low else -np.inf
    return off_low, high - u if greatest < surface.actuator.travel_high else np.inf


@kernel
def judge_bias(config, surface, kind, k):
    """The offsets that explain this frame."""
    return judged_offset(surface)


@kernel
def bias_error(surface, kind):
    """Off its command, rad, by the middle of its set; unlimited while an end of that is open."""
    low, high = surface.feasible.low[kind], surface.feasible.high[kind]
    return set_middle(surface, kind) if high - low < np.inf else np.inf


@kernel
def bias_deflection(config, surface, kind, k):
    """The command and the offset, cut off by the stops."""
    low = limited_deflection(surface, surface.feasible.low[kind], surface.commands.least[0])
    return low, limited_deflection(surface, surface.feasible.high[kind], surface.commands.greatest[0])


@kernel
def limited_deflection(surface, off, extreme):
    """Where an offset (rad) takes a surface in the mean; if a stop is met at an instant, at the `extreme`."""
    commands, actuator, mean = surface.commands, surface.actuator, surface.elapsed.command + off
    met = commands.least[0] + off < actuator.travel_low or commands.greatest[0] + off > actuator.travel_high
    return within_travel(surface, extreme + off) if met else mean


def bias_interval(fdi: np.void, s: int, kind: int) -> tuple[float, float] | None:
    """Of the offset, rad; None while one end is open."""
    low, high = feasible_set(fdi, s, kind)
    return (low, high) if np.isfinite(low) and np.isfinite(high) else None


@kernel
def begin_growing_bias(surface, kind):
    """It has not grown yet."""
    grown = surface.growing_bias
    grown.up = grown.down = 0.0
    grown.ran[:] = 0
    clear_offset_range(grown)


@kernel
def clear_offset_range(grown):
    """Its offset is not known."""
    grown.least, grown.greatest = -np.inf, np.inf


@kernel
def growth_per_frame(config, surface):
    """How far one that is slower than a runaway moves from one judged frame to the next, rad at most."""
    return RUNAWAY_RATE_RATIO * surface.actuator.least_runaway_rate * config.block_s


@kernel
def widen_offset_range(config, surface, kind):
    """Widen the interval of the offset by what one that is slower than a runaway moves in a frame."""
    way = growth_per_frame(config, surface)
    surface.growing_bias.least -= way
    surface.growing_bias.greatest += way


@kernel
def skip_growing_bias(config, surface, kind, k):
    """The fault may have gone, and begin again with any offset."""
    clear_offset_range(surface.growing_bias)


@kernel
def compare_with_growth(config, surface, least, greatest):
    """Hold an offset between least and greatest (rad) against what a slower one can be. A mean over several
    instants may be that of the last of them."""
    grown = surface.growing_bias
    if greatest < grown.least:
        grown.ran[0] = 1
    if least > grown.greatest:
        grown.ran[1] = 1
    spare = 0.0 if config.whole else growth_per_frame(config, surface)
    grown.least, grown.greatest = max(grown.least, least - spare), min(grown.greatest, greatest + spare)


@kernel
def judge_growing_bias(config, surface, kind, k):
    """It keeps its sign and does not shrink; at a stop it may be larger than it shows."""
    least, greatest = judged_offset(surface)
    if least <= greatest:
        compare_with_growth(config, surface, least, greatest)
    if np.isinf(least) or np.isinf(greatest):
        return UNLIMITED_SET
    grown = surface.growing_bias
    grown.up, grown.down = max(grown.up, least), min(grown.down, greatest)
    above, below = grown.up > 0.0, grown.down < 0.0
    shrinks = (above and greatest < grown.up) or (below and least > grown.down)
    return EMPTY_SET if least > greatest or (above and below) or shrinks else UNLIMITED_SET


@kernel
def ran_to_stop(surface, direction):
    """Whether the surface has moved towards that stop as fast as only a runaway does."""
    if direction == 0:
        return False
    return surface.growing_bias.ran[1 if direction > 0 else 0] == 1


def last_offset(fdi: np.void, s: int, kind: int) -> float | None:
    """Offset in the last frame, rad."""
    return observed_error_of(fdi["types"]["surface"][s])


BIAS = FaultType(
    name="bias", constant=True, rank=6,
    judge=judge_bias, deflection=bias_deflection,
    accommodation=SUBTRACT_OFFSET, expected_error=bias_error, error_rank=2, estimate=set_middle_of,
    interval=bias_interval,
)  # fmt: skip
GROWING_BIAS = FaultType(
    name="bias", words="bias that grows", constant=False, rank=4,
    begin=begin_growing_bias, on_frame=widen_offset_range, judge=judge_growing_bias,
    on_skipped_frame=skip_growing_bias,
    record="growing_bias",
    memory=record(
        up=float, down=float,  # how far it has certainly grown, rad
        # between what a slower one lies, rad; whether it has certainly run as fast as a runaway, down and up
        least=float, greatest=float, ran=(int, 2),
    ),
    # an offset that grows ends as good as constant, with any commands
    follows_command=False,
    # as the command happens to go it looks like a jam or a loss; come to the stop by and by, like a runaway
    mistaken_for=("loss_of_effectiveness", "stuck", "float", "hardover"), differs=ran_to_stop,
    accommodation=SUBTRACT_OFFSET, estimate=last_offset,
)  # fmt: skip


HALF_CYCLES_THAT_SHOW = 3


@kernel
def begin_oscillation(surface, kind):
    """No half-cycle has been seen."""
    surface.oscillatory.half_cycles = surface.oscillatory.sign = 0


@kernel
def add_squared_error(config, surface, kind):
    """Sum the squares of the deflection error."""
    error = 0.5 * (surface.judged.low + surface.judged.high) - surface.judged.command
    surface.oscillatory.square += error**2


@kernel
def judge_oscillation(config, surface, kind, k):
    """Count half-cycles; a sign that stays for longer than the slowest half-cycle is no oscillation.

    At a stop half of a swing is hidden: where several instants are seen at once, the mean of a quick one
    keeps its sign.
    """
    swing = surface.oscillatory
    low, high = surface.judged.low - surface.judged.command, surface.judged.high - surface.judged.command
    sign = 1 if low > 0.0 else (-1 if high < 0.0 else 0)
    if sign == 0 or (not config.whole and surface.judged.stop_hides[0 if sign > 0 else 1]):
        swing.steady_since = k + 1
        return UNLIMITED_SET
    if sign != swing.sign:
        end_half_cycle(swing, k)
        swing.sign, swing.steady_since = sign, k
    return EMPTY_SET if k - swing.steady_since > config.half_cycle_frames else UNLIMITED_SET


@kernel
def end_half_cycle(swing, k):
    """A half-cycle ends here; the first one is cut off at its beginning and does not count."""
    if swing.sign != 0:
        if swing.half_cycles == 0:
            swing.first_end = k
        else:
            swing.squares += swing.square
        swing.last_end = k
        swing.half_cycles += 1
        swing.square = 0.0


@kernel
def skip_oscillation(config, surface, kind, k):
    """In a frame that is not judged it may have swung to the other side, unseen."""
    surface.oscillatory.steady_since = k + 1


@kernel
def oscillation_has_shown(surface):
    """Whether it has swung for two half-cycles and more."""
    return surface.oscillatory.half_cycles >= HALF_CYCLES_THAT_SHOW


def amplitude(fdi: np.void, s: int, kind: int) -> float | None:
    """Amplitude, rad."""
    swing = fdi["types"]["surface"][s]["oscillatory"]
    return float(sqrt(2.0 * swing["squares"] / (swing["last_end"] - swing["first_end"])))


def oscillation_frequency_rad_s(fdi: np.void, s: int, kind: int) -> float | None:
    """From the half-cycles counted."""
    swing = fdi["types"]["surface"][s]["oscillatory"]
    half_cycles, frames = int(swing["half_cycles"]) - 1, int(swing["last_end"] - swing["first_end"])
    return half_cycles * pi / (float(fdi["types"]["config"]["block_s"]) * frames)


OSCILLATORY = FaultType(
    name="oscillatory", constant=False, rank=2,
    begin=begin_oscillation, on_frame=add_squared_error, judge=judge_oscillation,
    on_skipped_frame=skip_oscillation, record="oscillatory",
    memory=record(
        sign=int, steady_since=int,
        half_cycles=int, first_end=int, last_end=int,  # ends of half-cycles, frames
        square=float, squares=float,  # of the deflection error, rad2: this half-cycle, those before
    ),
    has_shown=oscillation_has_shown, shows_within=2, at_rest=REST_EXCLUDES, mistaken_for=("rate_limit",),
    accommodation=SUBTRACT_OFFSET, estimate=amplitude, frequency_rad_s=oscillation_frequency_rad_s,
)  # fmt: skip


@kernel
def begin_rate_limit(surface, kind):
    """No frame has been seen, and none before it."""
    surface.rate_limit.at = -2


@kernel
def judge_rate_limit(config, surface, kind, k):
    """It never moves away from its command, so while it stands on one side it comes nearer.

    Of several JSBSim frames in one of ours the first is the old command's.
    """
    low, high, run = surface.judged.low, surface.judged.high, surface.rate_limit
    sign, retreats = side_of_command(config, surface), False
    if sign == 0 or sign != run.sign or k != run.at + 1:
        run.low, run.high = low, high
    else:
        retreats = (sign > 0 and low > run.high) or (sign < 0 and high < run.low)
        narrow_by_least_rate(config, surface, run, sign)
    run.low, run.high = max(run.low, low), min(run.high, high)
    run.sign, run.at = sign, k
    return EMPTY_SET if retreats else UNLIMITED_SET


@kernel
def narrow_by_least_rate(config, surface, run, sign):
    """Take off what the slowest one comes nearer by within the judged frame: a least step an instant, until
    its lag makes the steps smaller. Where it was at an instant bounds where it is a frame later."""
    least = config.instants * config.length * surface.actuator.slowest_step
    close = surface.actuator.slowest_step / surface.actuator.approach
    lowest, highest = command_range(config, surface)
    if sign > 0:
        run.high = min(run.high, max(run.high - least, highest + close))
    elif sign < 0:
        run.low = max(run.low, min(run.low + least, lowest - close))


@kernel
def command_range(config, surface):
    """The least and greatest order that moved it towards and within the judged frame, rad."""
    commands = surface.commands
    newest = 2 if config.whole else 1
    return min(commands.low[2], commands.low[newest]), max(commands.high[2], commands.high[newest])


@kernel
def side_of_command(config, surface):
    """1 for a surface certainly above all it was ordered to, -1 below, 0 otherwise."""
    lowest, highest = command_range(config, surface)
    return 1 if surface.judged.low > highest else (-1 if surface.judged.high < lowest else 0)


RATE_LIMIT = FaultType(
    name="rate_limit", constant=False, rank=3,
    begin=begin_rate_limit, judge=judge_rate_limit, record="rate_limit",
    memory=record(
        low=float, high=float,  # where it can be while it stands on one side of its command, rad
        sign=int, at=int,  # which side, and the last frame of which that is known
    ),
    # a slow surface that has not been seen to creep looks as if it stood still
    at_rest=REST_HIDES, mistaken_for=("stuck", "float", "hardover"), accommodation=WAIT_FOR_SURFACE,
)  # fmt: skip
TYPES = LOSS, VARYING_LOSS, BIAS, GROWING_BIAS, OSCILLATORY, RATE_LIMIT
