"""The flights of the survey, and the statistic of every scheme in them.

    condition   sensors and turbulence, which a designer knows; a scheme has an alarm level for each condition
    block       a condition, an excitation and a seed: flights that are the same until the fault begins
    grid        the conditions, excitations, faults and numbers of blocks of a survey

A block with faults is flown for each fault of the grid, and again for each scheme of FLOWN_THEMSELVES. The
nominal law reads no verdict, so that all schemes diagnose the same flights.
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

STRIKES_S = (8.0, 10.0)  # a fault begins at a random time between these
WATCHED_S = 5.0  # time that is flown after the begin of the fault
WITHIN_S = (0.5, 1.0, WATCHED_S)  # delays within which detections are counted
_RATE_HZ = 100.0
UNEXPLAINED_UP_TO_RAD_S = 15.0  # frequency of the faster of the published sinusoids

ESTIMATORS = "adaptive-estimators"
STATISTICAL, BOTH = "statistical", "both"
# Our schemes, whose statistic comes with a flight of their own, and keys of `fdi` that select each.
BUILT_IN: dict[str, Document] = {
    ESTIMATORS: {},
    STATISTICAL: {"statistical": {}, "authority": "statistical"},
    BOTH: {"statistical": {}},
}
# All schemes that need a flight of their own: ours, and the published one.
FLOWN_THEMSELVES = BUILT_IN | {"zhang2005": {"scheme": "zhang2005"}}


class Condition(NamedTuple):
    """Names of the sensors and of the severity of turbulence."""

    sensors: str
    turbulence: str


class Block(NamedTuple):
    """One condition, one amplitude of the references, one seed."""

    condition: Condition
    excitation_deg_s: float
    seed: int


Faults = tuple[tuple[str, float], ...]
"""Surface and magnitude of each loss."""


@dataclass(frozen=True)
class Grid:
    """The survey.

    - conditions, surfaces, magnitudes, excitations_deg_s: all combinations are flown with faults.
    - blocks: flights of each combination. healthy_h: hours without a fault for each condition;
      healthy_flight_s: length of such a flight, s.
    - per_h: false alarms per hour at which the schemes are compared.
    - where: further keys of the scenarios, such as another aircraft and its start.
    """

    conditions: tuple[Condition, ...]
    surfaces: tuple[str, ...]
    magnitudes: tuple[float, ...]
    excitations_deg_s: tuple[float, ...]
    blocks: int
    healthy_h: float
    healthy_flight_s: float
    per_h: float
    where: Document = field(default_factory=dict, hash=False)

    @property
    def faults(self) -> Faults:
        """Every surface with every magnitude."""
        return tuple(product(self.surfaces, self.magnitudes))

    def only(self, sensors: str | None, turbulence: str | None) -> "Grid":
        """The same flights under the conditions with these sensors and this turbulence; None is any. Raises
        BadInput if there is no such condition."""
        conditions = tuple(
            condition
            for condition in self.conditions
            if sensors in (None, condition.sensors) and turbulence in (None, condition.turbulence)
        )
        if not conditions:
            allowed = "; ".join(map(", ".join, self.conditions))
            raise BadInput(f"detectability: this grid has no such condition, allowed: {allowed}")
        return replace(self, conditions=conditions)

    def elsewhere(
        self, aircraft: str | None, airspeed_mps: float | None, altitude_m: float | None, surface: str | None
    ) -> "Grid":
        """The same flights with another aircraft, airspeed or altitude, or with losses of one surface; None
        is as before. Without a surface, another aircraft loses all of its class of losses. Raises BadInput
        for a surface that is not in the class of losses."""
        class_of_losses = find_aircraft(aircraft or DEFAULT, Path()).class_of_losses
        if surface is not None and surface not in class_of_losses:
            raise BadInput(f"--surface {surface!r:.60}: allowed: {', '.join(class_of_losses)}")
        condition = {"airspeed_mps": airspeed_mps, "altitude_m": altitude_m}
        initial = {name: value for name, value in condition.items() if value is not None}
        keys = {"initial": initial, "aircraft": aircraft}
        where = {key: value for key, value in keys.items() if value}
        surfaces = self.surfaces if aircraft is None else class_of_losses
        return replace(self, where=where, surfaces=(surface,) if surface else surfaces)

    def faulted(self) -> list[Block]:
        """The blocks with faults; each flies all faults. The seeds are the same in every condition."""
        return [
            Block(condition, excitation, 1000 * i + seed)
            for condition in self.conditions
            for i, excitation in enumerate(self.excitations_deg_s)
            for seed in range(self.blocks)
        ]

    def healthy(self) -> list[Block]:
        """The blocks without a fault, which set the levels; the excitations take turns. Their seeds differ
        from those with faults."""
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
    """A flight of a block. Everything in it follows from the block, except duration, faults and `where`.

    Model errors are added to the Beaver alone: another aircraft has the error of its own model.
    """
    sensors, turbulence = block.condition
    aircraft = where.get("aircraft", DEFAULT)
    find_aircraft(aircraft, Path())  # each process registers a folder in the working directory
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
    """The begin of the faults of a block, at a frame, s."""
    return round(_draws(block, 2).uniform(*STRIKES_S) * _RATE_HZ) / _RATE_HZ


def _draws(block: Block, purpose: int) -> np.random.Generator:
    """Random numbers of a block for one purpose: 0 references, 1 model errors, 2 begin of the fault. They
    depend on the seed alone, and are the same in every condition."""
    return np.random.default_rng([block.seed, purpose])


def _uncertainty(block: Block) -> Document:
    """Model errors within the published bound [Zhang2005, sec. VII]: random couplings up to 0.25, and
    sinusoids with the largest amplitude, 0.02 rad/s2, and a random frequency."""
    draws = _draws(block, 1)
    coupling = draws.uniform(-0.25, 0.25, len(AXES)).tolist()
    return {
        "inertia_coupling": dict(zip(AXES, coupling, strict=True)),
        "sinusoid": swings(draws, [0.02] * len(AXES), (1.0, UNEXPLAINED_UP_TO_RAD_S)),
    }


def contenders(names: list[str] | None = None) -> tuple[str, ...]:
    """The schemes to compare: ours, then those named, or all that can be compared. Raises BadInput with a
    line for each wrong name."""
    if names is None:
        known_names = registered(DETECTORS)
        names = [name for name in known_names if name in FLOWN_THEMSELVES or not is_compiled(DETECTORS, name)]
    names = list(dict.fromkeys([*BUILT_IN, *names]))
    mistakes = [f"--schemes: {mistake}" for name in names if (mistake := _refusal(name)) is not None]
    if mistakes:
        raise BadInput("\n".join(mistakes))
    return tuple(names)


def _refusal(name: str) -> str | None:
    """Why a scheme cannot be compared; None if it can."""
    if name in FLOWN_THEMSELVES:
        return None
    if is_compiled(DETECTORS, name):
        allowed = ", ".join(FLOWN_THEMSELVES)
        return f"scheme {name!r} detects nothing, allowed: {allowed}, a registered detector"
    return refusal(DETECTORS, name)


def deflections(
    recording: Recording, surface: str, magnitude: float, within_s: tuple[float, ...]
) -> list[float]:
    """The deflection d of a loss of effectiveness in a recorded flight, each of these times after its begin:
    the size of its effect -magnitude * moment, (frames, 3) rad/s2, in the whitened noise, in standard
    deviations. A time beyond the end counts as the end."""
    frames_with_fault = [
        measured for measured, _ in recording.seen if measured.t_s > recording.fault_at_s + 1e-9
    ]
    if not frames_with_fault:
        return [0.0] * len(within_s)
    place = recording.context.surfaces.index(surface)
    moment = np.array([measured.contribution[:, place] for measured in frames_with_fault])
    d = WhiteningFilter(VaneGust(recording.context).context).deflection_by_frame(-magnitude * moment)
    frames = [round(s / recording.context.dt_s) for s in within_s]
    return [float(d[min(n, len(d)) - 1]) for n in frames]


@dataclass
class Watched:
    """The outcome of a block.

    - faults: of its flights, in order; empty without faults. traces: by scheme, a trace for each flight.
    - deflections: for each fault, the deflection after each of WITHIN_S.
    - failures: for each missing scheme, the reason.
    """

    block: Block
    faults: Faults = ()
    traces: dict[str, list[Trace]] = field(default_factory=dict)
    deflections: list[list[float]] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)


def fly_block(case: tuple[Block, bool], grid: Grid, schemes: Sequence[str]) -> Watched:
    """Every fault of the grid in a block, or the one flight of a block without a fault. case: the block, and
    whether it has faults."""
    block, faulted = case
    if not faulted:
        healthy = scenario_of(block, grid.healthy_flight_s, where=grid.where)
        return _watch(Watched(block), [healthy], schemes)
    at_s = strikes_at_s(block)
    flights = [
        scenario_of(block, at_s + WATCHED_S, [loss(*fault, at_s)], grid.where) for fault in grid.faults
    ]
    return _watch(Watched(block, grid.faults), flights, schemes)


def _watch(watched: Watched, flights: Sequence[Scenario], schemes: Sequence[str]) -> Watched:
    """Fill the outcome of a block. Plug-ins replay the recordings of the last of our schemes, which come
    first."""
    recorded: list[Recording] = []
    for scheme in schemes:
        try:
            if scheme in FLOWN_THEMSELVES:
                recordings = [replay.record(with_fdi(flight, scheme)) for flight in flights]
                if scheme in BUILT_IN:
                    recorded = recordings
                traces = [replay.trace(recording, recording.built_in) for recording in recordings]
            elif recorded:
                traces = [replay.replay(recording, scheme) for recording in recorded]
            else:  # our schemes could not fly them: the failures already have the reason
                continue
            watched.traces[scheme] = traces
        except BeaverFtcError as error:
            watched.failures.append(f"{scheme}: {error}")
        except Exception as error:  # a plug-in may raise anything, and the comparison continues
            watched.failures.append(f"{scheme}: {type(error).__name__}: {error}")
    faulted = zip(recorded, watched.faults, strict=False)  # without faults there are no pairs
    watched.deflections = [deflections(recording, *fault, WITHIN_S) for recording, fault in faulted]
    return watched


def with_fdi(flight: Scenario, scheme: str) -> Scenario:
    """The flight with the keys of `fdi` that select one of FLOWN_THEMSELVES."""
    return flight.with_({f"fdi.{key}": value for key, value in FLOWN_THEMSELVES[scheme].items()})


def lost(case: tuple[Block, ...], why: str) -> Watched:
    """The outcome of a block that ends its process: no traces, but the reason."""
    block = case[0]
    return Watched(block, failures=[f"{' '.join(block.condition)}, seed {block.seed}: {why}"])
