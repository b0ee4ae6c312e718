"""The fault detection and approximation estimator (FDAE), always on.

    xhat0' = -Lambda0 (xhat0 - x) + f + G u + fhat,  eps0 = x - xhat0,  alarm when |eps0_i| > ebar_i, some i

[Zhang2005, sec. IV]. Until the alarm eps0 is filter 0 of the bank (bank.py), which raises it. Written for
the discrete truth: xhat0[k+1] = x[k] + dt F[k] + exp(-Lambda0 dt) (xhat0[k] - x[k]).
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis import bank
from beaver_ftc.diagnosis.network import dead_zone, learn
from beaver_ftc.diagnosis.state import STATISTICS, WORST_CASE
from beaver_ftc.diagnosis.thresholds import bound_step, noise_step


@kernel
def begin(fdi, x):
    """Start at the first measurement x (3,) rad/s: no residual, and all of the gyro's error still to come."""
    for i in range(3):
        fdi.fdae.xhat[i] = x[i]
        fdi.fdae.threshold_noise[i] = fdi.bound.noise[i]
        for m in range(fdi.bank.n):
            fdi.bank.noise[m, i] = fdi.bound.noise[i]


@kernel
def detect(fdi, x, t):
    """Form the residual and raise the alarm if a detector in authority does; x (3,) rad/s measured, t s."""
    for i in range(3):
        fdi.fdae.residual[i] = x[i] - fdi.fdae.xhat[i]
    axis = bank.alarm(fdi) if fdi.config.authority != STATISTICS else -1
    if axis < 0 and fdi.config.authority != WORST_CASE and fdi.statistical.alarm.score > 1.0:
        axis = fdi.statistical.alarm.axis
    if axis >= 0 and not fdi.verdict.detected:
        fdi.verdict.detected = 1
        fdi.verdict.detected_at_s = t
        fdi.verdict.detected_axis = axis


@kernel
def predict(fdi, x, believed, leaking):
    """Advance the FDAE and its threshold by one frame, and let the network learn what exceeds the threshold.

    x (3,) rad/s; `believed` (3,) rad/s2 is f + G u, with the isolated fault once there is one.
    """
    if fdi.verdict.detected:
        learn(fdi.fdae.network, fdi.fdae.residual, fdi.fdae.threshold, leaking, fdi.config.dt)
    for i in range(3):
        rate = believed[i] + fdi.fdae.network.output[i]
        fdi.fdae.xhat[i] = x[i] + fdi.config.dt * rate + fdi.fdae.decay[i] * (fdi.fdae.xhat[i] - x[i])
        fdi.fdae.threshold_eta[i] = bound_step(
            fdi.fdae.threshold_eta[i], fdi.bound.eta_bar[i], fdi.fdae.decay[i], fdi.config.dt
        )
        fdi.fdae.threshold_noise[i] = noise_step(
            fdi.fdae.threshold_noise[i], fdi.bound.noise_then[i], fdi.fdae.decay[i]
        )
        fdi.fdae.threshold[i] = fdi.fdae.threshold_eta[i] + fdi.fdae.threshold_noise[i] + fdi.bound.noise[i]


@kernel
def unknown_acceleration(fdi, out):
    """Fill out (3,) rad/s2 with what the FDAE believes beyond the model: learnt, and about to be learnt.

    The residual settles at (phi - fhat) / Lambda0, so Lambda0 eps0 is the part of the fault not yet in the
    weights, at the bandwidth of the estimator. What the gyro's noise alone explains stays out of it, and off
    the surfaces.
    """
    for i in range(3):
        noise = fdi.fdae.threshold_noise[i] + fdi.bound.noise[i]
        out[i] = fdi.fdae.network.output[i] + fdi.fdae.pole[i] * dead_zone(fdi.fdae.residual[i], noise)
