"""The reference that a law follows: a model of the wanted response, limited to what the surfaces can give.

    xm'' = wn^2 (ref - xm) - 2 zeta wn xm'

The model is of second order, so that xm' needs no differentiation. It is discretised exactly for a reference
that is held over the frame.

Once authority is lost, the reference is governed, in two ways:

- It is hedged [Johnson2000]: the acceleration that was demanded and not given is subtracted from the model's,
  that is, dt shortfall from xm. So the model and the law's integrator wait for the aircraft instead of
  winding up.
- It is scaled: if only one half of a swing is within reach, the attitude would drift with every swing. So the
  commanded rate is scaled down in both directions.
"""

import numpy as np

from beaver_ftc.compiled import copy, fill, kernel, record
from beaver_ftc.scenario.diagnosis import ControlConfig

MISSED_RAD_S = 0.1  # integral of the shortfall that brings the scale from 1 to 0
RECOVERY_S = 30.0  # time constant with which the scale returns to 1: several periods of a slow reference

# A (2, 2), B (2,): the model over a frame of dt s; steered: whether the autopilot commands the rates.
REFERENCE_CONFIG = record(dt=float, A=(2, 2), B=2, steered=int)
# active: whether the reference is governed, from the first loss of authority on; scale (3,): factor of the
# commanded rate, 0 to 1.
GOVERNOR = record(active=int, scale=3)
# Rates (3,) rad/s and accelerations (3,) rad/s2: the commanded rate, the model's answer to it (xm, xm'), and
# the governed answer, which the law follows.
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

    Cayley-Hamilton for a 2 x 2 matrix: exp(F dt) = e^{-s dt} (c I + d (F + s I)) with s = zeta wn,
    c = cosh(m dt), d = sinh(m dt) / m in s, and m^2 = s^2 - wn^2. The input follows from the equilibrium
    (ref, 0).
    """
    s = zeta * wn
    m = np.sqrt(complex(s * s - wn * wn))
    c = np.cosh(m * dt).real
    d = (np.sinh(m * dt) / m).real if abs(m) * dt > 1e-8 else dt
    A = np.exp(-s * dt) * np.array([[c + s * d, d], [-wn * wn * d, c - s * d]])
    return A, np.array([1.0 - A[0, 0], -A[1, 0]])


@kernel
def advance(config, xm, dxm, ref):
    """Rate xm, rad/s, and acceleration xm' = dxm, rad/s2, of the model one frame later; ref rad/s is held:

    (xm, xm') <- A (xm, xm') + B ref
    """
    A = config.A
    B = config.B
    return (
        A[0, 0] * xm + A[0, 1] * dxm + B[0] * ref,
        A[1, 0] * xm + A[1, 1] * dxm + B[1] * ref,
    )


@kernel
def follow(config, output, commanded):
    """Advance the model, xm and xm' (3,), by one frame towards `commanded` (3,) rad/s."""
    copy(commanded, output.commanded_rate)
    xm = output.model_rate
    dxm = output.model_acceleration
    for i in range(3):
        xm[i], dxm[i] = advance(config, xm[i], dxm[i], commanded[i])


@kernel
def govern(reference, commanded, shortfall, authority_lost):
    """Bring the reference that the law follows, xm and xm' (3,), to the next frame. It is the answer of the
    model until the reference is governed, and then

        scale <- scale - dt |shortfall| / MISSED_RAD_S
        scale <- max(scale + dt / RECOVERY_S (1 - scale), 0)
        (xm, xm') <- A (xm, xm') + B scale commanded,    xm <- xm - dt shortfall

    The scale stays while the autopilot steers, since its loops demand again what was missed. commanded (3,)
    rad/s; shortfall (3,) rad/s2: the part of the demand that was not given. authority_lost: whether a surface
    is slow or parked now; from then on the reference is governed.
    """
    config = reference.config
    governor = reference.memory
    output = reference.output
    if authority_lost:
        governor.active = 1
    if not governor.active:
        output.governed_rate = output.model_rate
        output.governed_acceleration = output.model_acceleration
        return
    dt = config.dt
    xm = output.governed_rate
    dxm = output.governed_acceleration
    for i in range(3):
        if not config.steered:
            scale = governor.scale[i] - dt * abs(shortfall[i]) / MISSED_RAD_S
            governor.scale[i] = max(scale + dt / RECOVERY_S * (1.0 - scale), 0.0)
        xm[i], dxm[i] = advance(config, xm[i], dxm[i], governor.scale[i] * commanded[i])
        xm[i] -= dt * shortfall[i]
