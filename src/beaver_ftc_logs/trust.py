"""Which rows of a flight are credible, and of which groups of surfaces a model knows the effect.

`FittedRanges` has the ranges in which a model was fitted. A row is credible if commands, rates and airspeed
were in these ranges, but for a margin, in at least half of the last seconds, no column is frozen, and no rate
was clipped lately. Other rows have no alarm, no name, and bounds of 0 and 1. The size of the residual does
not count, since a fault makes it large too. Whether a row is credible depends on no later row.

The word *judged* after a constant means that we chose it by judgement, *derived* that it follows from others.
"""

from dataclasses import replace
from itertools import compress

import numpy as np

from beaver_ftc_logs import energy, regression
from beaver_ftc_logs.fit_parts import Parts
from beaver_ftc_logs.model import FittedRanges, Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats, Mask, Reasons
from beaver_ftc_logs.runs import trailing_sums
from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.signals import MIN_STILL_S

# Quantiles at the ends of a range; judged: one sample in 500 is an outlier.
_RANGE_QUANTILES = (0.001, 0.999)
# A number is outside if it passes a range by more than this share of its width; judged.
_RANGE_MARGIN_SHARE = 0.5
# An airspeed is outside if it passes the least or the largest by more than this share of it; judged: the
# effect of a surface, which grows with the square of the airspeed, changes by at most 32 %.
_AIRSPEED_MARGIN = 0.15
# A row is outside if more than half of the samples in this time before it are; the length is judged.
_RANGE_WINDOW_S = 5.0
_MIN_OUTSIDE_SHARE = 0.5
# A column may stand still this many times as long as it did in the flights of the model; judged.
_MAX_STILL_FACTOR = 3.0
# Rows are not credible for this time after a rate was clipped; judged.
_CLIPPING_MEMORY_S = 30.0
# There is no verdict on a group if other quantities explain this share of its effect or more; judged: a
# fiftieth of the effect remains.
_MAX_TIED_SHARE = 0.98


def compute_fitted_ranges(parts: Parts, tied: Floats, gain_sd: Floats) -> FittedRanges:
    """Compute the ranges in which a model was fitted.

    tied (G,): share of the effect of each group on the rates that past rates, signals and the other groups
    explain (`effect_errors.tied_shares`). gain_sd (G,): standard error of the gain of each group, 1 in the
    model, in parts not fitted.
    """

    def usable(name: str) -> Floats:
        """A field of the samples that the fit used, from all parts."""
        return np.concatenate([getattr(part.samples, name)[part.is_usable] for part in parts])

    airspeeds = usable("airspeed")
    climbs = usable("energy_height_rate_mps")
    climbs = climbs[np.isfinite(climbs)]
    is_airspeed_known = np.isfinite(airspeeds).any()
    still: dict[str, float] = {}
    for part in parts:
        for name, still_s in part.samples.unchanged_s.items():
            still[name] = max(still.get(name, 0.0), float(still_s[part.is_usable].max(initial=0.0)))
    return FittedRanges(
        commands=central_ranges(usable("commands")),
        rates=central_ranges(usable("rates")),
        airspeed=central_ranges(airspeeds[:, None])[0] if is_airspeed_known else None,
        tied=tied.tolist(),
        gain_sd=gain_sd.tolist(),
        still_s=still,
        energy_climb=float(np.quantile(climbs, energy.UNPOWERED_SHARE)) if climbs.size else None,
    )


def central_ranges(values: Floats) -> list[list[float]]:
    """[low, high] of each column of values (n, k): its quantiles _RANGE_QUANTILES; [0, 0] for a column
    without a number."""
    if not values.shape[1]:
        return []
    known = np.where(np.isfinite(values).any(axis=0), values, 0.0)
    return np.nanquantile(known, _RANGE_QUANTILES, axis=0).T.tolist()


def known_effects(model: Model) -> Mask:
    """Whether the effect of each group is known, so that there can be a verdict on it, (G,); all are if the
    model file states no tied shares."""
    return np.array(model.fitted.tied or [0.0] * len(model.groups)) < _MAX_TIED_SHARE


def known_gains(model: Model) -> Mask:
    """Whether the effect of each group is known under any law, (G,). With other laws, BOUND_MARGIN standard
    errors of its gain must be less than the whole effect."""
    known = known_effects(model)
    if not model.fitted.gain_sd or not model.vehicle.other_laws:
        return known
    return known & (regression.BOUND_MARGIN * np.array(model.fitted.gain_sd) < 1.0)


def unknown_surfaces(model: Model) -> set[str]:
    """The surfaces whose effect is unknown."""
    return {name for group in compress(model.groups, ~known_effects(model)) for name in group}


def unknown_sentences(model: Model) -> list[str]:
    """A sentence for each group whose effect is unknown, with the reason."""
    start = "of what {} does, {:.1%} follows from the rates, signals and other surfaces of the flights fitted"
    rows = zip(model.group_names, model.fitted.tied, known_effects(model), strict=False)
    return [
        f"{start.format(name, share)}: its effect cannot be told, nothing is said of it"
        for name, share, known in rows
        if not known
    ]


def untrusted_rows(samples: Samples, model: Model) -> Reasons:
    """Reason -> rows (n,) that are not credible for it."""
    reasons: Reasons = _still_rows(samples, model)
    n = np.floor(_CLIPPING_MEMORY_S / samples.dt_s) + 1.0
    recent, _ = trailing_sums(samples.is_rate_clipped, n)
    reasons[f"a rate was clipped in the last {_CLIPPING_MEMORY_S:g} s"] = recent > 0
    return reasons | _rows_out_of_range(samples, model)


def _rows_out_of_range(samples: Samples, model: Model) -> Reasons:
    """Reason -> rows (n,) in which a command, a rate or the airspeed was outside its range, by more than its
    margin, for most of the last _RANGE_WINDOW_S, or of the flight so far if that is shorter."""
    ranges = model.fitted
    commands = [f"command of {surface}" for surface in model.vehicle.surfaces]
    channels = [
        *zip(commands, samples.commands.T, ranges.commands, strict=False),
        *zip(model.vehicle.rate_columns, samples.rates.T, ranges.rates, strict=False),
    ]
    if ranges.airspeed is not None:
        channels.append(("airspeed", samples.airspeed, ranges.airspeed))
    reasons = {}
    for name, values, (lo, hi) in channels:
        below = above = _RANGE_MARGIN_SHARE * (hi - lo) + MIN_DIVISOR
        if name == "airspeed":
            below = _AIRSPEED_MARGIN * lo
            above = _AIRSPEED_MARGIN * hi
        outside = (values < lo - below) | (values > hi + above)
        reason = f"{name} is outside {lo:.3g} to {hi:.3g}, where the model was fitted"
        sums, n = trailing_sums(outside, _RANGE_WINDOW_S / samples.dt_s)
        reasons[reason] = sums > _MIN_OUTSIDE_SHARE * n
    return reasons


def _still_rows(samples: Samples, model: Model) -> Reasons:
    """Reason -> rows (n,) in which a column has stood still for longer than its limit. still_s: the longest
    time for which it stood still in the flights of the model.

        column                  limit, s
        a rate, still_s known   max(MIN_STILL_S / 3, _MAX_STILL_FACTOR still_s)
        a rate, unknown         MIN_STILL_S
        another, still_s known  max(MIN_STILL_S, _MAX_STILL_FACTOR still_s); without a limit if unknown
    """
    fitted = model.fitted.still_s
    rates = model.vehicle.rate_columns
    reasons = {}
    for name, unchanged_s in samples.unchanged_s.items():
        still_s = fitted.get(name, 0.0 if name in rates else np.inf)
        least_s = MIN_STILL_S / 3.0 if name in fitted and name in rates else MIN_STILL_S
        limit_s = max(least_s, _MAX_STILL_FACTOR * still_s)
        reasons[f"{name} stands still, for longer than {limit_s:.3g} s"] = unchanged_s > limit_s
    return reasons


def without_dead_rows(samples: Samples, model: Model) -> Samples:
    """The flight without rates in rows in which a column stands still or a rate is clipped, so that the
    filter estimates nothing from them."""
    dead = np.any([*_still_rows(samples, model).values(), samples.is_rate_clipped], axis=0)
    if not dead.any():
        return samples
    return replace(samples, rates=np.where(dead[:, None], np.nan, samples.rates))
