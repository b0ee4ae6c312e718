"""A bank of detection filters on one innovation, and the reach of each fault: its possible effect on them.

    nu[k] = (x[k+1] - x[k]) / dt - F[k] = eta[k] + phi[k]
    E_m[k+1] = a_m E_m[k] + dt nu[k],   a_m = exp(-lam_m dt)

Every filter has the exact bound of its own pole, so the alarm is the first of theirs at no cost in false
alarms. A pole far above the frame rate (`DEADBEAT_PER_S`) tests the innovation itself, |nu| > eta_bar; for
a bound that holds instant by instant no filter, window or sum of innovations can alarm earlier
(docs/theory.md, section 3). Slower poles earn their place where errors are correlated over frames, as
measurement errors are.
"""

from math import exp

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.bounds.admitted import poles_for_noise
from beaver_ftc.diagnosis.detection.thresholds import bound_step, noise_step
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import MAX_POLES, FdiConfig

# The bank of detection filters; filter 0 is the published one. decay: a_m; eta, noise rad/s: parts of the
# threshold; innovation rad/s2; residual, threshold rad/s; closest: largest share of its bound that each
# filter has reached in healthy flight.
CONFIG = record(n=int, decay=MAX_POLES)
MEMORY = record(eta=(MAX_POLES, 3), noise=(MAX_POLES, 3))
OUTPUT = record(innovation=3, residual=(MAX_POLES, 3), threshold=(MAX_POLES, 3), closest=MAX_POLES)
BANK = record(config=CONFIG, memory=MEMORY, output=OUTPUT)


def poles_of(config: FdiConfig, declared: Declared) -> tuple[float, ...]:
    """The filters' poles, 1/s, the published one first."""
    for_noise = poles_for_noise(declared.sensors, max(declared.constant_rad_s2))
    further = (*config.pole_bank_per_s, *for_noise) if config.sharpen.pole_bank else ()
    return (config.detection_pole_per_s, *further)[:MAX_POLES]


def configure(bank: np.void, config: FdiConfig, declared: Declared, dt: float) -> None:
    """Fill in the filters' poles: those of the scenario, and those that noise asks for."""
    poles = poles_of(config, declared)
    bank["config"]["n"] = len(poles)
    bank["config"]["decay"][: len(poles)] = [exp(-pole * dt) for pole in poles]


@kernel
def begin(bank, noise):
    """Start with the full bound on the change of the gyros' errors, noise (3,) rad/s."""
    bank.memory.noise[: bank.config.n] = noise


@kernel
def hold_threshold(bank, constant):
    """Replace the threshold of the published filter by a constant, rad/s."""
    bank.output.threshold[0] = constant


@kernel
def align(isolation, G):
    """Fix, once, the direction along which each fault has least effect; G (3, n) at the start of the flight.

    Unit length, in the roll-yaw plane, whose two axes are the only ones that one surface moves together.
    The bound is exact for any fixed direction; this one has power while G keeps its direction, which
    depends on alpha alone, and weakly.
    """
    for fie in isolation.estimator[: isolation.config.n]:
        p, r = G[0, fie.surface], G[2, fie.surface]
        length = np.hypot(p, r)
        if length > 0.0:
            fie.across[0], fie.across[2] = r / length, -p / length


@kernel
def innovate(bank, bound, x, x_then, believed, dt):
    """Form the innovation of the elapsed frame and pass it through the bank.

    x, x_then (3,) rad/s: measured now and a frame ago; believed (3,) rad/s2: f + G u of the healthy
    aircraft, mean over the frame. bound: of `bound_dtype`; dt s.
    """
    for i in range(3):
        bank.output.innovation[i] = (x[i] - x_then[i]) / dt - believed[i]
        bound.frame[i] = bound.eta_bar[i] + (bound.noise[i] + bound.noise_then[i]) / dt
        for m, a in enumerate(bank.config.decay[: bank.config.n]):
            bank.output.residual[m, i] = a * bank.output.residual[m, i] + dt * bank.output.innovation[i]
            bank.memory.eta[m, i] = bound_step(bank.memory.eta[m, i], bound.eta_bar[i], a, dt)
            bank.memory.noise[m, i] = noise_step(bank.memory.noise[m, i], bound.noise_then[i], a)
            bank.output.threshold[m, i] = bank.memory.eta[m, i] + bank.memory.noise[m, i] + bound.noise[i]


@kernel
def alarm(bank):
    """The first axis on which a filter of the bank leaves its bound, or -1."""
    for i in range(3):
        for m in range(bank.config.n):
            if abs(bank.output.residual[m, i]) > bank.output.threshold[m, i]:
                return i
    return -1


@kernel
def share_of(bank, m, i):
    """The share of its bound that filter m reaches on axis i."""
    bound = bank.output.threshold[m, i]
    return abs(bank.output.residual[m, i]) / bound if bound > 0.0 else 0.0


@kernel
def nearest(bank, i):
    """The filter that is nearest to its bound on axis i: the one the alarm comes from, if there is one."""
    m_nearest, largest = 0, 0.0
    for m in range(bank.config.n):
        share = share_of(bank, m, i)
        if share > largest:
            m_nearest, largest = m, share
    return m_nearest


@kernel
def largest_share(bank):
    """The largest share of its bound that a filter of the bank reaches."""
    largest = 0.0
    for m in range(bank.config.n):
        for i in range(3):
            largest = max(largest, share_of(bank, m, i))
    return largest


@kernel
def note_closest_approach(bank):
    """Keep the largest share of its bound that each filter has reached."""
    for m in range(bank.config.n):
        for i in range(3):
            bank.output.closest[m] = max(bank.output.closest[m], share_of(bank, m, i))


@kernel
def extremes(fie, i):
    """Least and greatest acceleration (rad/s2) of axis i: theta anywhere in its set, or no fault at all."""
    base, slope, spread = fie.effect.offset[i], fie.effect.Z[i], fie.effect.spread[i]
    one, other = base + fie.low * slope, base + fie.high * slope
    return min(0.0, one, other) - spread, max(0.0, one, other) + spread


@kernel
def aligned_extremes(fie):
    """The same along `fie.across` (3,), across the fault's own direction: there it can do little."""
    effect, base, slope, spread = fie.effect, 0.0, 0.0, 0.0
    for i in range(3):
        spread += abs(fie.across[i]) * effect.spread[i]
        base += fie.across[i] * effect.offset[i]
        slope += fie.across[i] * effect.Z[i]
    one, other = base + fie.low * slope, base + fie.high * slope
    return min(0.0, one, other) - spread, max(0.0, one, other) + spread


@kernel
def remember(bank, fie, dt):
    """Advance the reach of the fault in each filter since the flight began; channel 3 is along `across`."""
    for channel in range(4):
        low, high = extremes(fie, channel) if channel < 3 else aligned_extremes(fie)
        for m, a in enumerate(bank.config.decay[: bank.config.n]):
            fie.reach_low[m, channel] = a * fie.reach_low[m, channel] + dt * low
            fie.reach_high[m, channel] = a * fie.reach_high[m, channel] + dt * high


@kernel
def explains(bank, fie, shared):
    """True if the residuals are within the reach of the fault, for any course of it since the flight began.

    shared: the axes share one parameter; the residual along `across` is then tested as well.
    """
    for m in range(bank.config.n):
        residual, bound = 0.0, 0.0
        for i in range(3):
            r, b = bank.output.residual[m, i], bank.output.threshold[m, i]
            if not fie.reach_low[m, i] - b <= r <= fie.reach_high[m, i] + b and not fie.ignored_axes[i]:
                return False
            residual += fie.across[i] * r
            bound += abs(fie.across[i]) * b
        if shared and not fie.reach_low[m, 3] - bound <= residual <= fie.reach_high[m, 3] + bound:
            return False
    return True
