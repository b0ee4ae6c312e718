"""The inflation of the noise that covers the errors of the gains in parts left out (`gains`)."""

from collections import defaultdict

import numpy as np

from beaver_ftc_logs.fit_parts import FitPart, Parts
from beaver_ftc_logs.folds import Fold, held_out_folds
from beaver_ftc_logs.gains import gain_errors, standardized
from beaver_ftc_logs.model import Model, NoiseModel
from beaver_ftc_logs.noise_models import parts_of_noise
from beaver_ftc_logs.posterior import recent_scale

# Length of the windows in which the gains are estimated: chosen on seeds 11 and 12, in light turbulence.
_GAIN_WINDOW_S = 10.0
# Further factors on the variance of the noise of gyros and of gusts, in moving air under another law. Chosen
# on seeds 71, 73 and 101 to 106: 3 of 240 healthy flights alarmed, and 6 of 150 without the factors.
_GYRO_FACTOR = 1.7
_GUST_FACTOR = 2.5
# Largest noise factor of a window. If there are few flights, one of them can be far from all others (a factor
# of 1,550 in seed 205, otherwise 5).
_MAX_INFLATION = 200.0


def widen_noise(parts: Parts, model: Model) -> Model:
    """The model whose noise models have a variance inflation (`wider`), at least 1: the mean over all windows
    of _GAIN_WINDOW_S in parts left out, with this noise, of the squared errors of the gains over the expected
    ones, each at most _MAX_INFLATION, with a gain for each axis of a response; under other laws, times
    _GYRO_FACTOR or _GUST_FACTOR. A noise without a window gets 1."""
    windows: defaultdict[tuple[float, ...], list[float]] = defaultdict(list)
    for fold in held_out_folds(parts, model):
        loudness = _loudness(fold, fold.fitted if len(parts) > 1 else parts)
        errors = gain_errors(fold, _GAIN_WINDOW_S, loudness)
        ratios = [min(error / max(n, 1), _MAX_INFLATION) for error, n in errors]
        windows[fold.held_out.samples.noise_ma_coefficients] += ratios
    noises = [
        noise.model_copy(update={"wider": _inflation(noise, windows[tuple(noise.average)], model)})
        for noise in model.colours
    ]
    return model.model_copy(update={"colours": noises})


def _inflation(noise: NoiseModel, ratios: list[float], model: Model) -> float:
    """The variance inflation of a noise model. ratios: of all its windows."""
    if not ratios:
        return 1.0
    # The noise of a gyro subtracts from the next sample what it added to one: its second coefficient is
    # negative.
    factor = _GYRO_FACTOR if min(noise.average[:2]) < 0.0 else _GUST_FACTOR
    return max(float(np.mean(ratios)), 1.0) * (factor if model.vehicle.other_laws else 1.0)


def _loudness(fold: Fold, others: Parts) -> float:
    """Ratio of the variance of the residual in a flight left out to that in the loudest other flight of the
    same noise, or to that of the noise if it is larger; 1 if the flight is not louder, or if no other laws
    fly. The filter widens its noise by this ratio itself (`recent_scale`), so `gain_errors` divides F and e
    by its root."""
    model = fold.model
    ma = fold.held_out.samples.noise_ma_coefficients
    if not model.vehicle.other_laws:
        return 1.0

    def scale(part: FitPart) -> float:
        """Mean ratio of the variance in a part to that of the noise, 1 without a sample."""
        _, e = standardized(model, part.innovations(model))
        scales = recent_scale(e, np.ones(len(e), dtype=bool), model.rate_hz)
        return float(scales.mean()) if len(scales) else 1.0

    return max(scale(fold.held_out) / max([1.0, *map(scale, parts_of_noise(others, ma))]), 1.0)
