"""Which faults a flight can separate and which not, and the smallest loss that shows in it.

A loss of effectiveness d of group g changes the rates of a sample by -d F_g, so a sample has the information
F_g' F_g about d. `_own_information` is the part of it that neither trim nor other groups explain. On average,
a loss shows after the time T for which d^2 J T / 2 exceeds the log odds of `_alarm_odds`.

    F       response of each group in standard deviations of the noise, times the root of the information of a
            sample, `power` (n, G, 3), n samples, G groups
    J       information about one group, 1/s
    d, T    loss of effectiveness, and time in which it shows, s
"""

from itertools import combinations

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_logs.bank import HypothesisBank, build_bank
from beaver_ftc_logs.least_squares import left_by
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.regression import innovations
from beaver_ftc_logs.samples import Samples

DETECTION_HORIZONS_S = (5.0, 20.0, 60.0)  # values of T for which the smallest loss is stated
_ALIKE_COSINE = 0.9  # two effects with a larger cosine are not separable
# Sentence on a group of several surfaces.
_ONE_GROUP_NOTE = (
    "{} get proportional commands while they are healthy: no fit of healthy flight tells their effects "
    "apart. A loss in any of them is named as all of them, and the effectiveness given is that of all "
    "together."
)


def isolability_document(samples: Samples, model: Model) -> Document:
    """Which groups this flight can separate, and the smallest loss of each that would show within each of
    DETECTION_HORIZONS_S."""
    bank = build_bank(model)
    flight = innovations(samples, model)
    F = flight.F[flight.is_known] @ flight.W * np.sqrt(model.settings.power)
    return {
        "together": [
            {"surfaces": group, "says": _ONE_GROUP_NOTE.format(", ".join(group))}
            for group in model.groups
            if len(group) > 1
        ],
        "groups": [
            {"surfaces": group, **_group_entry(F, g, model, bank, samples.dt_s)}
            for g, group in enumerate(model.groups)
        ],
        "alike": _alike_pairs(F, model),
        "columns_held_s": {name: round(age_s, 4) for name, age_s in samples.held_age_s.items()},
    }


def _group_entry(F: Floats, g: int, model: Model, bank: HypothesisBank, dt_s: float) -> Document:
    """Information about one group's effectiveness, 1/s, and its smallest losses; both also by
    `_own_information` (`..._of_its_motion`, `..._by_motion_alone`)."""
    odds = _alarm_odds(model, bank, g, dt_s)
    if not len(F):
        return {"information_per_s": 0.0, "smallest_loss": _smallest_losses(0.0, odds)}
    J = float((F[:, g] ** 2).sum(axis=1).mean()) / dt_s
    J_own = _own_information(F, g) / dt_s
    return {
        "information_per_s": J,
        "information_per_s_of_its_motion": J_own,
        "smallest_loss": _smallest_losses(J, odds),
        "smallest_loss_by_motion_alone": _smallest_losses(J_own, odds),
    }


def _own_information(F: Floats, g: int) -> float:
    """Information of a sample about one group that neither trim (a constant for each axis) nor other groups
    explain: r' r / n, with the residual r of least squares of f_g on the regressors N."""
    n, G, _ = F.shape
    f = F.transpose(1, 0, 2).reshape(G, -1)
    N = np.column_stack([np.tile(np.eye(3), (n, 1)), *np.delete(f, g, axis=0)])
    r = left_by(N, f[g])
    return float(r @ r) / n


def _alarm_odds(model: Model, bank: HypothesisBank, g: int, dt_s: float) -> float:
    """Log odds that the evidence for a loss of this group must exceed to raise the alarm; inf if the bank has
    no such loss:

        without a threshold     log(alarm / (1 - alarm)) - log(p)
        with the threshold mu   max(mu - log(share / sum of the shares of all faults), -log(p))

    share: median transition share of the hypotheses in which this group loses effectiveness; p: probability
    that a sample begins a loss that has this share. Page's sum counts the evidence for any fault; besides, an
    alarm needs a fault that is likelier than health (`posterior_rows.rows_of_posterior`).
    """
    settings = model.settings
    shares = bank.transition_share[bank.is_fault_of_group(g)]
    if not len(shares):
        return float("inf")
    share = np.median(shares)
    log_p = np.log(settings.changes_per_hour * dt_s / 3600.0 * share)
    if settings.threshold is None:
        return float(np.log(settings.alarm / (1.0 - settings.alarm)) - log_p)
    all_shares = bank.transition_share[bank.is_fault_hypothesis].sum()
    return float(max(settings.threshold - np.log(share / all_shares), -log_p))


def _smallest_losses(J: float, odds: float) -> dict[str, float | None]:
    """The smallest loss d with d^2 J T / 2 >= odds, for each T in s; None if not even d = 1 is enough."""
    losses: dict[str, float | None] = {}
    for T in DETECTION_HORIZONS_S:
        d = float(np.sqrt(2.0 * odds / max(J * T, MIN_DIVISOR)))
        losses[f"{T:g}"] = d if d <= 1.0 else None
    return losses


def _alike_pairs(F: Floats, model: Model) -> list[Document]:
    """Each pair of groups with the cosine between their effects in this flight, f_g.f_h / |f_g| |f_h|, and
    whether it is far enough from +-1 to distinguish the two. F (n, G, 3)."""
    pairs = []
    for g, h in combinations(range(len(model.groups)), 2):
        f_g = F[:, g].ravel()
        f_h = F[:, h].ravel()
        cosine = float(f_g @ f_h) / max(float(np.sqrt((f_g @ f_g) * (f_h @ f_h))), MIN_DIVISOR)
        surfaces = [model.groups[g], model.groups[h]]
        pairs.append({"surfaces": surfaces, "cosine": cosine, "separable": abs(cosine) < _ALIKE_COSINE})
    return pairs


def isolability_sentences(isolable: Document) -> list[str]:
    """The sentences of `isolability_document`."""
    lines = [entry["says"] for entry in isolable["together"]]
    for entry in isolable["groups"]:
        lines.append(f"{', '.join(entry['surfaces'])}: {_smallest_loss_text(entry['smallest_loss'])}")
    for pair in isolable["alike"]:
        if not pair["separable"]:
            first, second = (" and ".join(names) for names in pair["surfaces"])
            lines.append(
                f"In this flight the effects of {first} and of {second} were "
                f"nearly proportional (cosine {pair['cosine']:.2f}): one may be named for the other."
            )
    return lines


def _smallest_loss_text(losses: dict[str, float | None]) -> str:
    """Words for the smallest loss of a group within each horizon."""
    texts = [f"{loss:.0%} within {horizon} s" for horizon, loss in losses.items() if loss is not None]
    if not texts:
        within = f"within {DETECTION_HORIZONS_S[-1]:g} s by the mean of this flight's commands"
        return f"not even a complete loss would show {within}."
    return f"the smallest loss that shows on average is {', '.join(texts)}."
