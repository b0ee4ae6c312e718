"""Fly a bout once, and see what every scheme makes of it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from beaver_ftc.documents.errors import BeaverFtcError
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.compare.replay import (
    Recording,
    Trace,
    aware_of_the_air,
    record,
    replay_together,
    trace,
)
from beaver_ftc.studies.power.contenders import Contender
from beaver_ftc.studies.power.grid import WATCHED_S, WITHIN_S, Bout, Grid, loss, scenario_of, strikes_at_s
from beaver_ftc.studies.power.limit import deflections


@dataclass
class Watched:
    """What came of a bout: of every scheme, a trace for each of its flights, in order; why one is missing.

    deflections: how far each fault stands out of the noise, after each of WITHIN_S (limit.py).
    """

    bout: Bout
    faults: tuple[tuple[str, float], ...] = ()
    traces: dict[str, list[Trace]] = field(default_factory=dict)
    deflections: list[list[float]] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)


def fly_faulted(bout: Bout, grid: Grid, schemes: Sequence[Contender]) -> Watched:
    """Every fault of the grid in this bout."""
    at_s = strikes_at_s(bout)
    flights = [scenario_of(bout, at_s + WATCHED_S, [loss(*fault, at_s)]) for fault in grid.faults]
    return _watch(Watched(bout, grid.faults), flights, schemes, grid.vanes)


def fly_healthy(bout: Bout, grid: Grid, schemes: Sequence[Contender]) -> Watched:
    """The one flight of a bout without a fault."""
    return _watch(Watched(bout), [scenario_of(bout, grid.healthy_flight_s)], schemes, grid.vanes)


def _watch(
    watched: Watched, flights: Sequence[Scenario], schemes: Sequence[Contender], vanes: bool
) -> Watched:
    seen: list[Recording] = []
    for contender in schemes:
        try:
            if contender.built_in:
                recordings = [record(with_fdi(flight, contender)) for flight in flights]
                seen = _as_shown(recordings, vanes)
            watched.traces[contender.name] = (
                [trace(recording, recording.built_in) for recording in recordings]
                if contender.built_in
                else replay_together(seen, contender.scheme)
            )
        except BeaverFtcError as error:
            watched.failures.append(f"{contender.name}: {error}")
        except Exception as error:  # a plug-in may raise anything: not the end of the comparison
            watched.failures.append(f"{contender.name}: {type(error).__name__}: {error}")
    watched.deflections = _deflections(seen, watched.faults)
    return watched


def _as_shown(recordings: Sequence[Recording], vanes: bool) -> list[Recording]:
    """What plug-ins are shown of the flights."""
    return [
        aware_of_the_air(recording) if vanes and recording.air is not None else recording
        for recording in recordings
    ]


def _deflections(recordings: Sequence[Recording], faults: Sequence[tuple[str, float]]) -> list[list[float]]:
    """Of every fault; a healthy flight has none."""
    return [
        deflections(recording, *fault, WITHIN_S) for recording, fault in zip(recordings, faults, strict=False)
    ]


def with_fdi(flight: Scenario, contender: Contender) -> Scenario:
    """The flight with what the contender wants of the built-in diagnosis."""
    document = flight.model_dump(mode="json", exclude_none=True)
    document["fdi"] |= contender.fdi
    return Scenario.model_validate(document)
