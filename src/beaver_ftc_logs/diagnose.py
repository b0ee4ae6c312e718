"""Filter a recorded flight with a model: what broke, by how much, and how sure that is, sample by sample.

Everything a row says comes from samples up to its own time.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents import BadInput
from beaver_ftc_logs import energy, trust
from beaver_ftc_logs.bank import GROUP, Bank, bank_of
from beaver_ftc_logs.bank import UNKNOWN as UNKNOWN_OFFSET
from beaver_ftc_logs.filtering import accumulated, evidence, posterior_of
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import TINY, Floats
from beaver_ftc_logs.regression import by_surface, predicted
from beaver_ftc_logs.samples import Samples

_RATE_TOLERANCE = 0.25
UNKNOWN = "unknown"
_NAMED = 0.5
_MISNAMED = 0.001
"""Chance of a name without the surface at fault: a likelihood ratio of two groups passes 1000 against the
true one with that chance at most (Markov's inequality), where the model is right."""
_LATELY_S = 1.0
_STILL = 1e-6
"""Share of travel that a command moves by rounding alone."""
_IDLE = 0.5
"""Probability that nothing answers the commands above which nothing is said of any surface."""


@dataclass(frozen=True)
class Rows:
    """A row a sample.

    t_s (n,); faulty (n,) 0 or 1; named (n,) text; estimate, low, high (n, S) effectiveness of each surface;
    probability (n,) of a fault of any surface; credible (n,) 0 or 1, 1 where nothing else is given; since_s
    (n,) when the evidence for a fault began to gather, t_s where nothing else is given; reasons: rows that
    are not credible, by what is wrong.
    """

    t_s: Floats
    faulty: NDArray[np.int64]
    named: NDArray[np.object_]
    estimate: Floats
    low: Floats
    high: Floats
    probability: Floats
    credible: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    since_s: Floats = field(default_factory=lambda: np.empty(0))
    reasons: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len(self.since_s) != len(self.t_s):
            object.__setattr__(self, "since_s", self.t_s)
        if len(self.credible) != len(self.t_s):
            object.__setattr__(self, "credible", np.ones(len(self.t_s), dtype=np.int64))

    def unbounded(self, where: NDArray[np.bool_]) -> "Rows":
        """The rows with nothing said of effectiveness where (n,) or (n, S) is true."""
        here = where if where.ndim == 2 else where[:, None]
        return replace(
            self,
            estimate=np.where(here, 1.0, self.estimate),
            low=np.where(here, 0.0, self.low),
            high=np.where(here, 1.0, self.high),
        )

    def quiet(self, where: NDArray[np.bool_]) -> "Rows":
        """The rows without alarm and name where (n,) is true."""
        return replace(
            self,
            faulty=np.where(where, 0, self.faulty),
            named=np.where(where, "", self.named),
            probability=np.where(where, 0.0, self.probability),
        )

    def silent(self, reasons: Mapping[str, NDArray[np.bool_]]) -> "Rows":
        """The rows that say nothing where one of the reasons, (n,) each, is true."""
        gone = np.zeros(len(self.t_s), dtype=bool)
        for where in reasons.values():
            gone |= where
        rows = self.unbounded(gone).quiet(gone)
        return replace(rows, credible=np.where(gone, 0, 1), reasons=reasons)


def diagnose(samples: Samples, model: Model) -> Rows:
    """The diagnosis of each sample. Raises BadInput where the log's rate or unit is not the model's."""
    check_rate(samples, model)
    bank = bank_of(model)
    lived = trust.without_dead(samples, model)
    posterior, _, _ = posterior_of(lived, model, bank)
    still = posterior[:, bank.idle] > _IDLE
    rows = rows_of(samples, model, bank, posterior)
    if model.vehicle.other_laws and model.settings.threshold is not None and not model.colours:
        rows = _along(lived, model, rows, model.settings.threshold)
    return silenced(samples, model, rows, still)


def silenced(
    samples: Samples,
    model: Model,
    rows: Rows,
    still: NDArray[np.bool_] | None = None,
) -> Rows:
    """Rows at the log's own stamps, that say nothing where the model is not credible, and nothing of a group
    whose effect it does not know. still (n,): where nothing answers the commands."""
    reasons = trust.outside(samples, model)
    if still is not None and still.any():
        reasons["nothing answers the commands: on the ground, or these are not what it follows"] = still
    if not any(trust.claimed(model)):
        reasons["of no surface is the effect known from the flights fitted"] = np.ones(
            len(rows.t_s), dtype=bool
        )
    rows = _with_untold(samples, model, _without_power(samples, model, rows))
    told = np.array(trust.claimed(model), dtype=float)[None]
    unknown = np.broadcast_to(by_surface(told, model) == 0.0, rows.low.shape)
    return _at_stamps(samples, rows.unbounded(unknown).silent(reasons))


def _with_untold(samples: Samples, model: Model, rows: Rows) -> Rows:
    """Rows that name, with a surface, each whose effect the model cannot tell and that may be at fault in its
    place; bounds of a name of several hold where any one of them is at fault.

    A loss shows where a command moves: a surface that stands still in this flight is not named for it. A
    stuck one may be any.
    """
    surfaces = list(model.vehicle.surfaces)
    moved = np.maximum.accumulate(np.abs(samples.commands - samples.commands[:1]), axis=0) > _STILL
    moved |= "stuck" in model.vehicle.faults
    untold = trust.unclaimed(model)
    joins = moved & np.array([surface in untold for surface in surfaces])
    named, high = rows.named.copy(), rows.high.copy()
    for k in np.flatnonzero(rows.faulty == 1):
        given = set(str(named[k]).split("+"))
        if not given <= set(surfaces):
            continue
        members = np.array([one in given or bool(joins[k, i]) for i, one in enumerate(surfaces)])
        named[k] = "+".join(compress(surfaces, members))
        if members.sum() > len(given) or (model.settings.one_group and not _is_group(given, model)):
            high[k, members] = 1.0
    return replace(rows, named=named, high=high)


def _is_group(given: set[str], model: Model) -> bool:
    """Whether surfaces are one group of the model, which has one effectiveness."""
    return any(given <= set(group) for group in model.groups)


def _without_power(samples: Samples, model: Model, rows: Rows) -> Rows:
    """Rows in which no surface is named where an engine may have failed."""
    lowest = model.fitted.energy_climb if model.fitted is not None else None
    if lowest is None or samples.energy_climb is None:
        return rows
    climb = samples.energy_climb
    named = energy.renamed(rows.t_s, rows.faulty, rows.named, climb, lowest, rows.since_s)
    return replace(rows.unbounded(named != rows.named), named=named)


def _along(samples: Samples, model: Model, rows: Rows, asked: float) -> Rows:
    """Rows that name no group where what the last second left unexplained lies along another.

    Whatever a surface at fault does, be it stuck, biased or swinging, it does along the rates that it turns
    when it is healthy: a name is taken back where another direction, whatever the course of time along it,
    explains as much more as is asked. Not in moving air: gusts have directions, too.
    """
    rest = healthy_residual(model, *predicted(samples, model))
    _, _, response, noise = model.arrays()
    turned = np.linalg.solve(np.linalg.cholesky(noise), response.sum(axis=1).T)
    size = np.linalg.norm(turned, axis=0)
    along = (rest @ (turned / np.maximum(size, TINY))) ** 2
    total = np.cumsum(along, axis=0)
    begin = np.maximum(np.arange(len(total)) - round(_LATELY_S * model.rate_hz), 0)
    explained = 0.5 * model.settings.power * (total - total[begin])
    best, gone = explained.max(axis=1), np.zeros(len(rest), dtype=bool)
    for g, group in enumerate(model.groups):
        gone |= _of(rows.named, set(group)) & (best - explained[:, g] > asked)
    return replace(rows.unbounded(gone), named=np.where(gone, UNKNOWN, rows.named))


def healthy_residual(model: Model, ok: NDArray[np.bool_], unexplained: Floats, answers: Floats) -> Floats:
    """What a healthy vehicle leaves of what is `predicted`, in standard deviations of the noise, (n, 3); 0
    where nothing can be."""
    intercept, _, _, noise = model.arrays()
    rest = np.where(ok[:, None], unexplained - intercept - answers.sum(axis=1), 0.0)
    return np.asarray(rest @ np.linalg.inv(np.linalg.cholesky(noise)).T)


def _of(named: NDArray[np.object_], unclaimed: set[str]) -> NDArray[np.bool_]:
    """Which rows name a surface of which nothing is claimed."""
    return np.array([bool(unclaimed & set(name.split("+"))) for name in named], dtype=bool)


def check_rate(samples: Samples, model: Model) -> None:
    """Raise BadInput where a log's rate is not the model's."""
    rate_hz = 1.0 / samples.dt_s
    if abs(rate_hz / model.rate_hz - 1.0) > _RATE_TOLERANCE:
        raise BadInput(
            f"{samples.name}: has samples at {rate_hz:.3g} Hz, allowed: within {_RATE_TOLERANCE:.0%} of the "
            f"{model.rate_hz:.3g} Hz the model was identified at"
        )
    trust.check_units(samples, model.fitted)
    trust.check_columns(samples, model)


def rows_of(samples: Samples, model: Model, bank: Bank, posterior: Floats) -> Rows:
    """What the probabilities of the hypotheses (n, H) say of each sample."""
    idle = posterior[:, bank.idle]
    probability = posterior[:, bank.faults].sum(axis=1)
    answering = posterior[:, : bank.idle] / np.maximum(1.0 - idle, TINY)[:, None]
    well = posterior[:, 0] + idle > 0.5
    threshold = model.settings.threshold
    gained = evidence(posterior, bank)
    gathered = accumulated(gained, threshold or np.inf)
    raised = sure = _standing(probability >= model.settings.alarm, model)
    if threshold is not None:
        named_at = model.settings.name_evidence * threshold
        raised = (gathered >= threshold) & ~well
        sure = (accumulated(gained, named_at) >= named_at) & ~well
    faulty = _latched(raised, well).astype(np.int64)
    began = np.maximum.accumulate(np.where(gathered <= 0.0, np.arange(len(gathered)), 0))
    by_group = [_of_group(bank, answering, g, model) for g in range(len(model.groups))]
    estimate, low, high = (np.column_stack(part) for part in zip(*by_group, strict=True))
    still = idle > _IDLE
    estimate[still], low[still], high[still] = 1.0, 0.0, 1.0
    if model.vehicle.other_laws:  # health is not excluded before an alarm excludes it
        high[faulty == 0] = 1.0
    return Rows(
        t_s=samples.t_s,
        faulty=faulty,
        named=_names(model, bank, posterior, faulty, _latched(sure, well)),
        estimate=by_surface(estimate, model),
        low=by_surface(low, model),
        high=by_surface(high, model),
        probability=probability,
        since_s=samples.t_s[began],
    )


def _of_group(bank: Bank, posterior: Floats, group: int, model: Model) -> tuple[Floats, ...]:
    """A group's effectiveness and its bounds, (n,) each.

    Of several surfaces that move together any may have lost all, or nothing.
    """
    levels, mass = _marginal(bank, posterior, group)
    if model.vehicle.other_laws:  # how rare faults are says nothing of a flight with one: all levels alike
        mass = mass / _marginal(bank, bank.start[None, : bank.idle], group)[1]
        mass /= mass.sum(axis=1, keepdims=True)
    low, high = _bounds(levels, mass, model.settings.bounds)
    if len(model.groups[group]) > 1:
        low, high = np.where(low < low.max(initial=0.0), 0.0, low), np.ones_like(high)
    return _median(levels, mass), low, high


def _standing(raised: NDArray[np.bool_], model: Model) -> NDArray[np.bool_]:
    """Where a condition holds, and has held for long enough up to there."""
    reach = round(model.settings.hold_s * model.rate_hz)
    since = np.arange(len(raised)) - np.maximum.accumulate(np.where(raised, -1, np.arange(len(raised))))
    return np.asarray(raised & (since > reach))


def _latched(raised: NDArray[np.bool_], well: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """An alarm once raised stands until health is the likelier again."""
    order = np.arange(len(raised))
    last_raised = np.maximum.accumulate(np.where(raised, order, -1))
    last_well = np.maximum.accumulate(np.where(well & ~raised, order, -1))
    return np.asarray((last_raised >= 0) & (last_raised > last_well))


def _marginal(bank: Bank, posterior: Floats, group: int) -> tuple[Floats, Floats]:
    """A group's levels, the last of them 1, and the probability of each, (L,) and (n, L)."""
    levels, index = np.unique(bank.effectiveness[: bank.idle, group], return_inverse=True)
    mass = np.zeros((len(posterior), len(levels)))
    for hypothesis, level in enumerate(index):
        mass[:, level] += posterior[:, hypothesis]
    return levels, mass


def _median(levels: Floats, mass: Floats) -> Floats:
    """The level with half of the probability on either side: the least mean absolute error."""
    return np.asarray(levels[(np.cumsum(mass, axis=1) >= 0.5 - 1e-12).argmax(axis=1)])


def _bounds(levels: Floats, mass: Floats, share: float) -> tuple[Floats, Floats]:
    """The range of the fewest levels that hold a share of the probability, half a step wider each way."""
    order = np.argsort(-mass, axis=1, kind="stable")
    ranked = np.take_along_axis(mass, order, axis=1)
    inside = np.cumsum(ranked, axis=1) - ranked < share
    chosen = np.where(inside, levels[order], np.nan)
    low, high = np.nanmin(chosen, axis=1), np.nanmax(chosen, axis=1)
    edges = np.concatenate([[0.0], 0.5 * (levels[1:] + levels[:-1]), [1.0]])
    return edges[np.searchsorted(levels, low)], edges[np.searchsorted(levels, high) + 1]


def _names(
    model: Model, bank: Bank, posterior: Floats, faulty: NDArray[np.int64], sure: NDArray[np.bool_]
) -> NDArray[np.object_]:
    """The surfaces of the groups that most of the fault's probability is on; `unknown` where it is split.

    sure (n,): where the evidence is enough for a name. Where one group is at fault (`one_group`), each that
    may be instead is named with it; `unknown` where none that the bank has is left out.
    """
    total = np.maximum(posterior[:, bank.faults].sum(axis=1), TINY)
    shares = [posterior[:, bank.faulty(g)].sum(axis=1) / total for g in range(len(model.groups))]
    share = np.column_stack(shares)
    likelier = (share > _NAMED) & sure[:, None]
    if model.settings.one_group:
        single = bank.kind == GROUP
        alone = np.column_stack(
            [posterior[:, bank.faulty(g) & single].sum(axis=1) for g in range(len(model.groups))]
        )
        likelier = (alone > _MISNAMED * alone.max(axis=1, keepdims=True)) & sure[:, None]
        candidates = alone.max(axis=0) > 0.0
        likelier &= ~(likelier[:, candidates].all(axis=1) & (candidates.sum() > 1))[:, None]
    likely = joined(likelier, ["+".join(group) for group in model.groups])
    named = np.full(len(posterior), "", dtype=object)
    other = posterior[:, bank.kind == UNKNOWN_OFFSET].sum(axis=1) > total
    reach, stood = round(model.settings.rename_s * model.rate_hz), 0
    for k in np.flatnonzero(faulty):
        now, said = likely[k] or UNKNOWN, named[k - 1] if k else ""
        stood = stood + 1 if k and now == (likely[k - 1] or UNKNOWN) else 0
        # an offset of no known cause, or a name that has not stood, while the alarm does: nothing new
        keeps = said and (other[k] or (said != UNKNOWN and (stood < reach or _as_wide(now, said, model))))
        named[k] = said if keeps else now
    return named


def _as_wide(now: str, said: str, model: Model) -> bool:
    """Whether a name holds all that one before it held: what was once excluded stays so (Ville's inequality
    bounds the chance of a wrong exclusion over all time)."""
    return model.settings.one_group and (now == UNKNOWN or set(said.split("+")) <= set(now.split("+")))


def joined(flags: NDArray[np.bool_], names: Sequence[str]) -> NDArray[np.object_]:
    """The names that flags (n, K) stand for, joined by +, (n,) text."""
    return np.array(["+".join(compress(names, row)) for row in flags], dtype=object)


def _at_stamps(samples: Samples, rows: Rows) -> Rows:
    """The rows at the log's own stamps: each stamp has the last row up to it."""
    if len(samples.stamps) == len(rows.t_s) and np.array_equal(samples.stamps, rows.t_s):
        return rows
    last = np.maximum(np.searchsorted(rows.t_s, samples.stamps, side="right") - 1, 0)
    others = [name for name in Rows.__dataclass_fields__ if name not in ("t_s", "reasons")]
    reasons = {reason: rows_outside[last] for reason, rows_outside in rows.reasons.items()}
    fields = {name: getattr(rows, name)[last] for name in others}
    return Rows(t_s=samples.stamps, reasons=reasons, **fields)
