"""The probability that an expectation is not met, where plain flights would take a million to see it once.

Subset simulation [AuBeck2001]: levels of a score that rises towards the event, each reached by a tenth of the
flights that reached the one before; these are continued as Markov chains in the space of standard normals
behind the varied keys, by conditional sampling [Papaioannou2015]. A step draws the flight's own seed again,
so sensors and air are part of the chain. It is done in independent runs: their mean is the estimate, and what
they differ by the interval, that of a lognormal mean [Cox, in Land1972].
"""

import hashlib
import math
from collections.abc import Callable, Sequence
from functools import partial
from statistics import NormalDist

import numpy as np

from beaver_ftc.documents.errors import BadInput, BeaverFtcError, SimulationFailed, say_once, suggestion
from beaver_ftc.documents.files import Document
from beaver_ftc.results.expectations import expected_of
from beaver_ftc.results.log import Columns
from beaver_ftc.results.metrics import as_json, measure, versions
from beaver_ftc.scenario.builtin import to_yaml
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sweeps import Sweep
from beaver_ftc.studies.engine.draws import generator_of
from beaver_ftc.studies.engine.statistics import CONFIDENCE, binomial
from beaver_ftc.studies.engine.study import FlyRound, Study
from beaver_ftc.studies.present.tables import all_finite, number
from beaver_ftc.studies.sweep.one_flight import scenario_of, warm_up
from beaver_ftc.studies.sweep.sampling import OF_RARE, Assignment, values_at
from beaver_ftc.studies.sweep.store import identity_of

RUNS = 8  # independent runs
MEMBERS = 220  # flights of each run a level: 10^-5 by a hundredth of 10^6 flights
SHARE = 0.1  # of the flights of a level that reach the next one
STEP = 0.8  # how much of a point a chain's next one keeps
MOST_LEVELS = 10  # down to 10^-10
_BEFORE = -1e-12  # the score of what has just not happened
_NORMAL = NormalDist()

Scores = np.ndarray
FlyPoints = Callable[[np.ndarray], Scores]
"""From a round's points (flights, keys), standard normals, to scores (flights,); events from 0."""


class Chains:
    """Independent runs of subset simulation abreast: points (runs, members, keys), scores (runs, members).

    share (runs,): probability of the level that a run has reached, the product of its shares so far. reached
    (runs,): whether that is the event. stuck: whether a run cannot go on. flights, levels: how many so far.
    plain: events and flights of the first round. design: of the likeliest event its distance, flight, point.
    """

    def __init__(self, keys: int, seed: int, runs: int = RUNS, members: int = MEMBERS) -> None:
        self._generator = generator_of(seed, 0, 0, OF_RARE)
        self.points = self._generator.standard_normal((runs, members, keys))
        self.scores = np.full((runs, members), -math.inf)
        self.share = np.ones(runs)
        self.reached = np.zeros(runs, bool)
        self.stuck = False
        self.flights = 0
        self.levels = 0
        self.design: tuple[float, int, np.ndarray] | None = None

    def go(self, fly: FlyPoints) -> None:
        """Fly until every run has reached the event, or cannot."""
        self.scores[:] = self._flown(fly, self.points)
        self.plain = int((self.scores >= 0.0).sum()), self.scores.size
        while True:
            going = [run for run in range(len(self.scores)) if not self.reached[run]]
            levels = {run: self._level(run) for run in going}
            going = [run for run in going if not self.reached[run]]
            if not going or self.stuck or self.levels == MOST_LEVELS:
                break
            self.levels += 1
            self._continue(going, np.array([levels[run] for run in going]), fly)

    def _level(self, run: int) -> float:
        """The next level of a run, whose share of flights goes into its probability."""
        scores = self.scores[run]
        level = float(np.sort(scores)[-max(1, round(SHARE * scores.size))])
        if not math.isfinite(level):  # too few have a score: nothing is known below the level before
            self.stuck = True
            return level
        level, self.reached[run] = min(level, 0.0), level >= 0.0
        share = float((scores >= level).mean())
        self.stuck |= share == 1.0 and not self.reached[run]  # all alike: nothing leads on
        self.share[run] *= share
        return level

    def _continue(self, going: list[int], levels: np.ndarray, fly: FlyPoints) -> None:
        """Chains from the flights that reached their level, all runs abreast."""
        members = self.scores.shape[1]
        seeds = max(1, round(SHARE * members))
        at = np.array([
            self._generator.choice(np.flatnonzero(self.scores[run] >= level), seeds, replace=False)
            for run, level in zip(going, levels, strict=True)
        ])  # fmt: skip
        rows = np.array(going)[:, None]
        here = self.points[rows, at]
        scores = self.scores[rows, at]
        kept = [here]
        values = [scores]
        for _ in range(math.ceil(members / seeds) - 1):
            moved = STEP * here + math.sqrt(1.0 - STEP**2) * self._generator.standard_normal(here.shape)
            found = self._flown(fly, moved)
            better = found >= levels[:, None]
            here = np.where(better[..., None], moved, here)
            scores = np.where(better, found, scores)
            kept.append(here)
            values.append(scores)
        self.points[going] = np.concatenate(kept, axis=1)[:, :members]
        self.scores[going] = np.concatenate(values, axis=1)[:, :members]

    def _flown(self, fly: FlyPoints, points: np.ndarray) -> Scores:
        flat = points.reshape(-1, points.shape[-1])
        scores = fly(flat)
        for i in np.flatnonzero(scores >= 0.0).tolist():
            distance = float(np.linalg.norm(flat[i]))
            if self.design is None or distance < self.design[0]:
                self.design = distance, self.flights + i, flat[i].copy()
        self.flights += len(flat)
        return scores.reshape(points.shape[:-1])

    def estimate(self) -> Document:
        """The result of the runs: a probability with its two-sided interval; why: the reason if it is not
        known."""
        events, of = self.plain
        probability, low, high = math.nan, 0.0, float(self.share.max())
        why = ""
        if self.reached.all():
            probability, low, high = lognormal_mean(self.share)
        else:
            why = "the score stops rising before the event" if self.stuck else "too rare for so many levels"
        return {
            "probability": probability, "low": low, "high": high,
            "flights": self.flights, "levels": self.levels,
            "plain": {"events": events, "of": of, **vars(binomial(events, of))}, "why": why,
        }  # fmt: skip


def lognormal_mean(values: np.ndarray) -> tuple[float, float, float]:
    """Mean of some lognormal values (n,) and its two-sided interval, Cox's with Student's t."""
    from scipy.stats import t

    logs = np.log(values)
    spread = float(logs.var(ddof=1))
    n = len(values)
    half = float(t.ppf(0.5 + 0.5 * CONFIDENCE, n - 1)) * math.sqrt(spread / n + spread**2 / (2 * (n - 1)))
    middle = float(logs.mean()) + 0.5 * spread
    return float(values.mean()), math.exp(middle - half), min(1.0, math.exp(middle + half))


def scored(sweep: Sweep) -> list[str]:
    """The expectations of a sweep's base scenario whose failure has a score that rises towards it."""
    return [
        name
        for name, expected in expected_of(sweep.scenario({}).expect)
        if (name in ("no_departure", "no_false_alarm") and expected is True)
        or (isinstance(expected, float | int) and not isinstance(expected, bool))
    ]


def check(sweep: Sweep, expectation: str) -> None:
    """Raise BadInput unless the base scenario expects this, it can be scored, and something varies."""
    known = scored(sweep)
    if expectation not in known:
        allowed = suggestion(expectation, known) if known else ", allowed: a base scenario with `expect`"
        raise BadInput(f"--rare: {expectation[:60]!r} is nothing that {sweep.name} expects{allowed}")
    if not sweep.keys:
        raise BadInput(f"{sweep.name}: vary: nothing varies, allowed with --rare: at least one key")


def score_of(scenario: Scenario, expectation: str) -> float:
    """Fly, and say how near it came to what is not expected: below 0 before, 0 and above once it has come."""
    from beaver_ftc.loop.loop import fly
    from beaver_ftc.plant.sensing import DEPARTURE_LIMITS

    log = Columns(*DEPARTURE_LIMITS) if expectation == "no_departure" else None
    flight = fly(scenario, log)
    amounts = measure(flight)
    found = next(one for one in amounts.expectations if one.name == expectation)
    if log is not None:
        shares = (np.abs(log[name]).max() / limit for name, limit in DEPARTURE_LIMITS.items())
        score = float(max(shares)) - 1.0
    elif expectation == "no_false_alarm":
        score = flight.worst_residual_ratio - 1.0
    elif found.actual is not None:
        score = abs(found.actual) / found.expected - 1.0 if found.expected else abs(found.actual)
    else:  # it never came: the later it could have, the worse
        score = max(0.0, flight.frames / scenario.rate_hz - (amounts.fault.at_s if amounts.fault else 0.0))
    return min(score, _BEFORE) if found.passed else max(score, 0.0)


def values_of(sweep: Sweep, point: Sequence[float]) -> Document:
    """The varied keys at a point of standard normals."""
    return values_at(sweep.file.vary.items(), (min(_NORMAL.cdf(u), 1.0 - 2.0**-53) for u in point))


def scenario_at(sweep: Sweep, run: int, point: Sequence[float]) -> Scenario:
    """The flight at a point of standard normals; its number gives its seed."""
    return scenario_of(sweep, Assignment(run, values_of(sweep, point)))


def _fly(sweep: Sweep, expectation: str, case: tuple[int, list[float]]) -> Document:
    """The row of one flight; one that cannot be flown is no event."""
    try:
        return {"score": score_of(scenario_at(sweep, *case), expectation), "failed": False}
    except BeaverFtcError:
        return {"score": -math.inf, "failed": True}


def rare_study(sweep: Sweep, expectation: str, tell: Callable[[str], None] = lambda _: None) -> Study:
    """The probability that a sweep's flights do not meet an expectation of its base scenario.

    tell: told how far it has come. Raises BadInput for what the base does not expect; flown, SimulationFailed
    if no flight could be.
    """
    check(sweep, expectation)
    name = f"{sweep.name}-rare-{expectation.replace('.', '-')}"

    def rounds(flies: FlyRound) -> Document:
        chains = Chains(len(sweep.keys), sweep.file.seed)
        failed = 0

        def fly(points: np.ndarray) -> Scores:
            nonlocal failed
            rows = flies([(chains.flights + i, point.tolist()) for i, point in enumerate(points)])
            failed += sum(row["failed"] for row in rows)
            if not chains.flights and failed == len(rows):
                raise SimulationFailed(f"{sweep.name}: no flight could be flown")
            tell(f"{name}: {chains.flights + len(rows)} flights, level {chains.levels}")
            return np.array([row["score"] for row in rows])

        chains.go(fly)
        return _document(sweep, expectation, chains, failed)

    def likeliest(document: Document) -> str | None:
        """The scenario of the likeliest event that was flown."""
        found = document["likeliest"]
        return found and to_yaml(scenario_of(sweep, Assignment(found["run"], found["values"])))

    def lost(case: object, why: str) -> Document:
        say_once(f"{name}: of a flight {why}; such flights count as no event")
        return {"score": -math.inf, "failed": True}

    return Study(
        name, (), partial(_fly, sweep, expectation), dict, {"rare.json": as_json, "flight.yaml": likeliest},
        follows_from=[identity_of(sweep, expectation), RUNS, MEMBERS], lost=lost,
        warm_up=partial(warm_up, sweep), rounds=rounds,
    )  # fmt: skip


def _document(sweep: Sweep, expectation: str, chains: Chains, failed: int) -> Document:
    found = chains.estimate()
    plain = all_finite(found.pop("plain"))
    likeliest = None
    if chains.design is not None:
        distance, run, point = chains.design
        likeliest = {"run": run, "distance": distance, "values": values_of(sweep, point.tolist())}
    return {
        "sweep": sweep.name, "expectation": expectation, "confidence": CONFIDENCE,
        **all_finite(found), "plain": plain,
        "failed": failed, "likeliest": likeliest,
        "sweep_sha256": hashlib.sha256(repr(sweep.file).encode()).hexdigest(), "versions": dict(versions()),
    }  # fmt: skip


def as_text(document: Document) -> str:
    """For a terminal."""
    plain = document["plain"]
    likeliest = document["likeliest"]
    p = document["probability"]
    said = f"{p:.2g}" if p is not None else f"not known: {document['why']}"
    lines = [
        f"{document['sweep']}: {document['expectation']} not met",
        f"  probability  {said}, {_between(document)}, {document['flights']} flights",
        "  plain        {events} of {of} flights, ".format(**plain) + _between(plain),
    ]
    if document["failed"]:
        lines.append(f"  not flown    {document['failed']} flights, counted as no event")
    if likeliest:
        values = likeliest["values"].items()
        listed = ", ".join(f"{key} {number(value, digits=4)}" for key, value in values)
        lines += [
            f"  likeliest    {listed}",
            f"  flies it     beaver-ftc run {document['folder']}/flight.yaml",
        ]
    return "\n".join([*lines, f"\nresults: {document['folder']}"])


def _between(found: Document) -> str:
    return "95 % {low:.2g} to {high:.2g}".format(**found)
