"""Search the moving average of the noise of each flight, and whiten the flights by it.

Z, y        regressors (n, m) of a fit (`orders.stack_data`), and rates (n, 3), rad/s
C, e        coefficients of a fit (m, 3), and its residual (n, 3), rad/s
ma          moving average of the noise, 1 first; a flight is *whitened* by it (`whitening.whiten_samples`)
"""

from collections.abc import Sequence

import numpy as np

from beaver_ftc_logs.fit_parts import fit_parts
from beaver_ftc_logs.least_squares import left_by
from beaver_ftc_logs.orders import RATE_LAGS, stack_data
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.vehicle import Vehicle
from beaver_ftc_logs.whitening import NOISE_MA_CANDIDATES, whiten_samples

# Largest number of rounds of `whiten_flights`.
_MAX_ROUNDS = 8


def whiten_flights(flights: Sequence[Samples], vehicle: Vehicle) -> list[Samples]:
    """The flights; in moving air, whitened by the likeliest moving average of each.

    A law feeds the noise of the rates back to the surfaces. If the residual is not white, a fit attributes
    noise to the surfaces [Ljung1999, section 13.4]. The moving averages follow from the residuals of one
    common fit to all flights, and this fit follows from the moving averages:

        1. the first averages: for each flight the likeliest by fits to this flight alone, one an average
        2. a common fit to all flights, whitened by their averages
        3. for each flight the likeliest average by the residual of the common fit; stop if none has changed
           since step 4
        4. whiten again, with weights that give all flights the same noise (they are 1 before); continue with
           step 2, for at most _MAX_ROUNDS rounds

    Likelihoods are those of `_likeliest_ma`. Raises BadInput if a flight has fewer than 2 samples for a fit.

    likeliest: the pair of `_likeliest_ma` for each flight, by step 3. averages: their moving averages, empty
    before the first round.
    """
    if not vehicle.moving_air:
        return list(flights)
    from scipy.signal import lfilter

    def stacked(flights: Sequence[Samples]) -> tuple[Floats, Floats]:
        """Regressors and rates of flights for the largest order of the rates."""
        # The commands have as many lags as the rates, not their largest number: the kept results depend on
        # it.
        h = max(RATE_LAGS)
        return stack_data(fit_parts(flights), vehicle, h, h)[:2]

    def own_residual(flight: Samples, ma: tuple[float, ...]) -> Floats:
        """Residual (n, 3) of the fit to one flight, whitened by a moving average."""
        Z, y = stacked([whiten_samples(flight, ma)])
        if len(y) < 2:
            known = f"{len(y)} samples known to be healthy"
            raise refusal("identify", f"{flight.name}: {known}", "at least 2")
        return left_by(Z, y)

    whitened = []
    for flight in flights:
        _, ma = _likeliest_ma({ma: own_residual(flight, ma) for ma in NOISE_MA_CANDIDATES})
        whitened.append(whiten_samples(flight, ma))
    averages: list[tuple[float, ...]] = []
    for _ in range(_MAX_ROUNDS):
        Z, y = stacked(whitened)
        C = np.linalg.lstsq(Z, y, rcond=None)[0]
        likeliest = []
        for flight in flights:
            Z, y = stacked([flight])
            e = y - Z @ C
            residuals = {ma: lfilter([sum(ma)], ma, e, axis=0) for ma in NOISE_MA_CANDIDATES}
            likeliest.append(_likeliest_ma(residuals))
        if (new := [ma for _, ma in likeliest]) == averages:
            break
        averages = new
        mean = np.mean([log_det for log_det, _ in likeliest])
        whitened = [
            whiten_samples(flight, ma, float(np.exp((mean - log_det) / 6.0)))
            for flight, (log_det, ma) in zip(flights, likeliest, strict=True)
        ]
    return whitened


def _likeliest_ma(residuals: dict[tuple[float, ...], Floats]) -> tuple[float, tuple[float, ...]]:
    """For the likeliest moving average: log det R of the residual's covariance R, and this average.
    residuals: moving average -> residual (n, 3) of a flight that was whitened by it.

    Whitening by ma(1) / ma(z) multiplies the noise by ma(1), the sum of the average. So the likeliest average
    has the least log det R - 6 log ma(1): the variance of each of the 3 axes is multiplied by ma(1)^2.
    """
    log_dets = {ma: float(np.linalg.slogdet(np.cov(e.T))[1]) for ma, e in residuals.items()}
    best = min(log_dets, key=lambda ma: log_dets[ma] - 6.0 * float(np.log(sum(ma))))
    return log_dets[best], best
