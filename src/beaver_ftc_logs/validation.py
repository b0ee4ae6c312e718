"""Choose the alarm's threshold on parts left out, and score their diagnosis."""

from collections.abc import Sequence

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_logs import extremes, trust
from beaver_ftc_logs.bank import build_bank
from beaver_ftc_logs.effect_errors import tied_shares
from beaver_ftc_logs.evidence import fault_evidence, page_cusum
from beaver_ftc_logs.fit_parts import Parts
from beaver_ftc_logs.folds import Fold, fold_qualities, held_out_folds
from beaver_ftc_logs.gains import gain_sd_with_deviations
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.posterior import bank_posterior
from beaver_ftc_logs.posterior_rows import NO_RESPONSE_LIMIT, rows_of_posterior
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.runs import runs_between
from beaver_ftc_logs.scoring import score_against_labels

_DEFAULT_FALSE_ALARMS = 1.0  # 1/h, if the vehicle file states no rate
# In still air, under a law that the fit has not seen, an alarm needs this multiple of the evidence by theory.
# docs/results/choices.md has the flights that chose it.
_LORDEN_FACTOR = 2.0
_CREDIBLE_MASSES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95)  # masses that are tried
# Share of labels that the bounds are to contain: 90 %, and a reserve for the changes of another day.
_COVERAGE_GOAL = 0.93


def add_ranges_and_threshold(parts: Parts, model: Model) -> Model:
    """The model with the ranges in which it was fitted, with the threshold of the alarm, and with the test of
    this threshold as `identified`. At this threshold, parts left out would alarm at most as often as the
    vehicle file requests. Without a request, the rate is _DEFAULT_FALSE_ALARMS, or there is no threshold if
    labels show faults (settings.levels). Raises BadInput if a rate is requested and the parts have too few
    peaks to estimate it.
    """
    folds = list(held_out_folds(parts, model))
    peaks = [_healthy_peaks(fold) for fold in folds]
    tail = extremes.fit_peak_tail(peaks)
    gain_sd = gain_sd_with_deviations(parts, model, folds)
    ranges = trust.compute_fitted_ranges(parts, tied_shares(parts, model), gain_sd).model_copy(
        update={"tail": tail}
    )
    requested = model.vehicle.false_alarms_per_hour
    if tail is None and requested is not None:
        minutes = 60.0 * sum(hours for _, hours in peaks)
        reason = f"{minutes:.1f} min of health left out have too few peaks of the evidence to tell"
        raise refusal(
            "identify",
            f"false_alarms_per_hour {requested:g}: {reason}",
            "more minutes of healthy flight, or no such rate",
        )
    rate = _DEFAULT_FALSE_ALARMS if requested is None and not model.settings.levels else requested
    threshold = _choose_threshold(tail, rate, model) if rate else None
    alarm = {"false_alarms_per_hour": rate, "threshold": threshold}
    return model.model_copy(
        update={
            "fitted": ranges,
            "settings": model.settings.model_copy(update=alarm),
            "identified": _cross_validate(peaks, rate, model),
        }
    )


def _choose_threshold(tail: extremes.PeakTail | None, target: float, model: Model) -> float:
    """Threshold for `target` false alarms an hour, natural logarithm of odds: the larger of the threshold by
    the tail and of factor times that by theory (`extremes.lorden_threshold`).

        other laws may fly    tail      factor
        no                    known     0
        no                    unknown   1 (no threshold by the tail)
        in moving air         any       1
        in still air          any       _LORDEN_FACTOR
    """
    factor = 1.0 if tail is None or model.vehicle.other_laws else 0.0
    if model.vehicle.other_laws and not model.vehicle.moving_air:
        factor = _LORDEN_FACTOR
    theoretical = factor * extremes.lorden_threshold(model.rate_hz, target)
    return max(extremes.threshold_for_rate(tail, target), theoretical) if tail is not None else theoretical


def _cross_validate(
    flights: Sequence[extremes.PeaksAndHours], target: float | None, model: Model
) -> Document:
    """Test of the threshold on parts left out: how many would have alarmed, each at the threshold that the
    others choose, and how often. Empty if there is no rate, if there is a single part, or if the others of a
    part have too few peaks.
    """
    tails = [extremes.fit_peak_tail([*flights[:i], *flights[i + 1 :]]) for i in range(len(flights))]
    if target is None or len(flights) < 2 or not all(tails):
        return {}
    pairs = zip(flights, tails, strict=True)
    counts = [int((peaks >= _choose_threshold(tail, target, model)).sum()) for (peaks, _), tail in pairs]
    return {
        "parts": len(flights),
        "minutes": 60.0 * sum(hours for _, hours in flights),
        "alarmed": sum(n > 0 for n in counts),
        "alarms": sum(counts),
    }


def _healthy_peaks(fold: Fold) -> extremes.PeaksAndHours:
    """The peaks of the alarm statistic in the healthy rows of a part left out, and the duration of these
    rows, h.

    p (n, H): probabilities of the hypotheses, of which the last is that nothing answers the commands; z (n,):
    evidence for a fault; rows: numbers of the rows in which something answers and no label shows a fault. The
    sum of the alarm restarts with each run of these rows.
    """
    bank = build_bank(fold.model)
    samples = fold.held_out.samples
    p = bank_posterior(samples, fold.model, bank)
    z = fault_evidence(p, bank)
    answers = p[:, -1] < NO_RESPONSE_LIMIT
    rows = np.flatnonzero(fold.held_out.is_usable & ~(samples.labels < 1.0).any(axis=1) & answers)
    runs = [page_cusum(z[rows[begin:end]], np.inf) for begin, end in runs_between(np.diff(rows) > 1)]
    peaks = np.concatenate([extremes.peaks_between_zeros(cusum) for cusum in runs])
    return peaks, len(rows) * samples.dt_s / 3600.0


def score_folds(parts: Parts, model: Model) -> tuple[list[Document], float]:
    """An entry with qualities and, with labels, score for each fold; and the posterior mass of the bounds,
    out of _CREDIBLE_MASSES, with which their mean share of contained labels is nearest to _COVERAGE_GOAL.
    Without labels: the usual mass.
    """
    entries = fold_qualities(parts, model)
    usual = model.settings.bounds
    coverage: list[list[float]] = []
    for entry, fold in zip(entries, held_out_folds(parts, model, None), strict=True):
        samples = fold.held_out.samples
        labels = np.where(fold.held_out.is_usable[:, None], samples.labels, np.nan)
        if np.isfinite(labels).all(axis=1).any():
            bank = build_bank(fold.model)
            p = bank_posterior(samples, fold.model, bank)
            scores = {
                mass: score_against_labels(rows_of_posterior(samples, fold.model, bank, p, mass), labels)
                for mass in (*_CREDIBLE_MASSES, usual)
            }
            entry["score"] = scores[usual]
            coverage.append([scores[mass]["held_by_bounds"] for mass in _CREDIBLE_MASSES])
    if not coverage:
        return entries, usual
    return entries, _CREDIBLE_MASSES[int(np.argmin(np.abs(np.mean(coverage, axis=0) - _COVERAGE_GOAL)))]
