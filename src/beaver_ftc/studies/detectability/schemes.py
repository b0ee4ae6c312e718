"""The flights of a grid, and the statistic of every scheme in them.

A block with faults is flown for each fault of the grid, and again for each scheme of FLOWN_THEMSELVES. The
nominal law reads no verdict, so that all schemes diagnose the same flights.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from beaver_ftc.aircraft import AXES, DEFAULT
from beaver_ftc.diagnosis.informed_test import WhiteningFilter
from beaver_ftc.diagnosis.rivals.gust import VaneGust
from beaver_ftc.documents.errors import BadInput, BeaverFtcError
from beaver_ftc.documents.files import Document
from beaver_ftc.plugins import DETECTORS, is_compiled, refusal, registered
from beaver_ftc.scenario.air import air_of
from beaver_ftc.scenario.airframe import find_aircraft
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.compare import replay
from beaver_ftc.studies.compare.replay import Recording, Trace
from beaver_ftc.studies.detectability.grid import WATCHED_S, WITHIN_S, Block, Faults, Grid
from beaver_ftc.studies.engine.draws import loss, sines, swings

STRIKES_S = (8.0, 10.0)  # a fault begins at a random time between these
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


def scenario_of(
    block: Block, duration_s: float, faults: Sequence[Document] = (), where: Document | None = None
) -> Scenario:
    """A flight of a block. Everything in it follows from the block, except duration, faults and the keys of
    `where`.

    Model errors are added to the Beaver alone: another aircraft has the error of its own model.
    """
    sensors, turbulence = block.condition
    where = where or {}
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


def contenders(names: list[str] | None) -> tuple[str, ...]:
    """The schemes to compare: ours, then those with these names; None: all that can be compared. Raises
    BadInput with a line for each wrong name."""
    if names is None:
        names = [name for name in registered(DETECTORS) if _refusal(name) is None]
    chosen = tuple(dict.fromkeys([*BUILT_IN, *names]))
    mistakes = [f"--schemes: {mistake}" for name in chosen if (mistake := _refusal(name)) is not None]
    if mistakes:
        raise BadInput("\n".join(mistakes))
    return chosen


def _refusal(name: str) -> str | None:
    """Why a scheme cannot be compared; None if it can."""
    if name in FLOWN_THEMSELVES:
        return None
    if is_compiled(DETECTORS, name):
        allowed = ", ".join(FLOWN_THEMSELVES)
        return f"scheme {name!r} detects nothing, allowed: {allowed}, a registered detector"
    return refusal(DETECTORS, name)


def deflections(recording: Recording, surface: str, magnitude: float) -> list[float]:
    """The deflection d of a loss of effectiveness in a recorded flight, each of WITHIN_S after its begin: the
    size of its effect -magnitude * moment, (frames, 3) rad/s2, in the whitened noise, in standard deviations.
    A time beyond the end counts as the end."""
    frames_with_fault = [
        measured for measured, _ in recording.seen if measured.t_s > recording.fault_at_s + 1e-9
    ]
    if not frames_with_fault:
        return [0.0] * len(WITHIN_S)
    place = recording.context.surfaces.index(surface)
    moment = np.array([measured.contribution[:, place] for measured in frames_with_fault])
    d = WhiteningFilter(VaneGust(recording.context).context).deflection_by_frame(-magnitude * moment)
    frames = (round(s / recording.context.dt_s) for s in WITHIN_S)
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
    """Every fault of the grid in a block, or the one flight of a block without a fault, diagnosed by these
    schemes. case: the block, and whether it has faults. Plug-ins replay the recordings of the last of our
    schemes, which come first."""
    block, faulted = case
    at_s = strikes_at_s(block)
    watched = Watched(block, grid.faults if faulted else ())
    flights = [
        scenario_of(block, at_s + WATCHED_S, [loss(*fault, at_s)], grid.where) for fault in watched.faults
    ] or [scenario_of(block, grid.healthy_flight_s, where=grid.where)]
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
    pairs = zip(recorded, watched.faults, strict=False)  # none without faults
    watched.deflections = [deflections(recording, *fault) for recording, fault in pairs]
    return watched


def with_fdi(flight: Scenario, scheme: str) -> Scenario:
    """The flight with the keys of `fdi` that select one of FLOWN_THEMSELVES."""
    return flight.with_({f"fdi.{key}": value for key, value in FLOWN_THEMSELVES[scheme].items()})


def lost(case: tuple[Block, ...], why: str) -> Watched:
    """The outcome of a block that ends its process: no traces, but the reason."""
    block = case[0]
    return Watched(block, failures=[f"{' '.join(block.condition)}, seed {block.seed}: {why}"])
