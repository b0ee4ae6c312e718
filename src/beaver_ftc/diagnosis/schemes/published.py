"""The published scheme: the FDAE alone raises the alarm, and its network of (x, u) learns [Zhang2005]."""

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.diagnosis import conclusion, zhang2005
from beaver_ftc.diagnosis.detection import bank, fdae
from beaver_ftc.diagnosis.isolation import estimators
from beaver_ftc.diagnosis.schemes.contract import CompiledScheme


@apart
def predict(fdi, belief):
    """Bring the FDAE and its network to this frame (contract.CompiledScheme)."""
    published, dt = fdi.published, fdi.config.dt
    zhang2005.approximate(published, fdi.fdae, fdi.verdict.detected, dt)
    fdae.predict(fdi.fdae, fdi.bound, belief.x_then, belief.means.acceleration, False, False, dt)
    if published.config.constant > 0.0:
        hold_thresholds(fdi, published.config.constant)


@kernel
def hold_thresholds(fdi, constant):
    """Replace all adaptive thresholds by a constant, rad/s."""
    fdae.hold_threshold(fdi.fdae, constant)
    bank.hold_threshold(fdi.bank, constant)
    estimators.hold_thresholds(fdi.isolation, constant)


@apart
def detect(fdi, belief, measured, t):
    """Raise the alarm by the FDAE, and evaluate its network (contract.CompiledScheme)."""
    axis = zhang2005.detect(fdi.fdae)
    zhang2005.respond(fdi.published, fdi.fdae, fdi.layout.main, measured.x, measured.y, belief.u)
    if axis >= 0:
        conclusion.latch_alarm(fdi.verdict, axis, t)


@apart
def evaluate(fdi, measured):
    """The network is evaluated in every frame, by `detect` (contract.CompiledScheme)."""


SCHEME = CompiledScheme(predict, detect, evaluate)
