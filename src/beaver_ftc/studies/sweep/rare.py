"""The probability that an expectation is not met, if this is so rare that a sweep would need a million
flights.

Subset simulation (subset_simulation.py) in the space of standard normals u (keys,). A varied key has the
value of its distribution at Phi(u). Each step of a chain has a new seed of the flight, so that errors of
sensors and air vary, too.
"""

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import NormalDist

import numpy as np

from beaver_ftc.documents.errors import BadInput, BeaverFtcError, SimulationFailed, say_once, suggestion
from beaver_ftc.documents.files import Document
from beaver_ftc.results.expectations import expected_of
from beaver_ftc.results.log import Columns
from beaver_ftc.results.metrics import as_json, measure, versions
from beaver_ftc.scenario.dump import to_yaml
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sweeps import Sweep
from beaver_ftc.studies.engine.statistics import CONFIDENCE
from beaver_ftc.studies.engine.study import FlyRound, Study
from beaver_ftc.studies.present.tables import all_finite, number, values_of
from beaver_ftc.studies.sweep.one_flight import scenario_of, warm_up
from beaver_ftc.studies.sweep.sampling import MAX_U, Assignment, values_at
from beaver_ftc.studies.sweep.store import identity_of
from beaver_ftc.studies.sweep.subset_simulation import MEMBERS, RUNS, Chains, Scores

_BEFORE = -1e-12  # largest score of a flight that meets the expectation
NO_EVENT: Document = {"score": -math.inf}  # row of a flight that cannot be flown
_NORMAL = NormalDist()


def scored(sweep: Sweep) -> list[str]:
    """The expectations of the base scenario of a sweep that have a score: the first two of `score_of`, and
    limits."""
    return [
        name
        for name, expected in expected_of(sweep.scenario({}).expect)
        if (name in ("no_departure", "no_false_alarm") and expected is True)
        or (isinstance(expected, float | int) and not isinstance(expected, bool))
    ]


def check(sweep: Sweep, expectation: str) -> None:
    """Raise BadInput unless the base scenario has this expectation with a score, and a key varies."""
    names = scored(sweep)
    if expectation not in names:
        allowed = suggestion(expectation, names) if names else ", allowed: a base scenario with `expect`"
        raise BadInput(f"--rare: {expectation[:60]!r} is nothing that {sweep.name} expects{allowed}")
    if not sweep.keys:
        raise BadInput(f"{sweep.name}: vary: nothing varies, allowed with --rare: at least one key")


def score_of(scenario: Scenario, expectation: str) -> float:
    """Fly a scenario, and return a score that rises towards a failure of the expectation:

        expectation              score
        no_departure             max |signal| / limit - 1, of all signals and frames
        no_false_alarm           max |residual| / threshold - 1 in healthy flight; a statistical detector has
                                 score / alarm level in place of this ratio if it is larger
        a number                 |actual| / expected - 1, or |actual| if 0 is expected
        the same, not reached    time from the first fault, or else the start, to the end, s

    The score is then limited, below 0 if the expectation is met, else to 0 or more.
    """
    from beaver_ftc.loop.loop import fly
    from beaver_ftc.plant.sensing import DEPARTURE_LIMITS

    log = Columns(*DEPARTURE_LIMITS) if expectation == "no_departure" else None
    flight = fly(scenario, log)
    metrics = measure(flight)
    result = next(candidate for candidate in metrics.expectations if candidate.name == expectation)
    if log is not None:
        shares = (np.abs(log[name]).max() / limit for name, limit in DEPARTURE_LIMITS.items())
        score = float(max(shares)) - 1.0
    elif expectation == "no_false_alarm":
        score = flight.worst_residual_ratio - 1.0
    elif result.actual is not None:
        score = abs(result.actual) / result.expected - 1.0 if result.expected else abs(result.actual)
    else:
        score = max(0.0, flight.frames / scenario.rate_hz - (metrics.fault.at_s if metrics.fault else 0.0))
    return min(score, _BEFORE) if result.passed else max(score, 0.0)


@dataclass(frozen=True)
class Event:
    """The event that a flight of a sweep does not meet an expectation. A point (keys,) has a standard normal
    number for each varied key."""

    sweep: Sweep
    expectation: str

    @property
    def name(self) -> str:
        """The name of the result folder."""
        return f"{self.sweep.name}-rare-{self.expectation.replace('.', '-')}"

    def values_at(self, point: Sequence[float]) -> Document:
        """The values of the varied keys at a point."""
        return values_at(self.sweep.file.vary.items(), (min(_NORMAL.cdf(u), MAX_U) for u in point))

    def fly(self, case: tuple[int, Sequence[float]]) -> Document:
        """The row of a flight. case: its number, which determines the seed, and its point."""
        run, point = case
        try:
            scenario = scenario_of(self.sweep, Assignment(run, self.values_at(point)))
            return {"score": score_of(scenario, self.expectation)}
        except BeaverFtcError:
            return NO_EVENT

    def lost(self, case: object, why: str) -> Document:
        """The row of a flight that ends its process."""
        say_once(f"{self.name}: of a flight {why}; such flights count as no event")
        return NO_EVENT

    def rounds(self, fly_round: FlyRound, tell: Callable[[str], None]) -> Document:
        """Fly the chains and return the document. Raises SimulationFailed if no flight of the first round can
        be flown."""
        chains = Chains(len(self.sweep.keys), self.sweep.file.seed)

        def fly(points: np.ndarray) -> Scores:
            """Fly the points of a round; return their scores."""
            rows = fly_round([(chains.flights + i, point.tolist()) for i, point in enumerate(points)])
            scores = np.array(values_of(rows, "score"))
            if not chains.flights and np.isneginf(scores).all():
                raise SimulationFailed(f"{self.sweep.name}: no flight could be flown")
            tell(f"{self.name}: {chains.flights + len(rows)} flights, level {chains.levels}")
            return scores

        chains.go(fly)
        return self.document(chains)

    def document(self, chains: Chains) -> Document:
        """The content of rare.json."""
        estimate = chains.estimate()
        plain = all_finite(estimate.pop("plain"))
        likeliest = None
        if chains.design is not None:
            distance, run, point = chains.design
            likeliest = {"run": run, "distance": distance, "values": self.values_at(point.tolist())}
        return {
            "sweep": self.sweep.name, "expectation": self.expectation, "confidence": CONFIDENCE,
            **all_finite(estimate), "plain": plain,
            "failed": chains.failed, "likeliest": likeliest,
            "sweep_sha256": hashlib.sha256(repr(self.sweep.file).encode()).hexdigest(),
            "versions": dict(versions()),
        }  # fmt: skip

    def likeliest(self, document: Document) -> str | None:
        """The content of flight.yaml: the scenario of the likeliest event that was flown, the one nearest to
        the origin; None without an event."""
        event = document["likeliest"]
        return event and to_yaml(scenario_of(self.sweep, Assignment(event["run"], event["values"])))


def rare_study(sweep: Sweep, expectation: str, tell: Callable[[str], None] = lambda _: None) -> Study:
    """The probability that a sweep's flights do not meet an expectation of its base scenario.

    tell: takes a line of progress after each round. Raises BadInput if the base does not expect this, or if
    no key varies.
    """
    check(sweep, expectation)
    event = Event(sweep, expectation)
    # no cases of its own: `rounds` makes them, and returns the document
    return Study(
        event.name, cases=(), fly=event.fly, document=dict,
        files={"rare.json": as_json, "flight.yaml": event.likeliest},
        follows_from=[identity_of(sweep, expectation), RUNS, MEMBERS], lost=event.lost,
        warm_up=partial(warm_up, sweep), rounds=partial(event.rounds, tell=tell),
    )  # fmt: skip


def as_text(document: Document) -> str:
    """The document for a terminal."""
    plain = document["plain"]
    likeliest = document["likeliest"]
    p = document["probability"]
    text = f"not known: {document['why']}" if p is None else f"{p:.2g}"
    lines = [
        "{sweep}: {expectation} not met".format(**document),
        f"  probability  {text}, {_interval(document)}, {document['flights']} flights",
        f"  plain        {plain['events']} of {plain['of']} flights, {_interval(plain)}",
    ]
    if document["failed"]:
        lines.append(f"  not flown    {document['failed']} flights, counted as no event")
    if likeliest:
        listed = ", ".join(f"{key} {number(value, digits=4)}" for key, value in likeliest["values"].items())
        lines += [
            f"  likeliest    {listed}",
            f"  flies it     beaver-ftc run {document['folder']}/flight.yaml",
        ]
    return "\n".join([*lines, f"\nresults: {document['folder']}"])


def _interval(values: Document) -> str:
    """The interval of a probability."""
    return "95 % {low:.2g} to {high:.2g}".format(**values)
