"""The published scheme: the FDAE alone raises the alarm, and its network of (x, u) learns [Zhang2005]."""

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.diagnosis import conclusion, scheme, zhang2005
from beaver_ftc.diagnosis.detection import bank, fdae
from beaver_ftc.diagnosis.isolation import estimators
from beaver_ftc.diagnosis.monitors import sensor_monitor
from beaver_ftc.diagnosis.schemes import contract, fault_classes
from beaver_ftc.diagnosis.schemes.adaptive_estimators import begin
from beaver_ftc.diagnosis.schemes.contract import CompiledScheme


@apart
def predict(fdi, belief, measured, k, t):
    """Bring isolation, FDAE and its network to this frame (contract.CompiledScheme)."""
    published, bound, dt = fdi.published, fdi.bound, fdi.config.dt
    bank.innovate(fdi.bank, bound, measured.x, belief.x_then, belief.means.acceleration, dt)
    scheme.predict_estimators(fdi, belief)
    zhang2005.approximate(published, fdi.fdae, fdi.verdict.detected, dt)
    fdae.predict(fdi.fdae, bound, belief.x_then, belief.means.acceleration, False, False, dt)
    if published.config.constant > 0.0:
        hold_thresholds(fdi, published.config.constant)


@kernel
def hold_thresholds(fdi, constant):
    """Replace all adaptive thresholds by a constant, rad/s."""
    fdae.hold_threshold(fdi.fdae, constant)
    bank.hold_threshold(fdi.bank, constant)
    estimators.hold_thresholds(fdi.isolation, constant)


@apart
def conclude(fdi, belief, measured, t):
    """Raise the alarm by the FDAE, evaluate its network, and isolate (contract.CompiledScheme)."""
    if sensor_monitor.has_alarm(fdi.sensor_monitor):
        return
    known, found = fdi.verdict.detected, fdi.verdict
    fdae.form_residual(fdi.fdae, measured.x)
    axis = zhang2005.detect(fdi.fdae)
    zhang2005.respond(fdi.published, fdi.fdae, fdi.layout.main, measured.x, measured.y, belief.u)
    if axis >= 0:
        conclusion.latch_alarm(found, axis, t)
    if found.detected:
        fault_classes.isolate_fault(fdi, measured, t, known)


SCHEME = CompiledScheme(begin, predict, conclude, contract.prepare_nothing, contract.accumulate_nothing)
