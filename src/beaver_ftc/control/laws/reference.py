"""The reference that a law follows: a model of the wanted response, limited to what the surfaces can give.

    xm'' = wn^2 (ref - xm) - 2 zeta wn xm'

Second order, so that xm' needs no differentiation; discretised exactly for a reference held over the
frame.

Once authority is lost, the reference is governed, in two ways. It is hedged [Johnson2000]: what was demanded
and could not be given is subtracted from the model's acceleration, so that model and integrator wait for the
aircraft instead of winding up. And it is scaled: to follow only the half of a swing that is within reach
would ratchet the attitude, so what is missed on one side is asked for on neither.
"""

import numpy as np

from beaver_ftc.compiled import fill, kernel, record
from beaver_ftc.scenario.diagnosis import ControlConfig

MISSED_RAD_S = 0.1  # a rate missed in all by this much: the reference is given up
RECOVERY_S = 30.0  # and asked for again within this time: several periods of a slow reference

# The model A, B over dt s; steered: whether outer loops ask for the rates.
REFERENCE_CONFIG = record(dt=float, A=(2, 2), B=2, steered=int)
# active: whether the reference is governed, from the first loss of authority on; scale: of what is commanded.
GOVERNOR = record(active=int, scale=3)
# The commanded rate, the model's answer to it and the governed one that the law follows: rad/s, rad/s2.
REFERENCE_OUTPUT = record(
    commanded_rate=3, model_rate=3, model_acceleration=3, governed_rate=3, governed_acceleration=3
)
REFERENCE = record(config=REFERENCE_CONFIG, memory=GOVERNOR, output=REFERENCE_OUTPUT)


def configure_reference(reference: np.void, config: ControlConfig, dt_s: float) -> None:
    """Fill the record (dtype REFERENCE) for frames of dt_s seconds."""
    A, B = discretise(config.reference_natural_frequency_rad_s, config.reference_damping, dt_s)
    fill(reference["config"], dt=dt_s, A=A, B=B)
    reference["memory"]["scale"] = 1.0


def discretise(wn: float, zeta: float, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """State transition A (2, 2) and input B (2,) of (xm, xm') over dt (s) under a held reference; wn in
    rad/s.

    Cayley-Hamilton for a 2 x 2 matrix: exp(F dt) = e^{-s dt} (c I + d (F + s I)) with s = zeta wn, and c, d
    the (hyperbolic) cosine and sine of m dt, m^2 = s^2 - wn^2. The input follows from the equilibrium (ref,
    0).
    """
    s = zeta * wn
    m = np.sqrt(complex(s * s - wn * wn))
    c = np.cosh(m * dt).real
    d = (np.sinh(m * dt) / m).real if abs(m) * dt > 1e-8 else dt
    A = np.exp(-s * dt) * np.array([[c + s * d, d], [-wn * wn * d, c - s * d]])
    return A, np.array([1.0 - A[0, 0], -A[1, 0]])


@kernel
def advance(config, rate, acceleration, wanted):
    """Rate xm (rad/s) and acceleration xm' (rad/s2) of the model a frame on, ref = `wanted` (rad/s) held:

    (xm, xm') <- A (xm, xm') + B ref
    """
    A, B = config.A, config.B
    following = A[0, 0] * rate + A[0, 1] * acceleration + B[0] * wanted
    return following, A[1, 0] * rate + A[1, 1] * acceleration + B[1] * wanted


@kernel
def follow(config, output, commanded):
    """Advance the model by one frame towards `commanded` (3,) rad/s."""
    output.commanded_rate[:] = commanded
    for i in range(3):
        rate, acceleration = output.model_rate[i], output.model_acceleration[i]
        rate, acceleration = advance(config, rate, acceleration, commanded[i])
        output.model_rate[i], output.model_acceleration[i] = rate, acceleration


@kernel
def govern(reference, commanded, shortfall, authority_lost):
    """Bring what the law follows, xm and xm', to the next frame: the model's, until the reference is
    governed, then

        scale <- scale - dt |shortfall| / MISSED_RAD_S,    then scale + dt / RECOVERY_S (1 - scale), 0 or more
        (xm, xm') <- A (xm, xm') + B scale commanded,    xm <- xm - dt shortfall

    commanded (3,) rad/s; shortfall (3,) rad/s2: what was demanded and not given. authority_lost: whether a
    surface is slow or parked now: from then on the reference is governed.
    """
    config, governor, output = reference.config, reference.memory, reference.output
    if authority_lost:
        governor.active = 1
    if not governor.active:
        output.governed_rate[:] = output.model_rate
        output.governed_acceleration[:] = output.model_acceleration
        return
    dt = config.dt
    for i in range(3):
        scale = governor.scale[i] - dt * abs(shortfall[i]) / MISSED_RAD_S
        if not config.steered:  # where outer loops steer, they ask again for what was missed
            governor.scale[i] = max(scale + dt / RECOVERY_S * (1.0 - scale), 0.0)
        rate, acceleration = output.governed_rate[i], output.governed_acceleration[i]
        rate, acceleration = advance(config, rate, acceleration, governor.scale[i] * commanded[i])
        output.governed_rate[i] = rate - dt * shortfall[i]
        output.governed_acceleration[i] = acceleration
