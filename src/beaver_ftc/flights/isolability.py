"""What a flight can and cannot separate: from the model, the mixer and how much the commands moved.

Under a small loss of effectiveness d of group g the rates of a sample shift by -d s F_g. Its information is
F_g' R^-1 F_g a sample; what trim, gain and the other groups could explain as well is taken off (the Schur
complement). A loss shows once d^2 / 2 times the information gathered passes the odds against it before.
"""

from typing import Any

import numpy as np

from beaver_ftc.flights.bank import Bank, bank_of
from beaver_ftc.flights.model import Model
from beaver_ftc.flights.recording import Floats
from beaver_ftc.flights.regressors import build, group_indices
from beaver_ftc.flights.samples import Samples

HORIZONS_S = (5.0, 20.0, 60.0)
_ALIKE = 0.9


def statement(samples: Samples, model: Model) -> dict[str, Any]:
    """Which faults this flight can separate and which not, and the smallest loss that would show by when."""
    bank = bank_of(model)
    answers = _whitened(samples, model)
    return {
        "together": [_together(group) for group in model.groups if len(group) > 1],
        "groups": [
            {"surfaces": group, **_reach(answers, index, model, bank, samples.dt_s)}
            for index, group in enumerate(model.groups)
        ],
        "alike": _alike(answers, model),
        "columns_held_s": {name: round(age, 4) for name, age in samples.age_s.items()},
    }


def _whitened(samples: Samples, model: Model) -> Floats:
    """Each group's share of the rates in standard deviations of the noise, (n, G, 3)."""
    regressors = build(samples, group_indices(model), model.history, model.lags, scaled=False)
    _, _, response, noise = model.arrays()
    answers = np.einsum("ngl,glr->ngr", regressors.commands, response)[regressors.ok]
    whitened = np.linalg.solve(np.linalg.cholesky(noise), answers.reshape(-1, 3).T).T
    return np.asarray(whitened.reshape(answers.shape) * np.sqrt(model.settings.power))


def _together(group: list[str]) -> dict[str, Any]:
    return {
        "surfaces": group,
        "says": f"{', '.join(group)} get proportional commands while they are healthy: no fit of healthy "
        "flight tells their effects apart. A loss in any of them is named as all of them, and the "
        "effectiveness given is that of all together.",
    }


def _reach(answers: Floats, group: int, model: Model, bank: Bank, dt_s: float) -> dict[str, Any]:
    """Information a second about one group's effectiveness, and the smallest loss seen within some times."""
    if not len(answers):
        return {"information_per_s": 0.0, "smallest_loss": {f"{h:g}": None for h in HORIZONS_S}}
    own = float((answers[:, group] ** 2).sum(axis=1).mean()) / dt_s
    left = _conditional(answers, group) / dt_s
    odds = _odds_against(model, bank, group, dt_s)
    return {
        "information_per_s": own,
        "information_per_s_of_its_motion": left,
        "smallest_loss": {f"{horizon:g}": _smallest(own, odds, horizon) for horizon in HORIZONS_S},
        "smallest_loss_by_motion_alone": {
            f"{horizon:g}": _smallest(left, odds, horizon) for horizon in HORIZONS_S
        },
    }


def _conditional(answers: Floats, group: int) -> float:
    """Information a sample about one group that trim (a constant an axis) and other groups cannot explain."""
    n, groups, axes = answers.shape
    constant = np.tile(np.eye(axes), (n, 1))
    others = [answers[:, other].reshape(-1, 1) for other in range(groups) if other != group]
    nuisance = np.column_stack([constant, *others])
    target = answers[:, group].reshape(-1)
    rest = target - nuisance @ np.linalg.lstsq(nuisance, target, rcond=None)[0]
    return float(rest @ rest) / n


def _odds_against(model: Model, bank: Bank, group: int, dt_s: float) -> float:
    """Log odds that a change to one level of this group overcomes to raise the alarm."""
    settings = model.settings
    share = float(np.median(bank.weight[bank.faulty(group)]))
    change = settings.changes_per_hour * dt_s / 3600.0 * share
    return float(np.log(settings.alarm / (1.0 - settings.alarm)) - np.log(change))


def _smallest(information: float, odds: float, horizon_s: float) -> float | None:
    """The loss whose mean log likelihood passes the odds within the horizon; None where none does."""
    if information <= 0.0:
        return None
    loss = float(np.sqrt(2.0 * odds / (information * horizon_s)))
    return loss if loss <= 1.0 else None


def _alike(answers: Floats, model: Model) -> list[dict[str, Any]]:
    """Pairs of groups whose effects in this flight were nearly proportional."""
    pairs = []
    for a in range(len(model.groups)):
        for b in range(a + 1, len(model.groups)):
            one, other = answers[:, a].ravel(), answers[:, b].ravel()
            norms = float(np.sqrt((one @ one) * (other @ other)))
            cosine = float(one @ other) / max(norms, 1e-300)
            pairs.append(
                {
                    "surfaces": [model.groups[a], model.groups[b]],
                    "cosine": cosine,
                    "separable": abs(cosine) < _ALIKE,
                }
            )
    return pairs


def sentences(found: dict[str, Any]) -> list[str]:
    """The statement in words."""
    said = [entry["says"] for entry in found["together"]]
    for entry in found["groups"]:
        said.append(f"{', '.join(entry['surfaces'])}: {_loss_in_words(entry['smallest_loss'])}")
    for pair in found["alike"]:
        if not pair["separable"]:
            one, other = (" and ".join(names) for names in pair["surfaces"])
            said.append(
                f"In this flight the effects of {one} and of {other} were nearly proportional (cosine "
                f"{pair['cosine']:.2f}): one may be named for the other."
            )
    return said


def _loss_in_words(smallest: dict[str, float | None]) -> str:
    seen = [f"{loss:.0%} within {horizon} s" for horizon, loss in smallest.items() if loss is not None]
    if not seen:
        longest = list(smallest)[-1]
        return (
            f"not even a complete loss would show within {longest} s by the mean of this flight's commands."
        )
    return f"the smallest loss that shows on average is {', '.join(seen)}."
