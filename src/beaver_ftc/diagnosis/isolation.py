"""The fault isolation estimators (FIE), started at detection, and the decision among them.

    xhats' = -Lambdas (xhats - x) + f + G u + base + Zs ths + Oms ths'      Oms' = -Lambdas Oms + Zs,  Oms(Td) = 0

[Zhang2005, sec. IV]. In discrete time, with Omega[k+1] = a Omega[k] + dt Z[k] and the estimate's step multiplied by Omega[k+1],
the residual of the true estimator is exactly Omega (theta - thetahat) plus the filtered uncertainty, whatever the estimate does.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.fault_class import hypothesis
from beaver_ftc.diagnosis.state import INTERVAL, NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.diagnosis.thresholds import bound_step, interval, published


@kernel
def start(fdi, x):
    """Start every estimator at the measured x (3,) rad/s, with no residual and no knowledge of theta."""
    for s in range(fdi.n_estimators):
        fie = fdi.estimator[s]
        for i in range(3):
            fie.xhat[i] = x[i]
            fie.covariance[i] = (fie.high - fie.low) ** 2 / 12.0  # of a uniform distribution


@kernel
def test(fdi, fie, x, t):
    """Form the residual and its limits at time t (s); exclude the fault when a residual leaves them."""
    for i in range(3):
        fie.residual[i] = x[i] - fie.xhat[i]
        if fdi.thresholds == INTERVAL:
            fie.lower[i], fie.upper[i] = interval(
                fie.low, fie.high, fie.rise[i], fie.fall[i], fie.omega[i], fie.theta[i], fie.bound[i]
            )
        else:
            fie.lower[i], fie.upper[i] = published(fie.low, fie.high, fie.omega[i], fie.theta[i], fie.bound[i])
        if not fie.excluded and not fie.lower[i] <= fie.residual[i] <= fie.upper[i]:
            fie.excluded = 1
            fie.excluded_at_s = t


@kernel
def decide(fdi, t):
    """The generalised observer scheme: the one left is the fault; none left means it is outside the class."""
    left, last = 0, NOT_ISOLATED
    for s in range(fdi.n_estimators):
        if not fdi.estimator[s].excluded:
            left += 1
            last = s
    verdict = NOT_ISOLATED if left > 1 else (last if left == 1 else UNANTICIPATED)
    if verdict != fdi.isolated:
        fdi.isolated = verdict
        fdi.isolated_at_s = t


@kernel
def isolate(fdi, x, t):
    """Test every estimator against the measured x (3,) rad/s at time t (s), and decide."""
    for s in range(fdi.n_estimators):
        test(fdi, fdi.estimator[s], x, t)
    decide(fdi, t)


@kernel
def adapt(fie, i, forgetting):
    """One least-squares step of thetahat_i, projected onto the known set; returns the step.

    Gradient along Omega with the gain covariance / (noise + Omega^2 covariance); the noise is the bound on the filtered
    uncertainty, so an estimate moves no faster than its information allows.
    """
    noise = fie.bound[i] ** 2
    gain = fie.covariance[i] * fie.omega[i]
    scale = noise + fie.omega[i] * gain
    if scale <= 0.0:
        return 0.0
    before = fie.theta[i]
    fie.theta[i] = min(max(before + gain / scale * fie.residual[i], fie.low), fie.high)
    prior = (fie.high - fie.low) ** 2 / 12.0
    fie.covariance[i] = min(fie.covariance[i] * noise / scale / forgetting, prior)
    return fie.theta[i] - before


@kernel
def predict(fdi, fie, x, believed, G, Gu):
    """Advance one estimator by a frame; x (3,) rad/s as the frame began, the rest means over the frame.

    believed (3,) rad/s2 is f + G u; G (3, 4) rad/s2 per rad; Gu (3, 4) rad/s2 the contribution of each surface to it.
    """
    dt = fdi.dt
    hypothesis(fie.kind, fie.surface, G, Gu, fie.base, fie.Z)
    for i in range(3):
        a = fdi.fie_decay[i]
        Z, theta = fie.Z[i], fie.theta[i]
        omega = a * fie.omega[i] + dt * Z
        step = adapt(fie, i, fdi.forgetting)
        rate = believed[i] + fie.base[i] + Z * theta
        fie.xhat[i] = x[i] + dt * rate + a * (fie.xhat[i] - x[i]) + omega * step
        fie.omega[i] = omega
        fie.rise[i] = a * fie.rise[i] + dt * max(Z, 0.0)
        fie.fall[i] = a * fie.fall[i] + dt * min(Z, 0.0)
        fie.bound[i] = bound_step(fie.bound[i], fdi.eta_bar[i], a, dt)


@kernel
def predict_all(fdi, x, believed, G, Gu):
    """Advance the bank by a frame; arguments as in `predict`."""
    for s in range(fdi.n_estimators):
        predict(fdi, fdi.estimator[s], x, believed, G, Gu)
