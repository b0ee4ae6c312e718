"""The turn that a gyro shows and the attitude does not: it is broken, if no fault of a surface explains it.

    T <- a T + dA      E <- a E + dt e_T      (|T| - E) / std(T)      about each axis, for each leak a

dA, rad, is the turn of the attitude in a frame beyond that of the gyro. e_T, rad/s, bounds what the constant
errors of gyros and attitude turn, and E, rad, what they add to T. A gyro is broken if the rates raise an
alarm (loop/frame.py asks for it), the quotient exceeds `level` about its axis, no sum of attitude.py shows a
fault of a surface, and the turns about the other axes are small.

att is the record of attitude.py, which has the TURN_FIELDS.
"""

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.compiled import fill, kernel
from beaver_ftc.diagnosis.detection.filters import leak
from beaver_ftc.scenario.declared import SensorErrors

ANGLES = ("phi", "theta", "psi")
LEAK_TIMES_S = (0.1, 0.3, 1.0, 3.0)  # time constants of the leaky sums
COUPLED_SHARE = 0.05  # largest share of an error of one gyro in the turns about the other axes

_N = len(LEAK_TIMES_S)
TURN_FIELDS = {
    # parts of e_T: rad/s; share of the axis' rate; rad, times all rates
    "e_0": 3, "e_slope": 3, "tilt": float,
    "T": (3, _N), "E": (3, _N), "T_std": _N,
    "turn_score": 3, "gyro": int,  # by axis, over the level; the axis whose gyro is broken, or -1
    "turn_max": float,  # largest |T| that sound gyros explain, rad
}  # fmt: skip


def configure_turns(att: np.void, errors: SensorErrors, v: float, w: float, dt_s: float) -> None:
    """Fill the parts of e_T and the deviation of T, at frames of dt_s.

        std(T)^2 = 2 v^2 / (1 + a) + (w dt)^2 / (1 - a^2)
        e_0 = steady + drift      tilt = e_phi + e_theta

    v rad, w rad/s: largest noise of an angle and of a gyro. dA contains the change of an angle's noise, which
    gives the first term, and dt times the noise of a gyro. steady: constant error of a gyro, rad/s; drift: of
    the attitude, rad/s; e_phi, e_theta: constant errors of phi and theta, rad.
    """
    a = att["a"]
    drift = max(abs(getattr(errors.declared, name).drift_rad_s) for name in ANGLES)
    fill(
        att, gyro=-1, T_std=np.sqrt(2.0 * v**2 / (1.0 + a) + (w * dt_s) ** 2 / (1.0 - a**2)),
        e_0=errors.each("steady", AXES) + drift, e_slope=errors.each("slope", AXES),
        tilt=errors["phi"].steady + errors["theta"].steady,
    )  # fmt: skip


@kernel
def sum_turns(att, x, dt):
    """Advance T and E by a frame of dt s, and fill `turn_score`, the largest over the leaks a of

        (|T| - E) / (T_std level)      T <- a T + dA      E <- a E + dt e_T
        e_T = e_0 + e_slope |x_i| + tilt (|x_0| + |x_1| + |x_2|)

    x (3,) rad/s: measured rates. Also fill turn_max = max(E + T_std level), rad, over axes and leaks: the
    largest |T| that sound gyros explain.
    """
    rates = abs(x[0]) + abs(x[1]) + abs(x[2])
    att.turn_max = 0.0
    for i in range(3):
        leak(att.T[i], att.a, att.turn[i])
        leak(att.E[i], att.a, dt * (att.e_0[i] + att.e_slope[i] * abs(x[i]) + att.tilt * rates))
        att.turn_score[i] = 0.0
        for m in range(att.a.size):
            excess = (abs(att.T[i, m]) - att.E[i, m]) / (att.T_std[m] * att.level)
            att.turn_max = max(att.turn_max, att.E[i, m] + att.T_std[m] * att.level)
            att.turn_score[i] = max(att.turn_score[i], excess)


@kernel
def find_gyro(att, worst):
    """Fill `gyro`: the axis whose gyro is broken, or -1. worst: the axis with the largest `turn_score`.

    It is `worst` if the attitude does not turn as that gyro says (turn_score > 1), no sum shows a fault of a
    surface (score <= 1), and no other axis turns by more than noise or the coupling (COUPLED_SHARE) explain.
    """
    if att.turn_score[worst] > 1.0 >= att.score:
        att.gyro = worst
        for i in range(3):
            if i != worst and att.turn_score[i] > max(1.0, COUPLED_SHARE * att.turn_score[worst]):
                att.gyro = -1
