"""The worst-case detector: a bank of filters of the innovation with adaptive thresholds, and the FDAE.

    nu[k] = (x[k+1] - x[k]) / dt - F[k] = eta[k] + phi[k]
    E_m[k+1] = a_m E_m[k] + dt nu[k],   a_m = exp(-lam_m dt)

All filters are exact for the discrete truth x[k+1] = x[k] + dt (F[k] + eta[k]): a residual obeys eps[k+1] = a
eps[k] + dt eta[k], and its bound obeys the same with eta_bar in place of eta. The guarantees of the theory
therefore hold at any frame rate, without an allowance for discretisation.

Every filter has the exact bound of its own pole, so the alarm is the first of theirs without further false
alarms. A pole far above the frame rate (`DEADBEAT_PER_S`) tests the innovation itself, |nu| > eta_bar; for a
bound that holds instant by instant no filter, window or sum of innovations can alarm earlier (docs/theory.md,
section 3). Slower poles detect more if errors are correlated over frames, as measurement errors are. The
reach of a fault is its possible effect on the filters since the start of the flight.

The fault detection and approximation estimator (FDAE) is always on:

    xhat0' = -Lambda0 (xhat0 - x) + f + G u + fhat,  eps0 = x - xhat0,  alarm when |eps0_i| > ebar_i, some i

[Zhang2005, sec. IV]. Until the alarm eps0 is filter 0 of the bank, which raises it. In discrete time
xhat0[k+1] = x[k] + dt F[k] + exp(-Lambda0 dt) (xhat0[k] - x[k]).

Its network approximates the fault by Gaussian radial basis functions of alpha and of beta, linear in its
weights:

    fhat_i = W_i^T Phi(alpha, beta)       W_i' = P{gain Phi D[eps_i] - leak W_i},   |Phi| = 1

[Zhang2005, sec. IV and V]. Phi is normalised, so that `gain` alone sets the bandwidth of learning at any
state. D is a continuous dead zone at the detection threshold: the network cannot learn what the declared
uncertainty explains.
"""

from math import exp

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.bounds import poles_for_noise
from beaver_ftc.diagnosis.state import STATISTICAL_DETECTOR, WORST_CASE_DETECTOR
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import MAX_POLES, FdiConfig
from beaver_ftc.scenario.schema import Scenario


@kernel
def bound_step(bound, eta_bar, decay, dt):
    """Advance ebar' = -lam ebar + eta_bar by one frame [Zhang2005, sec. IV].

    Units: bound rad/s, eta_bar rad/s2, decay = exp(-lam dt), dt s.
    """
    return decay * bound + dt * eta_bar


@kernel
def noise_step(noise, nbar, decay):
    """Advance the filtered bound on a gyro's changing error, rad/s, by one frame; nbar as the frame began.

    See bounds.py: what a residual may owe to the gyro is this and the present nbar.
    """
    return decay * noise + (1.0 - decay) * nbar


@kernel
def interval_limits(low, high, positive_Z, negative_Z, omega, theta, bound):
    """The signed interval (lower, upper), rad/s, that holds the residual of the true estimator.

    The parameter may move anywhere within [low, high] at every instant, so an incipient or intermittent
    fault is covered: int w Z theta lies between low rise + high fall and high rise + low fall, where rise
    and fall filter the positive and the negative part of Z. The residual is that integral less omega
    thetahat, widened by the bound on the uncertainty.
    """
    lower = low * positive_Z + high * negative_Z - omega * theta - bound
    upper = high * positive_Z + low * negative_Z - omega * theta + bound
    return lower, upper


@kernel
def norm_limits(low, high, omega, theta, bound):
    """The norm bound mu = k |Omega| + bound, rad/s, symmetric; k bounds |theta - thetahat| [Zhang2005, via
    Zhang2002].
    """
    mu = max(theta - low, high - theta) * abs(omega) + bound
    return -mu, mu


# The bank of detection filters; filter 0 is the published one. decay: a_m; eta, noise rad/s: parts of the
# threshold; innovation rad/s2; residual, threshold rad/s; closest: largest share of its bound that each
# filter has reached in healthy flight.
BANK_CONFIG = record(n=int, decay=MAX_POLES)
BANK_MEMORY = record(eta=(MAX_POLES, 3), noise=(MAX_POLES, 3))
BANK_OUTPUT = record(innovation=3, residual=(MAX_POLES, 3), threshold=(MAX_POLES, 3), closest=MAX_POLES)
BANK = record(config=BANK_CONFIG, memory=BANK_MEMORY, output=BANK_OUTPUT)


def poles_of(config: FdiConfig, declared: Declared) -> tuple[float, ...]:
    """The filters' poles, 1/s, the published one first."""
    for_noise = poles_for_noise(declared.sensors, max(declared.constant_rad_s2))
    further = (*config.pole_bank_per_s, *for_noise) if config.sharpen.pole_bank else ()
    return (config.detection_pole_per_s, *further)[:MAX_POLES]


def configure_bank(bank: np.void, config: FdiConfig, declared: Declared, dt: float) -> None:
    """Fill in the filters' poles: those of the scenario, and those that noise asks for."""
    poles = poles_of(config, declared)
    bank["config"]["n"] = len(poles)
    bank["config"]["decay"][: len(poles)] = [exp(-pole * dt) for pole in poles]


@kernel
def begin_bank(bank, noise):
    """Start with the full bound on the change of the gyros' errors, noise (3,) rad/s."""
    bank.memory.noise[: bank.config.n] = noise


@kernel
def set_bank_threshold(bank, constant):
    """Replace the threshold of the published filter by a constant, rad/s."""
    bank.output.threshold[0] = constant


@kernel
def set_parity_directions(isolation, G):
    """Fix, once, the direction along which each fault has least effect; G (3, n) at the start of the flight.

    Unit length, in the roll-yaw plane, whose two axes are the only ones that one surface moves together.
    The bound is exact for any fixed direction; this one has power while G keeps its direction, which
    depends on alpha alone, and weakly.
    """
    for fie in isolation.estimator[: isolation.config.n]:
        p, r = G[0, fie.surface], G[2, fie.surface]
        length = np.hypot(p, r)
        if length > 0.0:
            fie.parity_direction[0], fie.parity_direction[2] = r / length, -p / length


@kernel
def update_bank(bank, bound, x, x_before, predicted_acceleration, dt):
    """Form the innovation of the elapsed frame and pass it through the bank.

    x, x_before (3,) rad/s: measured now and a frame ago; predicted_acceleration (3,) rad/s2: f + G u of the
    healthy aircraft, mean over the frame. bound: of `bound_dtype`; dt s.
    """
    for i in range(3):
        bank.output.innovation[i] = (x[i] - x_before[i]) / dt - predicted_acceleration[i]
        bound.frame[i] = bound.eta_bar[i] + (bound.noise[i] + bound.noise_before[i]) / dt
        for m, a in enumerate(bank.config.decay[: bank.config.n]):
            bank.output.residual[m, i] = a * bank.output.residual[m, i] + dt * bank.output.innovation[i]
            bank.memory.eta[m, i] = bound_step(bank.memory.eta[m, i], bound.eta_bar[i], a, dt)
            bank.memory.noise[m, i] = noise_step(bank.memory.noise[m, i], bound.noise_before[i], a)
            bank.output.threshold[m, i] = bank.memory.eta[m, i] + bank.memory.noise[m, i] + bound.noise[i]


@kernel
def bank_alarm_axis(bank):
    """The first axis on which a filter of the bank leaves its bound, or -1."""
    for i in range(3):
        for m in range(bank.config.n):
            if abs(bank.output.residual[m, i]) > bank.output.threshold[m, i]:
                return i
    return -1


@kernel
def threshold_share(bank, m, i):
    """The share of its bound that filter m reaches on axis i."""
    bound = bank.output.threshold[m, i]
    return abs(bank.output.residual[m, i]) / bound if bound > 0.0 else 0.0


@kernel
def nearest_filter(bank, i):
    """The filter that is nearest to its bound on axis i: the one the alarm comes from, if there is one."""
    m_nearest, largest = 0, 0.0
    for m in range(bank.config.n):
        share = threshold_share(bank, m, i)
        if share > largest:
            m_nearest, largest = m, share
    return m_nearest


@kernel
def largest_share(bank):
    """The largest share of its bound that a filter of the bank reaches."""
    largest = 0.0
    for m in range(bank.config.n):
        for i in range(3):
            largest = max(largest, threshold_share(bank, m, i))
    return largest


@kernel
def note_closest_approach(bank):
    """Keep the largest share of its bound that each filter has reached."""
    for m in range(bank.config.n):
        for i in range(3):
            bank.output.closest[m] = max(bank.output.closest[m], threshold_share(bank, m, i))


@kernel
def effect_extremes(fie, i):
    """Least and greatest acceleration (rad/s2) of axis i: theta anywhere in its set, or no fault at all."""
    base, slope, spread = fie.effect.offset[i], fie.effect.Z[i], fie.effect.spread[i]
    one, other = base + fie.low * slope, base + fie.high * slope
    return min(0.0, one, other) - spread, max(0.0, one, other) + spread


@kernel
def parity_effect_extremes(fie):
    """The same along `fie.parity_direction` (3,), in which the fault has little effect."""
    effect, base, slope, spread = fie.effect, 0.0, 0.0, 0.0
    for i in range(3):
        spread += abs(fie.parity_direction[i]) * effect.spread[i]
        base += fie.parity_direction[i] * effect.offset[i]
        slope += fie.parity_direction[i] * effect.Z[i]
    one, other = base + fie.low * slope, base + fie.high * slope
    return min(0.0, one, other) - spread, max(0.0, one, other) + spread


@kernel
def advance_reach(bank, fie, dt):
    """Advance the reach of the fault in each filter since the flight began; channel 3: `parity_direction`."""
    for channel in range(4):
        low, high = effect_extremes(fie, channel) if channel < 3 else parity_effect_extremes(fie)
        for m, a in enumerate(bank.config.decay[: bank.config.n]):
            fie.reach_low[m, channel] = a * fie.reach_low[m, channel] + dt * low
            fie.reach_high[m, channel] = a * fie.reach_high[m, channel] + dt * high


@kernel
def reach_explains(bank, fie, shared):
    """True if the residuals are within the reach of the fault, for any course of it since the flight began.

    shared: the axes share one parameter; the residual along `parity_direction` is then tested as well.
    """
    for m in range(bank.config.n):
        residual, bound = 0.0, 0.0
        for i in range(3):
            r, b = bank.output.residual[m, i], bank.output.threshold[m, i]
            if not fie.reach_low[m, i] - b <= r <= fie.reach_high[m, i] + b and not fie.ignored_axes[i]:
                return False
            residual += fie.parity_direction[i] * r
            bound += abs(fie.parity_direction[i]) * b
        if shared and not fie.reach_low[m, 3] - bound <= residual <= fie.reach_high[m, 3] + bound:
            return False
    return True


# Centres of the network's basis functions, rad; and its record. gain 1/s2, weight_limit rad/s2; output: fhat,
# rad/s2.
ALPHA_CENTRES = np.linspace(-0.1, 0.5, 9)
BETA_CENTRES = np.linspace(-0.3, 0.3, 5)
N_BASIS = len(ALPHA_CENTRES) + len(BETA_CENTRES)
NETWORK = record(
    config=record(gain=float, leak_per_s=float, weight_limit=float),
    memory=record(weights=(3, N_BASIS), basis=N_BASIS),
    output=3,
)

# pole 1/s; decay: a. xhat: the estimate of the rates, rad/s; threshold_eta, threshold_noise rad/s: parts of
# the threshold. residual, threshold rad/s.
FDAE_CONFIG = record(pole=3, decay=3)
FDAE_MEMORY = record(xhat=3, threshold_eta=3, threshold_noise=3)
FDAE_OUTPUT = record(residual=3, threshold=3)
FDAE = record(config=FDAE_CONFIG, memory=FDAE_MEMORY, output=FDAE_OUTPUT, network=NETWORK)

_PER_STEP = np.exp(-1.0)
_N_ALPHA, _N_BETA = len(ALPHA_CENTRES), len(BETA_CENTRES)
_ALPHA_FIRST, _ALPHA_STEP = ALPHA_CENTRES[0], ALPHA_CENTRES[1] - ALPHA_CENTRES[0]
_BETA_FIRST, _BETA_STEP = BETA_CENTRES[0], BETA_CENTRES[1] - BETA_CENTRES[0]


def configure_fdae(fdae: np.void, scenario: Scenario) -> None:
    """Fill in the estimator's pole, and how its network learns."""
    config, network = scenario.control, fdae["network"]
    fdae["config"]["pole"] = scenario.fdi.detection_pole_per_s
    fdae["config"]["decay"] = exp(-scenario.fdi.detection_pole_per_s * (1.0 / scenario.rate_hz))
    network["config"]["gain"], network["config"]["leak_per_s"] = (
        config.network_gain_per_s2,
        config.network_leak_per_s,
    )
    network["config"]["weight_limit"] = config.network_weight_limit_rad_s2


@kernel
def fill_gaussians(place, count, first, out):
    """Fill out[first : first + count] with exp(-(place - j)^2 / 2), j = 0, 1, ...; return the squares' sum.

    From one to the next they change by exp(place - j - 1/2), and that by 1/e: two exponentials do for all.
    """
    value, change = np.exp(-0.5 * place * place), np.exp(place - 0.5)
    square = 0.0
    for j in range(count):
        out[first + j] = value
        square += value * value
        value *= change
        change *= _PER_STEP
    return square


@kernel
def fill_basis(alpha, beta, out):
    """Fill out (N_BASIS,) with the normalised radial basis functions at (alpha, beta), rad.

    Each width equals the spacing of its centres; outside the grid the nearest edge answers.
    """
    a = min(max((alpha - _ALPHA_FIRST) / _ALPHA_STEP, 0.0), _N_ALPHA - 1.0)
    b = min(max((beta - _BETA_FIRST) / _BETA_STEP, 0.0), _N_BETA - 1.0)
    norm = np.sqrt(fill_gaussians(a, _N_ALPHA, 0, out) + fill_gaussians(b, _N_BETA, _N_ALPHA, out))
    for j in range(N_BASIS):
        out[j] /= norm


@kernel
def dead_zone(residual, threshold):
    """D[eps]: zero inside the threshold, the excess over it outside."""
    if residual > threshold:
        return residual - threshold
    if residual < -threshold:
        return residual + threshold
    return 0.0


@kernel
def evaluate_network(network, alpha, beta):
    """Fill network.output (3,) rad/s2 for the present alpha and beta."""
    fill_basis(alpha, beta, network.memory.basis)
    for i in range(3):
        total = 0.0
        for j in range(N_BASIS):
            total += network.memory.weights[i, j] * network.memory.basis[j]
        network.output[i] = total


@kernel
def train_network(network, residual, threshold, leaking, dt):
    """Advance the weights by one frame; residual and threshold (3,) rad/s, dt s.

    `leaking` lets go of what was learnt once another estimate explains the fault.
    """
    keep = np.exp(-network.config.leak_per_s * dt) if leaking else 1.0
    limit = network.config.weight_limit
    for i in range(3):
        drive = dt * network.config.gain * dead_zone(residual[i], threshold[i])
        for j in range(N_BASIS):
            weight = keep * network.memory.weights[i, j] + drive * network.memory.basis[j]
            network.memory.weights[i, j] = min(max(weight, -limit), limit)


@kernel
def begin_fdae(fdae, noise, x):
    """Start at the first measurement x (3,) rad/s: no residual, and all of the gyro's error still to come.

    noise (3,) rad/s: by how much the gyros' errors may change.
    """
    fdae.memory.xhat[:], fdae.memory.threshold_noise[:] = x, noise


@kernel
def set_fdae_threshold(fdae, constant):
    """Replace the threshold by a constant, rad/s."""
    fdae.output.threshold[:] = constant


@kernel
def replace_network_output(network, fhat):
    """Replace the output of the network by that of another, fhat (3,) rad/s2."""
    network.output[:] = fhat


@kernel
def reset_network(network):
    """Discard what the network has learnt."""
    network.memory.weights[:], network.output[:] = 0.0, 0.0


@kernel
def form_fdae_residual(fdae, x):
    """Fill the residual for the measured x (3,) rad/s."""
    for i in range(3):
        fdae.output.residual[i] = x[i] - fdae.memory.xhat[i]


@kernel
def alarm_axis(bank, authority, statistical_alarm):
    """The axis on which a detector in authority raises the alarm, or -1.

    statistical_alarm: `ALARM` of the statistical detector.
    """
    axis = bank_alarm_axis(bank) if authority != STATISTICAL_DETECTOR else -1
    if axis < 0 and authority != WORST_CASE_DETECTOR and statistical_alarm.score > 1.0:
        axis = statistical_alarm.axis
    return axis


@kernel
def predict_fdae(fdae, bound, x, predicted_acceleration, detected, leaking, dt):
    """Advance the FDAE and its threshold by one frame; once `detected`, the network learns what exceeds the
    threshold.

    x (3,) rad/s; predicted_acceleration (3,) rad/s2 is f + G u, with the isolated fault once there is one.
    """
    if detected:
        train_network(fdae.network, fdae.output.residual, fdae.output.threshold, leaking, dt)
    for i in range(3):
        rate, decay = predicted_acceleration[i] + fdae.network.output[i], fdae.config.decay[i]
        fdae.memory.xhat[i] = x[i] + dt * rate + decay * (fdae.memory.xhat[i] - x[i])
        fdae.memory.threshold_eta[i] = bound_step(fdae.memory.threshold_eta[i], bound.eta_bar[i], decay, dt)
        fdae.memory.threshold_noise[i] = noise_step(
            fdae.memory.threshold_noise[i], bound.noise_before[i], decay
        )
        fdae.output.threshold[i] = (
            fdae.memory.threshold_eta[i] + fdae.memory.threshold_noise[i] + bound.noise[i]
        )


@kernel
def fdae_unknown_acceleration(fdae, noise, out):
    """Fill out (3,) rad/s2 with the acceleration that the FDAE estimates in addition to the model.

    The residual settles at (phi - fhat) / Lambda0, so Lambda0 eps0 is the part of the fault not yet in the
    weights, at the bandwidth of the estimator. What the gyro's noise (3,) rad/s alone explains stays out of
    it, and off the surfaces.
    """
    for i in range(3):
        explained = fdae.memory.threshold_noise[i] + noise[i]
        out[i] = fdae.network.output[i] + fdae.config.pole[i] * dead_zone(fdae.output.residual[i], explained)
