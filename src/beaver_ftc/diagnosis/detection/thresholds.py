"""Adaptive thresholds: what a residual may reach without the fault in question.

All filters are exact for the discrete truth x[k+1] = x[k] + dt (F[k] + eta[k]): with a = exp(-lam dt) a
residual obeys eps[k+1] = a eps[k] + dt eta[k], and so does its bound with eta_bar in place of eta. The
promises of the theory therefore hold at any frame rate, with no allowance for discretisation.
"""

from beaver_ftc.compiled import kernel


@kernel
def bound_step(bound, eta_bar, decay, dt):
    """Advance ebar' = -lam ebar + eta_bar by one frame [Zhang2005, sec. IV].

    Units: bound rad/s, eta_bar rad/s2, decay = exp(-lam dt), dt s.
    """
    return decay * bound + dt * eta_bar


@kernel
def noise_step(noise, nbar, decay):
    """Advance the filtered bound on a gyro's changing error, rad/s, by one frame; nbar as the frame began.

    See bounds/worst_case.py: what a residual may owe to the gyro is this and the present nbar.
    """
    return decay * noise + (1.0 - decay) * nbar


@kernel
def interval(low, high, rise, fall, omega, theta, bound):
    """The signed interval (lower, upper), rad/s, that holds the residual of the true estimator.

    The parameter may move anywhere within [low, high] at every instant, so an incipient or intermittent
    fault is covered: int w Z theta lies between low rise + high fall and high rise + low fall, where rise
    and fall filter the positive and the negative part of Z. The residual is that integral less omega
    thetahat, widened by the bound on the uncertainty.
    """
    lower = low * rise + high * fall - omega * theta - bound
    upper = high * rise + low * fall - omega * theta + bound
    return lower, upper


@kernel
def published(low, high, omega, theta, bound):
    """The norm bound mu = k |Omega| + bound, rad/s, symmetric; k bounds |theta - thetahat| [Zhang2005, via
    Zhang2002].
    """
    mu = max(theta - low, high - theta) * abs(omega) + bound
    return -mu, mu
