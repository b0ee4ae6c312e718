"""The promises of the theory, on random flights inside everything the diagnosis declares: the flight
condition, the references, the uncertainty, the fault.

Flight number i of a seed is the same whatever else is flown, by whom, and in which order.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import ceil
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from beaver_ftc.aircraft import AXES, load
from beaver_ftc.commands import Reporter, SeedOption, StudyCommand, WorkersOption
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import Document
from beaver_ftc.loop.loop import fly
from beaver_ftc.loop.outcome import Landing
from beaver_ftc.results.metrics import Truth, as_json, fault_free_s, is_late
from beaver_ftc.scenario.faults import LossOfEffectiveness
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.signals import grown_share
from beaver_ftc.studies.engine.draws import generator_of, loss
from beaver_ftc.studies.engine.statistics import CONFIDENCE, binomial, poisson_bound, share_within
from beaver_ftc.studies.engine.study import Study, run_study
from beaver_ftc.studies.present.page import Makers
from beaver_ftc.studies.present.tables import finite, number_or_never

HEALTHY_S = 100.0  # attitude is open loop: a longer flight wanders out of the validated envelope
AFTER_FAULT_S = 15.0  # more than a period of the slowest reference
_AIRSPEED_MPS = (35.0, 52.0)
_ALTITUDE_M = (0.0, 3000.0)
_RATE_HZ = {"healthy": (20, 50), "faulty": (20, 100)}  # a slow hour flies sooner
_MAGNITUDE = (0.05, 1.0)
_KAPPA_PER_S = (0.2, 10.0)
_FAULT_AT_S = (3.0, 8.0)
_INERTIA = 0.25
_AMPLITUDE_RAD_S2 = 0.02
_FREQUENCY_RAD_S = (0.1, 60.0)
_AT_THE_BOUND = 0.3  # share of flights with an uncertainty at its very bound
_COARSE = 0.05  # share of flights with several JSBSim frames in a frame of the loop
KINDS = ("healthy", "faulty")
ONE_SIDED = 2.0 * CONFIDENCE - 1.0  # the two-sided confidence whose upper limit has CONFIDENCE


@dataclass(frozen=True)
class Draw:
    """One flight of a seed: kind is `healthy` or `faulty`, index counts from 0."""

    seed: int
    kind: str
    index: int

    def scenario(self, fdi: Document | None = None) -> Scenario:
        """The flight, diagnosed as `fdi` says."""
        rng = generator_of(self.seed, KINDS.index(self.kind), self.index)
        fault = _fault(rng) if self.kind == "faulty" else None
        return Scenario.model_validate({
            "name": f"{self.kind}-{self.index}",
            "duration_s": fault["at_s"] + AFTER_FAULT_S if fault else HEALTHY_S,
            "rate_hz": round(_log_uniform(rng, *_RATE_HZ[self.kind])),
            "substeps": int(rng.integers(2, 5)) if rng.random() < _COARSE else 1,
            "initial": {"airspeed_mps": rng.uniform(*_AIRSPEED_MPS), "altitude_m": rng.uniform(*_ALTITUDE_M)},
            "reference": {axis: [_signal(rng) for _ in range(rng.integers(1, 3))] for axis in AXES},
            "faults": [fault] if fault else [],
            "uncertainty": _uncertainty(rng),
            "fdi": fdi or {},
        })  # fmt: skip


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _fault(rng: np.random.Generator) -> Document:
    fault = loss(str(rng.choice(load().primary)), rng.uniform(*_MAGNITUDE), rng.uniform(*_FAULT_AT_S))
    if rng.random() < 0.5:
        fault |= {"profile": "incipient", "kappa_per_s": _log_uniform(rng, *_KAPPA_PER_S)}
    return fault


def _signal(rng: np.random.Generator) -> Document:
    """Zero on average, or the attitude would run away under open outer loops."""
    amplitude = {"amplitude_deg_s": rng.uniform(0.5, 5.0)}
    wave = {**amplitude, "frequency_hz": _log_uniform(rng, 0.1, 0.7), "phase_deg": rng.uniform(0, 360)}
    kind = rng.choice(["sine", "square", "doublet", "chirp"], p=[0.5, 0.2, 0.15, 0.15])
    if kind == "doublet":
        return {"doublet": {**amplitude, "start_s": rng.uniform(0, 15), "width_s": rng.uniform(0.5, 3)}}
    if kind == "chirp":
        sweep = {"start_s": 0.0, "end_s": rng.uniform(20, HEALTHY_S), "start_frequency_hz": 0.1}
        return {"chirp": {**amplitude, **sweep, "end_frequency_hz": rng.uniform(0.2, 1.0)}}
    return {str(kind): wave}


def _within(rng: np.random.Generator, bound: float) -> float:
    """Anywhere within the bound, and often right at it."""
    return bound if rng.random() < _AT_THE_BOUND else rng.uniform(0.0, bound)


def _uncertainty(rng: np.random.Generator) -> Document:
    """All that the published bounds admit [Zhang2005, sec. VII]."""
    sign = {axis: rng.choice([-1.0, 1.0]) for axis in AXES}
    coupling = {axis: sign[axis] * _within(rng, _INERTIA) for axis in AXES}
    sinusoid = {
        axis: {
            "amplitude_rad_s2": _within(rng, _AMPLITUDE_RAD_S2),
            "frequency_rad_s": _log_uniform(rng, *_FREQUENCY_RAD_S),
        }
        for axis in AXES
    }
    return {"inertia_coupling": coupling, "sinusoid": sinusoid}


PUBLISHED, SHARPENED = "published", "sharpened"
_OFF = {"pole_bank": False, "memory": False, "shared_effectiveness": False}
SCHEMES: dict[str, Document] = {PUBLISHED: {"thresholds": "published"}, SHARPENED: {}}
# From the published scheme to the default, and on to what takes a declaration, one step after the other.
STEPS: dict[str, Document] = {
    PUBLISHED: SCHEMES[PUBLISHED],
    "interval": {"sharpen": _OFF},
    "pole bank": {"sharpen": {**_OFF, "pole_bank": True}},
    "memory": {"sharpen": {"shared_effectiveness": False}},
    SHARPENED: SCHEMES[SHARPENED],
    "constant": {"fault_profile": "abrupt"},
}
NAME = "verification"
TOGETHER = 50  # flights that are kept together
_CONSTANT_ONLY = "constant"  # for faults that are: one that grows is outside what this step declares

Row = Document
Schemes = dict[str, Document]


def fly_draw(draw: Draw, schemes: Schemes) -> Row:
    """The row of a flight. A fault is flown once with each scheme, in all else the same flight."""
    try:
        return _faulty(draw, schemes) if draw.kind == "faulty" else _healthy(draw)
    except BadInput as error:  # a draw without a trim: said, not counted
        return {"index": draw.index, "skipped": str(error)}


def _healthy(draw: Draw) -> Row:
    """The row of a flight without a fault. The first filter of the sharpened scheme is the published one, so
    that one flight is enough for both."""
    flight = fly(draw.scenario())
    return {
        "index": draw.index,
        "watched_s": fault_free_s(flight),
        "alarm": flight.detection_time_s is not None,
        "departed": flight.departure is not None,
        "outside_s": flight.outside_s,
        "closest": list(flight.closest_approach),
    }


def _faulty(draw: Draw, schemes: Schemes) -> Row:
    row: Row = {"index": draw.index}
    for scheme, fdi in schemes.items():
        scenario = draw.scenario(fdi)
        abrupt = scenario.faults[0].profile == "abrupt"
        row[scheme] = judge(fly(scenario)) if abrupt or scheme != _CONSTANT_ONLY else row[SHARPENED]
    frame = {"rate_hz": scenario.rate_hz, "substeps": scenario.substeps}
    return row | frame | scenario.faults[0].model_dump(exclude_none=True)


def judge(flight: Landing) -> Row:
    """The outcome of each promise in a flight with one fault; delays in s from the first frame with it."""
    truth = Truth.of(flight.scenario)
    guaranteed_s = flight.guaranteed_delay_s
    alarm_s = flight.detection_time_s
    delay_s = truth.onset.delay_s(alarm_s)
    left = (*flight.candidates, flight.isolated)
    meant = truth.faults_named_rightly_by(flight.isolated, flight.isolation_time_s)
    return {
        "delay_s": delay_s,
        "false_alarm": alarm_s is not None and truth.onset.is_false(alarm_s),
        "guaranteed_s": guaranteed_s,
        "late": guaranteed_s is not None
        and (delay_s is None or is_late(delay_s, guaranteed_s, 1.0 / flight.scenario.rate_hz)),
        "isolation_s": truth.onset.delay_s(flight.isolation_time_s),
        "excluded": alarm_s is not None and not any(truth.faults[0].is_named_by(name) for name in left),
        "wrong": flight.isolated is not None and not meant,
        "estimate_error": _estimate_error(flight) if meant else None,
    }


def _estimate_error(flight: Landing) -> float | None:
    """Distance of the estimated parameter from the true one at the end of the flight."""
    fault = flight.scenario.faults[0]
    if flight.estimate is None or not isinstance(fault, LossOfEffectiveness):
        return None
    grown = grown_share(fault, flight.frames / flight.scenario.rate_hz)
    return abs(flight.estimate + fault.magnitude * grown)


# What breaks each promise, in the row of a scheme.
_BROKEN = {
    "false_alarms": "false_alarm", "true_fault_exclusions": "excluded", "wrong_isolations": "wrong",
    "late_detections": "late",
}  # fmt: skip
PROMISES = tuple(_BROKEN)
# The guarantee that each violates, as docs/explanation numbers them; a wrong name follows from G2.
GUARANTEES = dict(zip(PROMISES, ("G1", "G2", "G2", "G3"), strict=True))
_SPREADS = {
    "detection delay, s": "delay_s", "isolation delay, s": "isolation_delay_s",
    "delay / guaranteed": "delay_over_guaranteed", "error of the estimate": "estimate_error",
}  # fmt: skip


def summarise(rows: dict[str, list[Row]]) -> Document:
    """The document of all flights; `kept`: whether every promise of the sharpened scheme, the default, held.

    The published one is there for comparison: its isolation threshold presumes a constant parameter.
    """
    healthy, faulty = ([row for row in rows[kind] if "skipped" not in row] for kind in KINDS)
    schemes = [scheme for scheme in STEPS if faulty and scheme in faulty[0]]
    document: Document = {
        "healthy": _healthy_document(healthy),
        "faults": len(faulty),
        "skipped": sum("skipped" in row for kind in KINDS for row in rows[kind]),
        "schemes": {scheme: _scheme([row[scheme] for row in faulty]) for scheme in schemes},
    }
    if faulty:
        document["delay_shorter_by"] = _shorter(document["schemes"])
    document["kept"] = document["healthy"]["false_alarms"] == 0 and all(
        document["schemes"][SHARPENED][promise] == 0 for promise in PROMISES if faulty
    )
    return document


def _healthy_document(rows: Sequence[Row]) -> Document:
    hours = sum(row["watched_s"] for row in rows) / 3600.0
    alarms = sum(row["alarm"] for row in rows)
    closest = np.max([row["closest"] for row in rows], axis=0).tolist() if rows else []
    upper = finite(poisson_bound(alarms, hours, CONFIDENCE, upper=True))
    return {
        "flights": len(rows),
        "hours": hours,
        "false_alarms": alarms,
        "false_alarms_per_hour": alarms / hours if hours else None,
        "false_alarms_per_hour_upper_95": upper,
        "departures": sum(row["departed"] for row in rows),
        "hours_outside_envelope": sum(row["outside_s"] for row in rows) / 3600.0,
        "closest_approach": dict(zip(SCHEMES, closest, strict=False)),
    }


def _scheme(rows: Sequence[Row]) -> Document:
    n = len(rows)
    counts = {promise: sum(row[broken] for row in rows) for promise, broken in _BROKEN.items()}
    certain = [row for row in rows if row["guaranteed_s"] is not None]
    ratios = [row["delay_s"] / row["guaranteed_s"] for row in certain if row["delay_s"]]
    errors = [row["estimate_error"] for row in rows if row["estimate_error"] is not None]
    return {
        **counts,
        **{
            f"{name}_probability_upper_95": binomial(count, n, ONE_SIDED).high
            for name, count in counts.items()
        },
        "detected": sum(row["delay_s"] is not None for row in rows),
        "isolated": sum(row["isolation_s"] is not None for row in rows),
        "detection_certain": len(certain),
        "delay_s": _quantiles(row["delay_s"] for row in rows),
        "isolation_delay_s": _quantiles(row["isolation_s"] for row in rows),
        "delay_over_guaranteed": _quantiles(ratios),
        "estimate_error": _quantiles(errors),
    }


def _quantiles(values: Iterable[float | None]) -> dict[str, float | None]:
    """Median and 90th percentile, what never came counting as infinitely late; None stands for infinite."""
    found = list(values)
    return {name: finite(share_within(found, share)) for name, share in (("median", 0.5), ("p90", 0.9))}


def _shorter(schemes: Document) -> float | None:
    """The share by which the sharpened scheme's median delay is shorter than the published one's."""
    published, sharpened = (schemes[name]["delay_s"]["median"] for name in SCHEMES)
    return 1.0 - sharpened / published if published and sharpened is not None else None


def summary_text(document: Document) -> str:
    """The document in words."""
    lines = [*_healthy_lines(document["healthy"]), *_fault_lines(document)]
    if document["skipped"]:
        lines.append(f"{document['skipped']} flights drawn could not be trimmed and are not counted")
    flown = bool(document["healthy"]["flights"]), bool(document["schemes"])
    held = {(True, True): "G1 to G3 hold", (True, False): "G1 holds", (False, True): "G2 and G3 hold"}.get(
        flown, "Nothing is tested"
    )
    lines.append(f"{held} for the sharpened scheme" if document["kept"] else "A GUARANTEE IS VIOLATED")
    return "\n".join(lines)


def _healthy_lines(healthy: Document) -> list[str]:
    if not healthy["flights"]:
        return []
    closest = ", ".join(f"{name} {share:.6f}" for name, share in healthy["closest_approach"].items())
    says = (
        "{hours:.2f} flight hours without a fault: {flights} flights, {hours_outside_envelope:.2f} h outside "
        "the validated envelope, {departures} departures",
        "  G1 false alarms                 {false_alarms} (at most {false_alarms_per_hour_upper_95:.2g} per "
        "hour, 95 % confidence)",
    )
    lines = [line.format(**healthy) for line in says]
    return [*lines, f"  closest approach to threshold   {closest}", ""]


def _fault_lines(document: Document) -> list[str]:
    schemes = document["schemes"]
    if not schemes:
        return []
    lines = [f"{document['faults']} random faults{'':17}" + "".join(f"{name:>18}" for name in schemes)]
    for promise in PROMISES:
        cells = [f"{s[promise]} (p < {s[promise + '_probability_upper_95']:.1e})" for s in schemes.values()]
        lines.append(_line(f"{GUARANTEES[promise]} {promise.replace('_', ' ')}", cells))
    for key in ("detected", "detection_certain", "isolated"):
        lines.append(_line(key.replace("_", " "), (str(s[key]) for s in schemes.values())))
    for (label, key), which in product(_SPREADS.items(), ("median", "p90")):
        lines.append(_line(f"{label}, {which}", (number_or_never(s[key][which]) for s in schemes.values())))
    if document["delay_shorter_by"] is not None:
        lines += [f"  median detection delay shorter by {document['delay_shorter_by']:.0%}", ""]
    return lines


def _line(label: str, cells: Iterable[str]) -> str:
    return f"  {label:<32}" + "".join(f"{cell:>18}" for cell in cells)


FILES: Makers = {"verify.json": as_json}


@dataclass(frozen=True)
class Verify(StudyCommand):
    """Test the guarantees on flights within the declared bounds.

    The guarantees hold as long as all errors are within the declared bounds. The command counts violations of
    the guarantees, with exact confidence limits. A violation is a false alarm, an excluded true fault, a
    wrong isolation, or a detection more than one frame later than guaranteed. Two schemes diagnose the same
    flights: the published scheme and the sharpened scheme. The sharpened scheme has the steps of
    `fdi.sharpen`. The exit status is 1 if a guarantee is violated.

    If the command is interrupted, the same command resumes it.

    Examples:
      beaver-ftc verify --hours 1 --faults 40

    hours: Number of flight hours without a fault.
    faults: Number of flights with one random fault.
    seed: Seed of all random draws.
    out: Folder for the results.
    steps: Also fly the schemes between the published and the sharpened scheme.
    """

    hours: Annotated[float, typer.Option(min=0.0, max=1e6)] = 2.0
    faults: Annotated[int, typer.Option(min=0, max=10_000_000)] = 200
    seed: SeedOption = 1
    workers: WorkersOption = None
    out: Path = Path("runs")
    steps: bool = False

    FILES = FILES
    PLUGINS = False

    def run(self, reporter: Reporter) -> Document:
        """Fly all hours and all faults."""
        wanted = {"healthy": ceil(self.hours * 3600.0 / HEALTHY_S), "faulty": self.faults}
        draws = [Draw(self.seed, kind, i) for kind in KINDS for i in range(wanted[kind])]
        if not draws:
            raise BadInput("verify: nothing to fly, allowed: --hours or --faults above 0")
        schemes = STEPS if self.steps else SCHEMES

        def document(rows: list[Row]) -> Document:
            healthy = wanted["healthy"]
            return {"seed": self.seed, **summarise({"healthy": rows[:healthy], "faulty": rows[healthy:]})}

        flying = partial(fly_draw, schemes=schemes)
        study = Study(NAME, draws, flying, document, FILES, follows_from=schemes, part=TOGETHER)
        return run_study(study, self.out, self.processes, reporter.progress)

    def as_text(self, document: Document, colour: bool) -> str:
        """The counts, and whether every promise was kept."""
        return summary_text(document)

    def passed(self, document: Document) -> bool:
        """Whether every promise of the default scheme was kept."""
        return bool(document["kept"])
