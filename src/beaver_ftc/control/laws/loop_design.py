"""The gains of the default law (rejecting.py), loop by loop, from the declaration.

One number s, 1/s, gives feedback Kp = s and observer w_o = RATIO s of a loop. It is the largest s that

- leaves the declared margins, with the declared actuator, one JSBSim frame of delay, the frame rate, and the
  declared lag and delay of the gyro;
- where gyros are noisy, moves the surface by noise no faster than a share of its rate limit (`noise_share`).

RATIO and noise_share were chosen by flights in turbulence, compared with the rivals. The inversion makes the
plant of a loop an integrator. The margins are those of this design loop, with a reserve for the rest of the
aircraft. The response of a loop follows, frequency by frequency, from the equations of the law,
z-transformed.

    z            (n,), exp(i omega dt) at the frequencies omega, rad/s
    loop         the data of a loop, `Loop`
    L            (n,), response of the open loop
"""

from dataclasses import dataclass
from functools import lru_cache
from math import inf, pi, sqrt

import numpy as np

RATIO = 6.5  # w_o / Kp: among ratios with the same margins, its error in turbulence is near the least
MOST_LEAD = 4.0  # lead compensation makes an actuator at most this many times as fast
RESERVE_DB, RESERVE_DEG = 0.5, 2.0  # added to the margins, because the aircraft is not quite an integrator
N_FREQUENCIES, N_CANDIDATES = 160, 40
LEAST_PER_S = 0.5  # s of the slowest loop, which is taken even if it leaves less than the margins


@dataclass(frozen=True)
class Loop:
    """The data that limit one loop.

    dt_s            length of a frame
    share           part of a frame until a command acts
    approach        part of the way to its command that the actuator goes in a frame
    lead            factor on the wanted motion: command - position = lead (wanted - position)
    delay_s, keep   delay of the gyro, and pole of its lag over a frame
    """

    dt_s: float
    share: float
    approach: float
    lead: float
    delay_s: float = 0.0
    keep: float = 0.0


def lead_of(approach: float) -> float:
    """lead = 1 / approach, from 1 to MOST_LEAD: with it, an actuator that goes the share `approach` of its
    way in a frame, at least 1 / MOST_LEAD, reaches the wanted position after one frame. It never
    overshoots."""
    return 1.0 / min(max(approach, 1.0 / MOST_LEAD), 1.0)


def frequencies(dt_s: float) -> np.ndarray:
    """Frequencies (N_FREQUENCIES,) rad/s, from far below any loop to Nyquist."""
    return np.geomspace(0.002 / dt_s, pi / dt_s, N_FREQUENCIES)


def corrections(s: float, dt_s: float) -> tuple[float, float]:
    """L_rate and L_disturbance (1/s) of an observer with both poles at exp(-w_o dt), w_o = RATIO s:

    L_rate = 1 - exp(-2 w_o dt),    L_disturbance = (1 - exp(-w_o dt))^2 / dt
    """
    pole = np.exp(-RATIO * s * dt_s)
    return 1.0 - pole * pole, (1.0 - pole) ** 2 / dt_s


def actuator_response(loop: Loop, z: np.ndarray) -> np.ndarray:
    """Position over command, approach / (z - 1 + approach), (n,): the actuator goes this share of its way in
    a frame."""
    return loop.approach / (z - 1.0 + loop.approach)


def controller(loop: Loop, s: float, z: np.ndarray) -> np.ndarray:
    """Actuator command over measured rate, times -G: the law's own response (n,), 1/s, at z (n,).

    The law's equations (rejecting.py), z-transformed, of one axis with f = 0 and xm = 0; positions p and
    commands c times G, observed disturbance d, innovation e, L_r and L_d for L_rate and L_disturbance;
    mean p: that of p over the frame:

        xhat = xhat/z + dt (d/z + mean p) + L_r e,    d = d/z + L_d e,    e = x - xhat/z - dt (d/z + mean p)
        p = `actuator_response` c,    c = p + lead (-s x+ - d - p)
        x+ = xhat + share dt (p + d),    mean = share/z + 1 - share

    A row is an equation; its columns are xhat, d, p and c, and `driven` is what x multiplies.
    """
    dt = loop.dt_s
    share = loop.share
    L_rate, L_disturbance = corrections(s, dt)
    kept = 1 - L_rate
    z_inv = 1.0 / z
    mean = share * z_inv + 1.0 - share
    ones = np.ones_like(z)
    zeros = np.zeros_like(z)
    rows = [
        [ones - kept * z_inv, -kept * dt * z_inv, -kept * dt * mean, zeros],
        [L_disturbance * z_inv, ones - z_inv + L_disturbance * dt * z_inv, L_disturbance * dt * mean, zeros],
        [zeros, zeros, ones, -actuator_response(loop, z)],
        [loop.lead * s * ones, loop.lead * (1 + s * share * dt) * ones,
         (loop.lead - 1 + loop.lead * s * share * dt) * ones, ones],
    ]  # fmt: skip
    driven = np.stack([L_rate * ones, L_disturbance * ones, zeros, zeros], 1)
    return -np.linalg.solve(np.moveaxis(np.array(rows), 2, 0), driven[..., None])[..., 3, 0]


def open_loop(loop: Loop, s: float, z: np.ndarray) -> np.ndarray:
    """The loop broken at the surface, (n,): controller, actuator, plant and gyro in series.

    plant: dt (share + (1 - share) z) / (z - 1), an integrator of the surface's moment
    gyro: z^(-delay / dt) (1 - keep) / (1 - keep / z)
    """
    plant = loop.dt_s * (loop.share + (1.0 - loop.share) * z) / (z - 1.0)
    gyro = z ** (-loop.delay_s / loop.dt_s) * (1.0 - loop.keep) / (1.0 - loop.keep / z)
    return controller(loop, s, z) * actuator_response(loop, z) * plant * gyro


def margins(L: np.ndarray) -> tuple[float, float, float]:
    """Upper and lower gain margin, dB, and phase margin, deg, of an open loop L (n,) along the frequencies:

        gain margins     distance of the level from 0 dB where L is real and negative
        phase margin     distance of the phase from -180 deg where the level is 0 dB

    Between two samples, log magnitude and phase of L are taken as linear. At the last sample, which may be
    Nyquist, L is real: a crossing if it is negative. `control.stability_margins` of the sampled loop agrees
    to 0.1 %, but takes 300 times as long, and a flight has many candidates. If L is 0 (a surface that does
    not move), all margins are infinite.
    """
    if not L.any():
        return inf, inf, inf
    level = 20.0 * np.log10(np.abs(L))
    phase = np.degrees(np.unwrap(np.angle(L)))
    turns = (-1260.0, -900.0, -540.0, -180.0, 180.0)  # deg, where L is real and negative
    levels = [x for turn in turns for x in _at_zeros(phase - turn, level)]
    if L[-1].real < -abs(L[-1].imag) * 1e6:
        levels.append(level[-1])
    upper = min((-x for x in levels if x < 0.0), default=inf)
    lower = min((x for x in levels if x >= 0.0), default=inf)
    distances = (abs((x + 180.0) % 360.0) for x in _at_zeros(level, phase))
    return upper, lower, min((min(x, 360.0 - x) for x in distances), default=inf)


def _at_zeros(x: np.ndarray, y: np.ndarray) -> list[float]:
    """The values of y (n,) at which x (n,) passes zero, both linear between two samples."""
    i = np.flatnonzero(np.signbit(x[:-1]) != np.signbit(x[1:]))
    part = x[i] / (x[i] - x[i + 1])
    return list(y[i] + part * (y[i + 1] - y[i]))


def noise_speed(loop: Loop, s: float, z: np.ndarray, omega: np.ndarray) -> float:
    """Standard deviation of G times the surface's speed, over that of a gyro's sample, 1/s2:

        sqrt(dt / pi integral |H|^2 d omega),    H = (z - 1) / dt actuator controller / (1 + open loop)

    omega (n,) rad/s: up to Nyquist; z = exp(i omega dt).
    """
    speed = (z - 1.0) / loop.dt_s * actuator_response(loop, z)
    response = np.abs(speed * controller(loop, s, z) / (1.0 + open_loop(loop, s, z)))
    return sqrt(float(np.trapezoid(response**2, omega)) * loop.dt_s / pi)


@lru_cache(maxsize=64)
def candidates(loop: Loop, gain_db: float, phase_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """LEAST_PER_S and the values of s above it, up to the first one that does not leave the margins, 1/s,
    ascending, and the noise speed of each, 1/s2.

    The largest is s_max = 1 / (2 delay); delay: that of a frame's hold, of the command and of the gyro, s.
    """
    omega = frequencies(loop.dt_s)
    z = np.exp(1j * omega * loop.dt_s)
    s_max = 0.5 / (loop.dt_s * (0.5 + loop.share) + loop.delay_s)
    values: list[float] = []
    speeds: list[float] = []
    for s in np.geomspace(LEAST_PER_S, max(s_max, 2.0 * LEAST_PER_S), N_CANDIDATES):
        upper, lower, phase = margins(open_loop(loop, float(s), z))
        if values and not (min(upper, lower) >= gain_db + RESERVE_DB and phase >= phase_deg + RESERVE_DEG):
            break
        values.append(float(s))
        speeds.append(noise_speed(loop, float(s), z, omega))
    return np.array(values), np.array(speeds)


def fastest(
    loop: Loop, margin: tuple[float, float], noise_rad_s: float, G: float, speed_rad_s: float
) -> float:
    """The largest s, 1/s, with these margins (dB, deg), and with a standard deviation of the surface's speed
    from noise of at most speed_rad_s; at least LEAST_PER_S. Between candidates, log s is linear over the log
    of the noise speed. G rad/s2 per rad; noise_rad_s: standard deviation of a sample of the gyro."""
    values, speeds = candidates(loop, *margin)
    if noise_rad_s <= 0.0:
        return float(values[-1])
    allowed = max(abs(G) * speed_rad_s / noise_rad_s, float(speeds[0]))
    return float(np.exp(np.interp(np.log(allowed), np.log(speeds), np.log(values))))
