"""The drift of the filters as it follows from what a scenario declares: intensity, length, and model noise.

Letters: omega, rad/s, is the frequency of a bounded uncertainty; z the alarm level, standard deviations;
sigma, rad/s, the noise of a gyro; q, 1/s, the intensity of the drift over the bound squared (NOISE_RECORD of
rates.py).
"""

from math import hypot, sqrt

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import fill
from beaver_ftc.design.plain_model import jacobian
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA, QDYN
from beaver_ftc.design.turbulence import rotation_lengths
from beaver_ftc.diagnosis.bounds import Y0
from beaver_ftc.diagnosis.detection.blocks import MIN_ETA_RAD_S2, N_SLOTS, PITCH_BLOCK
from beaver_ftc.diagnosis.detection.forces_design import TrimState
from beaver_ftc.diagnosis.detection.statistical import MAX_ETA_RATE
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import Statistical

# Frequency of the bounded uncertainty, if damage may take surfaces (`configure_noise`). Chosen on flights of
# a GTM: with it 42 of 75 faults are found that were missed before, with 15 rad/s 23, with 8 rad/s 36, with
# 0.2 rad/s and less at most 35.
DAMAGE_FREQUENCY_RAD_S = 3.0


def eta_rate(settings: Statistical, aircraft: Aircraft, dt_s: float) -> float:
    """Largest change of a bounded uncertainty within a frame of dt_s, over its bound: MAX_ETA_RATE if the
    model has an error, else its frequency times dt_s.

    The error of an aircraft's own terms changes with its surfaces, which a law may move fully within a frame:
    from one end of the bound to the other. If the error is mapped, its rate of change is worked out in flight
    (`statistical.update_eta_rate`).
    """
    return MAX_ETA_RATE if any(aircraft.model_error_rad_s2) else settings.uncertainty_rad_s * dt_s


def configure_noise(
    stat: np.void, omega: float, declared: Declared, model: np.void, trim: TrimState, dt_s: float
) -> None:
    """Fill the noise model in trim, for an uncertainty of frequency omega, rad/s:

        G_trim    |G|, rad/s2 per rad
        Q0        sum_x (F_x sigma_x)^2, (rad/s2)2, by the noise of the gyros
        Q         Q0 + sum_y (F_y sigma_y)^2; `rates.add_constants` updates it in flight, and adds the noise
                  of the engine's power
        rate0     omega dt
        q         `derive_intensity` at omega, 1/s; if damage may take surfaces, at DAMAGE_FREQUENCY_RAD_S at
                  most

    F_x, F_y: slopes of f + G u with rates x and air data y; sigma: noise of the readings, gyros first.

    q only sets how much of the uncertainty the filters remove: `likelihood.uncertain_share` bounds in any
    case the evidence that it explains. If damage may take surfaces, a weaker drift detects most, because
    motion that no loss explains is then rarely an error of the model.
    """
    _, G, F_x, F_y = jacobian(model, *trim)
    sigma = declared.sensors.each("random")
    Q0 = F_x**2 @ sigma[:Y0] ** 2
    Q_y = F_y[:, [ALPHA, BETA, AIRSPEED, QDYN]] ** 2 @ sigma[Y0:] ** 2
    omega_q = min(DAMAGE_FREQUENCY_RAD_S, omega) if declared.aircraft.loses_surfaces else omega
    b = max(declared.constant_rad_s2)
    z = float(stat["test"]["alarm_level"])
    q = derive_intensity(b, omega_q, float(sigma[:Y0].max()), z, dt_s)
    fill(stat["noise"], rate0=omega * dt_s, q=q, Q0=Q0, Q=Q0 + Q_y)
    stat["noise"]["G_trim"][:, : G.shape[1]] = np.abs(G)


def derive_intensity(b: float, omega: float, sigma: float, z: float, dt_s: float) -> float:
    """Intensity of the random walk that stands for a bounded uncertainty, over its bound squared, 1/s.

        max(hypot((v (sigma^2 dt)^(1/4))^(4/5), 4 (1.204 b / z)^2 omega), v dt) / b^2
        v = 8 sqrt(2) (b omega / z)^2                                                  (statistical.md)

    An uncertainty of b sin(omega t) moves the test for a step by b omega sqrt(2 sqrt 2 / i w0), w0 = (i /
    n)^(1/4), for a walk of intensity i and gyro noise of density n = sigma^2 dt; v is the i w0 at which that
    is z / 2. Almost without noise w0 is the frame rate. The evidence for a loss under a moving command grows
    together with the uncertainty while both have the same sign: by b sqrt(omega / i) times 1.204, the largest
    value of sin(x) / sqrt(x / 2), x half of omega t. Half the alarm level is left for it: noise alone then
    takes up no more than the other half.

    b rad/s2: bound, at least MIN_ETA_RAD_S2; omega, sigma rad/s; z: alarm level, standard deviations.
    """
    b = max(b, MIN_ETA_RAD_S2)
    v = 8.0 * sqrt(2.0) * (b * omega / z) ** 2
    i_loss = 4.0 * (1.204 * b / z) ** 2 * omega
    i_step = (v * (sigma**2 * dt_s) ** 0.25) ** 0.8
    return max(hypot(i_step, i_loss), v * dt_s) / b**2


def configure_lengths(stat: np.void, V: float, rate_hz: float) -> None:
    """Fill the correlation length of the drift, m, of the block whose drift reverts to zero and, if a gust is
    declared but not measured, of the pitch block; fill the factor on the intensity of their gust:

        Q_scale = (gust_m / length)^2        the same power at low frequency

    gust_m m: correlation length of the gust on these axes, 0 in still air. The length is at most longest_m:
    gust_m, but for roll and yaw the smallest of the three lengths if the gust is visible only coarsely. 0 is
    no limit.
    """
    cfg = stat["gust"]["config"]
    out = stat["gust"]["output"]
    roll_m = float(cfg["L_roll"]) if out["gusty"] else 0.0
    rotations_m = rotation_lengths(cfg["span"])
    lengths = [(stat["block"][-1], min(rotations_m) if cfg["coarse_only"] else roll_m, roll_m)]
    if out["gusty"] and not out["measured"]:
        lengths.append((stat["block"][PITCH_BLOCK], rotations_m[1], rotations_m[1]))
    for b, longest_m, gust_m in lengths:
        b["drift_length_m"] = derive_length(stat, V, rate_hz, float(longest_m))
        if out["gusty"]:
            b["Q_scale"] = (gust_m / b["drift_length_m"]) ** 2


def derive_length(stat: np.void, V: float, rate_hz: float, longest_m: float) -> float:
    """Return the length, m, of the drift in the second block of roll and yaw, or of pitch without gust
    estimate:

        min(V tau, longest_m),      tau = sqrt(2 T / q) / z

    V m/s: airspeed in trim; longest_m m: limit of the length, 0 for none; z: alarm level; q 1/s: intensity of
    the drift over the bound eta squared (NOISE_RECORD). The drift returns as soon as a bounded uncertainty
    permits: over the longest window, of T s, an uncertainty that oscillates with the fault moves a test, for
    a drift of lag tau s, by sqrt(T / 2 q) / tau; half the alarm level is left for this. The drift returns no
    later than the gust. A gust with a longer correlation length is represented by a stronger one, of equal
    power at low frequency and more power at high frequency.
    """
    T = 2 ** (N_SLOTS - 1) / rate_hz
    z = float(stat["test"]["alarm_level"])
    tau = sqrt(2.0 * T / stat["noise"]["q"]) / z
    return min(V * tau, longest_m or np.inf)
