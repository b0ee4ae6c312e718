"""White noise: rates, commands and signals of a flight filtered by a moving average of its noise."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from beaver_ftc_logs.runs import runs_between
from beaver_ftc_logs.samples import Samples

# Moving averages of the noise. A gust that is held within a sample adds to the next one (positive
# coefficients), the noise of a gyro subtracts from it (negative ones).
NOISE_MA_CANDIDATES = (
    (1.0,), (1.0, 0.5),
    *((1.0, -2.0 * c, c**2) for c in (0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9)),
)  # fmt: skip
# Noise that is tried even if no fitted flight had it: the moving averages of gusts, and the noise of gyros
# from that of a laboratory to that of a toy, in steps of a factor of 3.2, so that none is more than 1.8 times
# off.
UNFITTED_MA = NOISE_MA_CANDIDATES[:2]
UNFITTED_GYROS_RAD_S = tuple(np.geomspace(1e-5, 1e-2, 7).tolist())


def whiten_samples(samples: Samples, C: Sequence[float], fit_weight: float = 1.0) -> Samples:
    """The flight with rates, commands and signals x filtered by C(1) / C(z), so that an autoregressive model
    leaves a white residual [Ljung1999, section 4.2]. C: moving average of the noise (1, c1, ...).

    The filter restarts from rest at the first row x0 of each run [begin, end) of known rows without a gap. A
    row with an unknown number becomes unknown as a whole.
    """
    from scipy.signal import lfilter

    x = np.hstack([samples.rates, samples.commands, samples.signals])
    known = np.isfinite(x).all(axis=1)
    x[~known] = np.nan
    for begin, end in runs_between((np.diff(known) != 0) | (np.diff(samples.stretch_number) != 0)):
        x0 = x[begin]
        x[begin:end] = x0 + lfilter([sum(C)], C, x[begin:end] - x0, axis=0)
    rates, commands, white_signals = np.split(x, [3, 3 + samples.commands.shape[1]], axis=1)
    return replace(
        samples,
        rates=rates,
        commands=commands,
        signals=white_signals,
        noise_ma_coefficients=tuple(C),
        fit_weight=fit_weight,
    )
