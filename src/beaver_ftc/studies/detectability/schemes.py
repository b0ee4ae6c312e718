"""The flights of the survey, and the statistic of every scheme in them.

A block is flown once for each fault; every scheme watches the same flights.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from pydantic import TypeAdapter

from beaver_ftc.aircraft import AXES, DEFAULT
from beaver_ftc.diagnosis.informed_test import WhiteningFilter
from beaver_ftc.diagnosis.rivals.gust import VaneGust
from beaver_ftc.documents.errors import BadInput, BeaverFtcError
from beaver_ftc.documents.files import Document
from beaver_ftc.plugins import DETECTORS, is_compiled, refusal, registered
from beaver_ftc.scenario.airframe import air_of, find_aircraft
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.compare import replay
from beaver_ftc.studies.compare.replay import Recording, Trace
from beaver_ftc.studies.engine.draws import loss, sines, swings

STRIKES_S = (8.0, 10.0)  # a fault strikes at random in between
WATCHED_S = 5.0  # after it
WITHIN_S = (0.5, 1.0, WATCHED_S)  # how soon is soon
_RATE_HZ = 100.0
UNEXPLAINED_UP_TO_RAD_S = 15.0  # the faster of the published sinusoids, and what is declared of them

ESTIMATORS = "adaptive-estimators"
STATISTICAL, BOTH = "statistical", "both"
# Schemes of which the statistic comes with the flight itself, and what its `fdi` says beside the bounds.
BUILT_IN: dict[str, Document] = {
    ESTIMATORS: {},
    STATISTICAL: {"statistical": {}, "authority": "statistical"},
    BOTH: {"statistical": {}},
}
# The same of the published scheme, which is not ours.
FLOWN_THEMSELVES = BUILT_IN | {"zhang2005": {"scheme": "zhang2005"}}


class Condition(NamedTuple):
    """The instruments and the air that a designer knows, and may set an alarm level for."""

    sensors: str
    turbulence: str


class Block(NamedTuple):
    """One condition, one excitation, one seed: flights that are the same until the fault strikes."""

    condition: Condition
    excitation_deg_s: float
    seed: int


Faults = tuple[tuple[str, float], ...]
"""Surface and magnitude of each loss."""


@dataclass(frozen=True)
class Grid:
    """The survey. blocks: flights with a fault a cell; healthy_h: without one, a condition; per_h: false
    alarms per hour at which the schemes are compared."""

    conditions: tuple[Condition, ...]
    surfaces: tuple[str, ...]
    magnitudes: tuple[float, ...]
    excitations_deg_s: tuple[float, ...]
    blocks: int
    healthy_h: float
    healthy_flight_s: float
    per_h: float
    # what its scenarios say besides: another aircraft, and where it starts
    where: Document = field(default_factory=dict, hash=False)

    @property
    def faults(self) -> Faults:
        """Every surface with every magnitude."""
        return tuple(product(self.surfaces, self.magnitudes))

    def only(self, sensors: str | None, turbulence: str | None) -> "Grid":
        """The same flights under some of the conditions. Raises BadInput if there are none."""
        kept = tuple(
            one
            for one in self.conditions
            if sensors in (None, one.sensors) and turbulence in (None, one.turbulence)
        )
        if not kept:
            there = "; ".join(map(", ".join, self.conditions))
            raise BadInput(f"detectability: this grid has no such condition, allowed: {there}")
        return replace(self, conditions=kept)

    def elsewhere(
        self, aircraft: str | None, airspeed_mps: float | None, altitude_m: float | None, surface: str | None
    ) -> "Grid":
        """The same flights with another aircraft, elsewhere, of one surface. Raises BadInput for one that the
        aircraft has not, or whose loss is outside the class."""
        known = find_aircraft(aircraft or DEFAULT, Path()).class_of_losses
        if surface is not None and surface not in known:
            raise BadInput(f"--surface {surface!r:.60}: allowed: {', '.join(known)}")
        given = {"airspeed_mps": airspeed_mps, "altitude_m": altitude_m}
        initial = {name: value for name, value in given.items() if value is not None}
        said = {"initial": initial, "aircraft": aircraft}
        where = {key: value for key, value in said.items() if value}
        surfaces = self.surfaces if aircraft is None else known
        return replace(self, where=where, surfaces=(surface,) if surface else surfaces)

    def faulted(self) -> list[Block]:
        """The blocks with faults; each flies all of them. The same seeds in every condition."""
        return [
            Block(condition, excitation, 1000 * i + seed)
            for condition in self.conditions
            for i, excitation in enumerate(self.excitations_deg_s)
            for seed in range(self.blocks)
        ]

    def healthy(self) -> list[Block]:
        """The blocks without a fault, which set the levels; seeds of their own."""
        count = round(self.healthy_h * 3600.0 / self.healthy_flight_s)
        excitations = self.excitations_deg_s
        return [
            Block(condition, excitations[i % len(excitations)], 1_000_000 + i)
            for condition in self.conditions
            for i in range(count)
        ]


GRIDS = TypeAdapter(dict[str, Grid]).validate_json((Path(__file__).parent / "grids.json").read_bytes())


def scenario_of(
    block: Block,
    duration_s: float,
    faults: Sequence[Document] = (),
    where: Mapping[str, Any] = MappingProxyType({}),
) -> Scenario:
    """A flight of a block: everything in it but the fault and where it is flown follows from the block.
    Another aircraft than the Beaver has the error of its own model, and none is added."""
    sensors, turbulence = block.condition
    aircraft = where.get("aircraft", DEFAULT)
    find_aircraft(aircraft, Path())  # a folder in the working directory, in each process
    return Scenario.model_validate(
        {
            "name": "power",
            "duration_s": duration_s,
            "rate_hz": _RATE_HZ,
            "seed": block.seed,
            "reference": sines(_draws(block, 0), block.excitation_deg_s),
            "uncertainty": _uncertainty(block) if aircraft == DEFAULT else {},
            "sensors": sensors,
            "environment": air_of(turbulence),
            "faults": faults,
            "fdi": {"bounds": {"sensors": sensors, "turbulence": turbulence}},
            "control": {"law": "nominal"},
            **where,
        }
    )


def strikes_at_s(block: Block) -> float:
    """When the faults of a block strike, on a frame."""
    return round(_draws(block, 2).uniform(*STRIKES_S) * _RATE_HZ) / _RATE_HZ


def _draws(block: Block, purpose: int) -> np.random.Generator:
    """Random numbers of a seed, the same in every condition."""
    return np.random.default_rng([block.seed, purpose])


def _uncertainty(block: Block) -> Document:
    """Inside the published bound [Zhang2005, sec. VII]: couplings anywhere up to 0.25, and sinusoids of its
    whole 0.02 rad/s2, whatever their frequency."""
    draws = _draws(block, 1)
    coupling = draws.uniform(-0.25, 0.25, len(AXES)).tolist()
    return {
        "inertia_coupling": dict(zip(AXES, coupling, strict=True)),
        "sinusoid": swings(draws, [0.02] * len(AXES), (1.0, UNEXPLAINED_UP_TO_RAD_S)),
    }


def contenders(names: list[str] | None = None) -> tuple[str, ...]:
    """The schemes to compare: those named, ours first; without names all. Raises BadInput, a line a name."""
    if names is None:
        known = registered(DETECTORS)
        names = [name for name in known if name in FLOWN_THEMSELVES or not is_compiled(DETECTORS, name)]
    names = list(dict.fromkeys([*BUILT_IN, *names]))
    wrong = [f"--schemes: {says}" for name in names if (says := _refusal(name)) is not None]
    if wrong:
        raise BadInput("\n".join(wrong))
    return tuple(names)


def _refusal(name: str) -> str | None:
    if name in FLOWN_THEMSELVES:
        return None
    if is_compiled(DETECTORS, name):
        there = ", ".join(FLOWN_THEMSELVES)
        return f"scheme {name!r} detects nothing, allowed: {there}, a registered detector"
    return refusal(DETECTORS, name)


def deflections(
    recording: Recording, surface: str, magnitude: float, within_s: tuple[float, ...]
) -> list[float]:
    """The deflection d of a loss of effectiveness in a recorded flight, as long after it struck: how far its
    effect -magnitude * moment (frames, 3) rad/s2 stands out of the whitened noise, in standard deviations."""
    since = [measured for measured, _ in recording.seen if measured.t_s > recording.fault_at_s + 1e-9]
    if not since:
        return [0.0] * len(within_s)
    place = recording.context.surfaces.index(surface)
    moment = np.array([measured.contribution[:, place] for measured in since])
    d = WhiteningFilter(VaneGust(recording.context).context).deflection_by_frame(-magnitude * moment)
    frames = [round(s / recording.context.dt_s) for s in within_s]
    return [float(d[min(n, len(d)) - 1]) for n in frames]


@dataclass
class Watched:
    """The outcome of a block: by scheme, a trace for each of its flights, in order; why one is missing.

    deflections: how far each fault stands out of the noise, after each of WITHIN_S (probabilities.py).
    """

    block: Block
    faults: Faults = ()
    traces: dict[str, list[Trace]] = field(default_factory=dict)
    deflections: list[list[float]] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)


def fly_block(case: tuple[Block, bool], grid: Grid, schemes: Sequence[str]) -> Watched:
    """Every fault of the grid in a block, or the one flight of a block without a fault."""
    block, faulted = case
    if not faulted:
        healthy = scenario_of(block, grid.healthy_flight_s, where=grid.where)
        return _watch(Watched(block), [healthy], schemes)
    at_s = strikes_at_s(block)
    faults = ([loss(*fault, at_s)] for fault in grid.faults)
    flights = [scenario_of(block, at_s + WATCHED_S, one, grid.where) for one in faults]
    return _watch(Watched(block, grid.faults), flights, schemes)


def _watch(watched: Watched, flights: Sequence[Scenario], schemes: Sequence[str]) -> Watched:
    seen: list[Recording] = []  # what plug-ins are shown of the flights
    for scheme in schemes:
        try:
            if scheme in FLOWN_THEMSELVES:
                recordings = [replay.record(with_fdi(flight, scheme)) for flight in flights]
                if scheme in BUILT_IN:
                    seen = recordings
                traces = [replay.trace(recording, recording.built_in) for recording in recordings]
            elif seen:
                traces = [replay.replay(recording, scheme) for recording in seen]
            else:  # why our own could not fly them has been said
                continue
            watched.traces[scheme] = traces
        except BeaverFtcError as error:
            watched.failures.append(f"{scheme}: {error}")
        except Exception as error:  # a plug-in may raise anything: not the end of the comparison
            watched.failures.append(f"{scheme}: {type(error).__name__}: {error}")
    struck = zip(seen, watched.faults, strict=False)  # a healthy flight has none
    watched.deflections = [deflections(recording, *fault, WITHIN_S) for recording, fault in struck]
    return watched


def with_fdi(flight: Scenario, scheme: str) -> Scenario:
    """The flight with what a scheme of ours wants of the built-in diagnosis."""
    return flight.with_({f"fdi.{key}": value for key, value in FLOWN_THEMSELVES[scheme].items()})


def lost(case: tuple[Block, ...], why: str) -> Watched:
    """A block that ends its process: nothing was watched, and why."""
    block = case[0]
    return Watched(block, failures=[f"{' '.join(block.condition)}, seed {block.seed}: {why}"])
