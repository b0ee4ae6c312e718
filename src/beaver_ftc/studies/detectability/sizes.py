"""The flights that show the smallest loss that is detected in time, and what limits it.

A flight is the scenario without its own faults, with a loss of one surface. Seed and begin of the loss are
random; its size is given. The loss begins after SETTLED_S, when the references have settled, and early enough
for the requested time to pass before the end.

    found      an alarm within the requested time
    certain    within this time, detection is guaranteed (`guaranteed_delay_s` of the metrics)

The variants of the scenario (variants.py) have the same flights with one change.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from beaver_ftc.documents.errors import BadInput, BeaverFtcError
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.metrics import measure, versions
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.instants import TIME_TOLERANCE_S
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.detectability import sizes_shown
from beaver_ftc.studies.detectability.certain import SETTLED_S
from beaver_ftc.studies.detectability.shown import NAME
from beaver_ftc.studies.detectability.thresholds import LARGEST, STAGES, size_for_all, threshold
from beaver_ftc.studies.detectability.variants import AS_IT_IS, variants_of
from beaver_ftc.studies.engine.draws import loss
from beaver_ftc.studies.engine.statistics import CONFIDENCE, counted, or_never
from beaver_ftc.studies.engine.study import FlyRound, Study
from beaver_ftc.studies.present.tables import finite, sum_of, values_of

SHARE = 0.9  # of the flights in which a loss of the size is found
FIRST = STAGES[:1]  # number of flights of a comparison, and of the size that is certain


@dataclass(frozen=True)
class Request:
    """The request. surface: loses effectiveness. within_s: longest time from the loss to the alarm, s. seed:
    of all random draws."""

    surface: str
    within_s: float
    seed: int = 1


class Flight(NamedTuple):
    """One flight: name of the variant, number of the draw, and size of the loss, per cent."""

    variant: str
    run: int
    size: int


@dataclass
class _Flown:
    """The rows of the flights of all variants so far; each flight is flown once. fly: flies a round. tell:
    takes a line of progress with the variant of the round and the number of rows."""

    fly: FlyRound
    tell: Callable[[str], None]
    rows: dict[Flight, Document] = field(default_factory=dict)

    def rows_of(self, variant: str, runs: Sequence[int], size: int) -> list[Document]:
        """The rows of these flights; those that are missing are flown."""
        flights = [Flight(variant, run, size) for run in runs]
        missing = [flight for flight in flights if flight not in self.rows]
        if missing:
            self.rows.update(zip(missing, self.fly(missing), strict=True))
            self.tell(f"{variant}: {len(missing)} more flights")
        return [self.rows[flight] for flight in flights]

    def flags_of(self, variant: str, key: str, runs: Sequence[int], size: int) -> list[bool]:
        """The flag `key` of each of these flights."""
        return values_of(self.rows_of(variant, runs, size), key)


def sizes_study(scenario: Scenario, request: Request, tell: Callable[[str], None]) -> Study:
    """The study of a scenario and surface. tell: takes a line for each round. Raises BadInput for a scenario
    that cannot answer the request."""
    check(scenario, request)
    variants = dict(variants_of(scenario, request.surface))
    return Study(
        f"{scenario.name[:70]}-{NAME}-{request.surface}", cases=(), fly=partial(fly_one, variants, request),
        document=dict, files=sizes_shown.FILES, follows_from=[scenario, request],
        lost=lambda flight, why: _row(failed=True),
        rounds=lambda fly: _document(scenario, request, variants, _Flown(fly, tell)),
    )  # fmt: skip


def check(scenario: Scenario, request: Request) -> None:
    """Raise BadInput if the surface is unknown, nothing is diagnosed, or the flight is too short."""
    surfaces = scenario.airframe.surfaces
    if request.surface not in surfaces:
        raise BadInput(f"--surface {request.surface!r:.60}: allowed: {', '.join(surfaces)}")
    if scenario.fdi.scheme == "none":
        raise BadInput(f"{scenario.name}: fdi.scheme: none diagnoses nothing, allowed: a scheme")
    shortest_s = SETTLED_S + 2.0 * request.within_s  # the begins are then spread over at least within_s
    if scenario.duration_s < shortest_s:
        raise BadInput(
            f"{scenario.name}: duration_s: too short for --within, allowed: {shortest_s:g} or more"
        )


def fly_one(variants: dict[str, Scenario], request: Request, flight: Flight) -> Document:
    """The row of a flight, which ends two frames after the requested time or with the scenario. bound_used:
    largest |residual| / threshold of all filters before the loss."""
    scenario = variants[flight.variant]
    draws = np.random.default_rng([request.seed, flight.run])
    seed = int(draws.integers(2**31))
    frames = round(draws.uniform(SETTLED_S, scenario.duration_s - request.within_s) * scenario.rate_hz)
    at_s = frames / scenario.rate_hz
    fault = loss(request.surface, flight.size / LARGEST, at_s)
    faulted = scenario.with_({"seed": seed, "faults": [fault], "expect": {}})
    end_s = min(at_s + request.within_s + 2.0 / scenario.rate_hz, scenario.duration_s)
    try:
        landing = fly(faulted.model_copy(update={"duration_s": end_s}))
        metrics = measure(landing)
    except BeaverFtcError:
        return _row(failed=True)
    within_s = request.within_s + TIME_TOLERANCE_S
    detection = metrics.detection
    return _row(
        found=or_never(detection.delay_s) <= within_s,
        certain=or_never(detection.guaranteed_delay_s) <= within_s,
        false_alarm=metrics.false_alarm,
        inconclusive=detection.inconclusive.reasons[0]["says"] if detection.inconclusive else None,
        bound_used=max(landing.closest_approach, default=0.0),
    )


def _row(**fields: Any) -> Document:
    """The row of a flight. Flags that are not given are False."""
    flags = dict.fromkeys(("found", "certain", "false_alarm", "failed"), False)
    return {**flags, "inconclusive": None, "bound_used": 0.0, **fields}


def _document(scenario: Scenario, request: Request, variants: dict[str, Scenario], flown: _Flown) -> Document:
    """Fly all variants; the answer for the scenario as it is, and under `compared` those for the others.
    inconclusive, bound_used: of the flights of the scenario as it is."""
    answer = _answer(AS_IT_IS, flown, STAGES)
    compared = [_answer(name, flown, FIRST) for name in variants if name != AS_IT_IS]
    rows = [row for flight, row in flown.rows.items() if flight.variant == AS_IT_IS]
    reasons = sorted({row["inconclusive"] for row in rows} - {None})
    return {
        "scenario": scenario.name,
        "surface": request.surface,
        "type": "loss_of_effectiveness",
        "within_s": request.within_s,
        "share": SHARE,
        "confidence": CONFIDENCE,
        "seed": request.seed,
        **answer,
        "compared": compared,
        "inconclusive": reasons,
        "bound_used": float(np.median(values_of(rows, "bound_used"))),
        "flights_flown": len(flown.rows),
        "versions": dict(versions()),
    }


def _answer(variant: str, flown: _Flown, stages: Sequence[int]) -> Document:
    """The answer for one variant: the sizes that are found and certain, as shares of the effectiveness (null:
    not even a total loss), and the results of a total loss. stages: as in `threshold`."""
    found_size = threshold(partial(flown.flags_of, variant, "found"), SHARE, stages)
    certain_size = size_for_all(partial(flown.flags_of, variant, "certain"), stages[0])
    total = flown.rows_of(variant, range(found_size.flights), LARGEST)
    n_certain = sum(flown.flags_of(variant, "certain", range(stages[0]), LARGEST))
    return {
        "variant": variant,
        "found": {
            key: size if key == "flights" else finite(size / LARGEST)
            for key, size in vars(found_size).items()
        },
        "certain": {"size": finite(certain_size / LARGEST), "flights": stages[0], "at_total_loss": n_certain},
        "total_loss": counted(sum_of(total, "found"), len(total)),
        "false_alarms": sum_of(total, "false_alarm"),
        "failed": sum_of(total, "failed"),
    }
