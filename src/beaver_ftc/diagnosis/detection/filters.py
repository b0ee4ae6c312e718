"""The worst-case detector: a bank of filters of the innovation with adaptive thresholds.

    nu[k] = (x[k] - x[k-1]) / dt - F[k] = eta[k] + phi[k]
    E_m[k] = a_m E_m[k-1] + dt nu[k],   a_m = exp(-lam_m dt)        alarm: |E_m| > T_m on some axis

Frame k lasts from sample k-1 to sample k, as in detection.md; F[k], eta[k] and phi[k] are means over it.
lam_m, 1/s, is the pole of filter m, and a_m its decay per frame.

All filters are exact for the discrete truth x[k] = x[k-1] + dt (F[k] + phi[k] + eta[k]): without a fault
phi, a residual obeys E[k] = a E[k-1] + dt eta[k], and its bound the same with eta_bar in place of eta.
The guarantees of the theory therefore hold at any frame rate, without an allowance for discretisation.

Every filter has the exact bound of its own pole, so the alarm is the first of theirs without further false
alarms. A pole far above the frame rate (`DEADBEAT_PER_S`) tests the innovation itself, |nu| > nu_max; for a
bound that holds instant by instant no filter, window or sum of innovations can alarm earlier (detection.md,
"The guarantees"). Slower poles detect more if errors are correlated over frames, as measurement errors are.

Filter 0, the published one, is the residual of the FDAE (fdae.py) until the alarm.

Symbols of the kernels:

    nu (3,) rad/s2            innovation of the elapsed frame
    F (3,) rad/s2             f + G u of the healthy aircraft, mean over the frame
    x, x_old (3,) rad/s       measured now and a frame ago
    E, T rad/s                residual of a filter and its threshold
    e rad/s                   the part of T that has a memory, T_eta + T_n
    n rad/s                   bound on the changing part of a gyro's error (`bounds.n_gyro`)
    a, m, i                   decay per frame; number of a filter; axis
    bank, bound               records: BANK_RECORD, `bound_dtype`
"""

from math import exp, log

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.config import STATISTICAL_DETECTOR, WORST_CASE_DETECTOR
from beaver_ftc.scenario.declared import Declared, SensorErrors
from beaver_ftc.scenario.diagnosis import MAX_POLES, FdiConfig
from beaver_ftc.scenario.sensors import NOISE_LIMIT_SIGMA

# A residual below this share of its threshold may be rounding, in which processors differ.
ROUNDING_SHARE = 1e-6
POLE_DELAYS_S = (0.1, 0.5, 2.0)  # detection delays for which `poles_for_delays` chooses a pole each


@kernel
def leak(x, a, v):
    """x <- a x + v: filters x (m,) of decays a (m,) per frame, all of input v. The monitors use it too."""
    for m in range(a.size):
        x[m] = a[m] * x[m] + v


@kernel
def advance_bound(e, eta, a, dt, n=0.0):
    """a e + dt eta + (1 - a) n: bound on a residual, rad/s, a frame later [Zhang2005, sec. IV].

    a: decay per frame; eta rad/s2: bound on the uncertainty; n rad/s: bound on the changing part of the
    gyro's error when the frame began.
    """
    return a * e + dt * eta + (1.0 - a) * n


# The bank of detection filters; filter 0 is the published one. a: decays per frame; e rad/s: the part of the
# threshold T that has a memory; innovation nu rad/s2; residual E, threshold T rad/s.
BANK_RECORD = record(
    config=record(n_filters=int, a=MAX_POLES), memory=record(e=(MAX_POLES, 3)),
    output=record(innovation=3, residual=(MAX_POLES, 3), threshold=(MAX_POLES, 3)),
)  # fmt: skip


def poles_for_delays(errors: SensorErrors, b: float) -> tuple[float, ...]:
    """Poles, 1/s: for each of POLE_DELAYS_S the pole that detects the smallest constant fault within this
    delay, despite gyro noise. Without noise there are none. b rad/s2: largest constant bound on the error of
    the model.
    """
    n_bar = 2 * NOISE_LIMIT_SIGMA * float(errors.each("noise", AXES).max())
    return tuple(_pole_for_delay(tau, n_bar, b) for tau in POLE_DELAYS_S) if n_bar > 0 else ()


def _pole_for_delay(tau: float, n_bar: float, b: float) -> float:
    """The pole lam, 1/s, with which the smallest constant fault phi reaches its threshold within tau s:

        lam = max(ln(phi tau / n_bar), 0.1) / tau      phi = (n_bar lam + b) / (1 - exp(-lam tau))

    by iteration from phi = b + 8 n_bar / tau. After tau the residual is phi (1 - exp(-lam tau)) / lam, its
    bound at most b / lam + n_bar. lam times the excess of one over the other is greatest at that lam; both
    are equal at that phi. n_bar rad/s: twice the limit of a gyro's noise; b, phi rad/s2.
    """
    phi = b + 8.0 * n_bar / tau
    for _ in range(50):
        lam = max(log(phi * tau / n_bar) / tau, 0.1 / tau)
        phi = (n_bar * lam + b) / (1.0 - exp(-lam * tau))
    return lam


def filter_poles(config: FdiConfig, declared: Declared) -> tuple[float, ...]:
    """The filters' poles, 1/s: the published one and, with `sharpen.pole_bank`, those of the scenario, then
    those that noise requires, as far as the MAX_POLES allow.
    """
    for_noise = poles_for_delays(declared.sensors, max(declared.constant_rad_s2))
    others = (*config.pole_bank_per_s, *for_noise) if config.sharpen.pole_bank else ()
    return (config.detection_pole_per_s, *others)[:MAX_POLES]


def configure_bank(bank: np.void, config: FdiConfig, declared: Declared, dt: float) -> None:
    """Fill the number of filters and their decays a = exp(-lam dt); dt s."""
    poles = filter_poles(config, declared)
    bank["config"]["n_filters"] = len(poles)
    bank["config"]["a"][: len(poles)] = [exp(-lam * dt) for lam in poles]


@kernel
def update_bank(bank, bound, x, x_old, F, dt):
    """Form the innovation of the elapsed frame, and advance residual and threshold of each filter:

        nu = (x - x_old) / dt - F      nu_max = eta_bar + (n + n_old) / dt
        E <- a E + dt nu               e <- a e + dt eta_bar + (1 - a) n_old      T = e + n

    e = T_eta + T_n; nu_max rad/s2: bound on nu without a fault, which is filled in `bound`.
    """
    nu = bank.output.innovation
    E = bank.output.residual
    T = bank.output.threshold
    e = bank.memory.e
    for i in range(3):
        nu[i] = (x[i] - x_old[i]) / dt - F[i]
        bound.nu_max[i] = bound.eta_bar[i] + (bound.n_gyro[i] + bound.n_old[i]) / dt
        for m, a in enumerate(bank.config.a[: bank.config.n_filters]):
            E[m, i] = a * E[m, i] + dt * nu[i]
            e[m, i] = advance_bound(e[m, i], bound.eta_bar[i], a, dt, bound.n_old[i])
            T[m, i] = e[m, i] + bound.n_gyro[i]


@kernel
def leaves_bound(bank, i):
    """Whether a filter of the bank leaves its bound on axis i: |E| > T."""
    for m in range(bank.config.n_filters):
        if abs(bank.output.residual[m, i]) > bank.output.threshold[m, i]:
            return True
    return False


@kernel
def bank_axis(bank):
    """The first axis on which a filter of the bank leaves its bound, or -1."""
    for i in range(3):
        if leaves_bound(bank, i):
            return i
    return -1


@kernel
def alarm_axis(bank, authority, alarm):
    """The axis of the alarm, or -1: that of the bank, else that of the statistical detector, as far as
    `authority` lets each raise an alarm; alarm: ALARM_RECORD of the statistical detector, whose `ratio` is
    its largest score over the alarm level."""
    axis = bank_axis(bank) if authority != STATISTICAL_DETECTOR else -1
    if axis < 0 and authority != WORST_CASE_DETECTOR and alarm.ratio > 1.0:
        axis = alarm.axis
    return axis


@kernel
def filter_share(bank, m, i):
    """|E| / T of filter m on axis i; 0 while T is 0, before the first frame."""
    T = bank.output.threshold[m, i]
    return abs(bank.output.residual[m, i]) / T if T > 0.0 else 0.0


@kernel
def nearest_filter(bank, i):
    """The filter whose |E| / T is largest on axis i; if there is an alarm on this axis, it is of this one.
    While no share is above ROUNDING_SHARE, it is filter 0."""
    nearest = 0
    largest = ROUNDING_SHARE
    for m in range(bank.config.n_filters):
        share = filter_share(bank, m, i)
        if share > largest:
            nearest = m
            largest = share
    return nearest


@kernel
def bank_share(bank):
    """The largest |E| / T in the bank, over filters and axes; of filter 0 if none is above ROUNDING_SHARE."""
    largest = 0.0
    for i in range(3):
        largest = max(largest, filter_share(bank, nearest_filter(bank, i), i))
    return largest
