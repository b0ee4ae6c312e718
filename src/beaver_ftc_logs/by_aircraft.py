"""A recorded flight by the aircraft's own model: the diagnosis of the loop, on what the log has measured.

Where the aircraft is known no model is identified. The errors declared are those of a scenario; what theory
promises of the loop holds of the log as well, as long as they hold: no alarm of a healthy flight, no true
fault excluded. Outside the aircraft's envelope, after a gap and where a number is missing nothing is said.
"""

from dataclasses import dataclass, field, replace
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.diagnosis import Verdict
from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import findings, trust
from beaver_ftc_logs.diagnose import Rows
from beaver_ftc_logs.recording import Floats, Recording, nearest_ten
from beaver_ftc_logs.samples import Samples, at_samples, in_si, sample
from beaver_ftc_logs.stepped import Stepped, declared_of, rows_of, step_through
from beaver_ftc_logs.vehicle import Quantity, Vehicle

if TYPE_CHECKING:
    from beaver_ftc.loop import Diagnosis

Mask = NDArray[np.bool_]

_FASTEST_HZ, _SLOWEST_HZ = 1000.0, 20.0
_JITTER = 0.1
_FEW = 50
_DENSITY = (0.2, 1.6)
_BEYOND = 1.1
_AT_ONCE_S = 1.0
_ATTITUDE = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class Known:
    """The aircraft whose flights are diagnosed, and what its diagnosis is told, as `Diagnosis` takes it."""

    aircraft: Aircraft
    declared: Document = field(default_factory=dict)


def known(reference: str, scenario: str | None = None) -> Known:
    """The aircraft of a name, and the errors that a scenario (file or name) declares: the published ones
    where None. Raises BadInput where the scenario is of another aircraft."""
    from beaver_ftc.aircraft import UnknownAircraft
    from beaver_ftc.scenario import find_aircraft, load_scenario

    try:
        aircraft = find_aircraft(reference, Path.cwd())
    except UnknownAircraft as error:
        raise BadInput(f"--aircraft: {error}") from None
    if scenario is None:
        return Known(aircraft)
    given = load_scenario(scenario)
    if given.fdi.sensor_monitor == "always":
        says = "fdi.sensor_monitor: always wants accelerations, which a log has not, allowed: auto, never"
        raise BadInput(f"--scenario {scenario}: {says}")
    if given.fdi.scheme == "none":
        says = "fdi.scheme is none, so no diagnosis would run, allowed: a scenario with a scheme"
        raise BadInput(f"--scenario {scenario}: {says}")
    if given.airframe.name != aircraft.name:
        says = f"flies {given.airframe.name}, allowed: a scenario of {aircraft.name}"
        raise BadInput(f"--scenario {scenario}: {says}")
    return Known(given.airframe, declared_of(given))


@dataclass(frozen=True)
class Taken:
    """What a log gives the diagnosis: as `stepped.inputs_of`; the mean age of what is held, s; and begin and
    end of each stretch that is diagnosed in one."""

    samples: Samples
    diagnosis: "Diagnosis"
    rate_hz: float
    inputs: list[Floats]
    ages: dict[str, float]
    unknown: Mask
    parts: list[tuple[int, int]]


def take(recording: Recording, vehicle: Vehicle, by: Known) -> Taken:
    """Read what the diagnosis is given. Raises BadInput for what the log lacks."""
    from beaver_ftc.loop import Diagnosis

    _check(recording, vehicle, by.aircraft)
    samples = sample(
        recording, vehicle.model_copy(update={"max_rate_hz": _FASTEST_HZ, "reference_airspeed_mps": None})
    )
    rate_hz = _rate_hz(samples)
    diagnosis = Diagnosis(by.aircraft, rate_hz, **by.declared)
    turning = diagnosis.declared.air.moves
    inputs, ages = _inputs(samples, recording, vehicle, by.aircraft, turning)
    _plausible(samples.name, inputs, by.aircraft)
    unknown = np.asarray(~np.isfinite(np.hstack(inputs)).all(axis=1))
    parts = _stretches(samples, unknown, rate_hz)
    if not parts:
        raise BadInput(
            f"{samples.name}: has no {_FEW} samples in turn, evenly spaced and without a missing number, "
            f"allowed: all signals logged at one rate of {_SLOWEST_HZ:g} to {_FASTEST_HZ:g} Hz"
        )
    order = _order(vehicle, by.aircraft)
    samples = replace(samples, commands=samples.commands[:, order], labels=samples.labels[:, order])
    return Taken(samples, diagnosis, rate_hz, inputs, ages, unknown, parts)


def diagnose_as(recording: Recording, vehicle: Vehicle, by: Known) -> tuple[Samples, Rows, Document]:
    """The samples, the rows and the document of verdict.json. Raises BadInput for what the log lacks."""
    taken = take(recording, vehicle, by)
    return taken.samples, *diagnosed(taken, by)


def diagnosed(taken: Taken, by: Known) -> tuple[Rows, Document]:
    """The rows and the document of verdict.json."""
    samples, diagnosis, inputs, parts, found = taken.samples, taken.diagnosis, taken.inputs, taken.parts, []
    for begin, end in parts:
        diagnosis.reset()
        found.append(step_through(diagnosis, [part[begin:end] for part in inputs], taken.rate_hz))
    if not diagnosis.declared.air.moves:  # a law that answers gusts opposes what they turn
        _check_signs(samples.name, by.aircraft, found)
    stepped = _whole(len(samples.t_s), len(by.aircraft.surfaces), parts, found)
    rows = rows_of(samples.t_s, stepped, by.aircraft.surfaces, diagnosis.config)
    reasons = _outside(inputs[1], by.aircraft, taken.unknown, parts) | _misled(samples.t_s, parts, stepped)
    rows = rows.silent(_since(parts, rows, reasons))
    return rows, _verdict(samples, rows, stepped, by, taken.ages)


def _check_signs(name: str, aircraft: Aircraft, found: list[Stepped]) -> None:
    """Raise BadInput where the rates answer a command the other way round in all of a stretch."""
    for surface, gain in zip(aircraft.surfaces, np.min([one.gains for one in found], axis=0), strict=True):
        if gain < trust.REVERSED:
            says = f"the rates answer the command of {surface} the other way round in all of it"
            raise BadInput(f"{name}: {says}, allowed: signs as of {aircraft.name}; does `scale: -1` fit?")


def _check(recording: Recording, vehicle: Vehicle, aircraft: Aircraft) -> None:
    """Raise BadInput for what vehicle file and log lack of what the aircraft's model is given."""
    missing = [name for name in aircraft.surfaces if name not in vehicle.surfaces]
    if missing:
        says = f"surfaces: no {missing[0]}, allowed: what the commands make of {', '.join(aircraft.surfaces)}"
        raise BadInput(f"vehicle {vehicle.name}: {says}")
    if vehicle.airspeed is None:
        raise BadInput(f"vehicle {vehicle.name}: airspeed: is missing, allowed: its column, of true airspeed")
    wanted = _flow_of(aircraft)
    for name in wanted:
        if name not in vehicle.flow:
            says = f"flow: no {name}, allowed: a column for each of {', '.join(wanted)}"
            raise BadInput(f"vehicle {vehicle.name}: {says}")
    for one in (vehicle.airspeed, *(vehicle.flow[name] for name in wanted)):
        if one.column not in recording.columns:
            near = nearest_ten(one.column, recording.columns)
            says = f"no column {one.column}, allowed: a log that has it; it has {near}"
            raise BadInput(f"{recording.name}: {says}")


def _flow_of(aircraft: Aircraft) -> list[str]:
    return ["alpha_rad", "beta_rad", "qdyn_pa", *aircraft.signals]


def _order(vehicle: Vehicle, aircraft: Aircraft) -> list[int]:
    """Place of each of the aircraft's surfaces among the vehicle's."""
    return [list(vehicle.surfaces).index(name) for name in aircraft.surfaces]


def _rate_hz(samples: Samples) -> float:
    """Samples a second: of the first ones, so that a log cut short has the same; rounded to four digits."""
    first = samples.t_s[:_FEW]
    steps = np.diff(first)
    even = steps[np.abs(steps / samples.dt_s - 1.0) < _JITTER]
    rate_hz = float(f"{1.0 / (even.mean() if len(even) else samples.dt_s):.4g}")
    if not _SLOWEST_HZ <= rate_hz <= _FASTEST_HZ:
        says = f"an aircraft's model takes {_SLOWEST_HZ:g} to {_FASTEST_HZ:g} Hz"
        raise BadInput(f"{samples.name}: is logged at {rate_hz:g} Hz, allowed: {says}")
    return rate_hz


def _inputs(
    samples: Samples, recording: Recording, vehicle: Vehicle, aircraft: Aircraft, turning: bool
) -> tuple[list[Floats], dict[str, float]]:
    """Rates, signals, commands and attitude at each sample, as `stepped.inputs_of` has them; and the mean age
    of what is held, s. turning: whether the attitude is wanted."""
    columns, ages = in_si(recording, vehicle).columns, dict(samples.age_s)

    def measured(one: Quantity) -> Floats:
        values, age_s = at_samples(columns[one.column], samples.t_s, samples.dt_s)
        if age_s is not None:
            ages[one.column] = age_s
        return values

    alpha, beta, qdyn, *own = (measured(vehicle.flow[name]) for name in _flow_of(aircraft))
    assert vehicle.airspeed is not None  # as `_check` has seen
    signals = [alpha, beta, measured(vehicle.airspeed), qdyn, *own]
    order = _order(vehicle, aircraft)
    full = np.array([vehicle.full_deflection_rad.get(name, 1.0) for name in aircraft.surfaces])
    attitude = np.zeros_like(samples.rates)
    if turning:
        for i, angle in enumerate(_ATTITUDE):
            one = getattr(vehicle.attitude, angle) if vehicle.attitude else None
            if one is None or one.column not in columns:
                says = "is missing, allowed: its column, where fdi.bounds declares turbulence"
                raise BadInput(f"{samples.name}: attitude.{angle}: {says}")
            attitude[:, i] = measured(one)
    return [samples.rates, np.column_stack(signals), samples.commands[:, order] * full, attitude], ages


def _plausible(name: str, inputs: list[Floats], aircraft: Aircraft) -> None:
    """Raise BadInput where flow or commands are in another unit."""
    signals, commands = inputs[1], inputs[2]
    for i, angle in enumerate(("alpha_rad", "beta_rad")):
        largest = float(np.nanmedian(np.abs(signals[:, i])))
        if largest > 0.5 * pi:
            raise BadInput(f"{name}: flow.{angle} is {largest:.3g} in the middle, allowed: rad; `unit: deg`?")
    moving = signals[:, 2] > 0.5 * aircraft.envelope.airspeed_mps[0]
    density = 2.0 * signals[moving, 3] / signals[moving, 2] ** 2
    if density.size and not _DENSITY[0] < float(np.nanmedian(density)) < _DENSITY[1]:
        says = f"airspeed and flow.qdyn_pa make a density of {np.nanmedian(density):.3g} kg/m3"
        raise BadInput(
            f"{name}: {says}, allowed: {_DENSITY[0]:g} to {_DENSITY[1]:g}, true airspeed in m/s and Pa"
        )
    for s, surface in enumerate(aircraft.surfaces):
        stop = aircraft.travel[surface]
        furthest, reach = (
            max(abs(stop.min_rad), abs(stop.max_rad)),
            np.nanmax(np.abs(commands[:, s]), initial=0.0),
        )
        if reach > _BEYOND * furthest:
            says = f"the command of {surface} reaches {reach:.3g} rad, allowed: its stop, {furthest:.3g} rad"
            raise BadInput(f"{name}: {says}; full_deflection_rad says what 1 is")


def _stretches(samples: Samples, unknown: Mask, rate_hz: float) -> list[tuple[int, int]]:
    """Begin and end of what is diagnosed in one: evenly spaced and without a missing number."""
    uneven = np.abs(np.diff(samples.t_s) * rate_hz - 1.0) > _JITTER
    good = ~unknown
    joined = good[1:] & good[:-1] & ~uneven
    edges = np.flatnonzero(np.diff(np.concatenate([[False], joined, [False]]).astype(int)))
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(begin, end + 1) for begin, end in pairs if end + 1 - begin >= _FEW]


def _whole(n: int, surfaces: int, parts: list[tuple[int, int]], found: list[Stepped]) -> Stepped:
    """The stretches put together; nothing is said between them."""
    verdicts, low, high = [Verdict()] * n, np.zeros((n, surfaces)), np.ones((n, surfaces))
    gains = np.min([one.gains for one in found], axis=0)
    for (begin, end), one in zip(parts, found, strict=True):
        verdicts[begin:end], low[begin:end], high[begin:end] = one.verdicts, one.low, one.high
    return Stepped(verdicts, low, high, gains)


def _outside(
    signals: Floats, aircraft: Aircraft, unknown: Mask, parts: list[tuple[int, int]]
) -> dict[str, Mask]:
    """Rows of which the aircraft's model says nothing, by what is wrong."""
    slow, fast = aircraft.envelope.airspeed_mps
    low, high = aircraft.alpha_rad
    apart = np.ones(len(signals), dtype=bool)
    for begin, end in parts:
        apart[begin:end] = False
    airspeed, alpha = signals[:, 2], signals[:, 0]
    return {
        "a number is missing": unknown,
        "samples are not evenly spaced": apart & ~unknown,
        f"airspeed is outside {slow:g} to {fast:g} m/s": (airspeed < slow) | (airspeed > fast),
        f"angle of attack is outside {low:.3g} to {high:.3g} rad": (alpha < low) | (alpha > high),
    }


def _misled(t_s: Floats, parts: list[tuple[int, int]], stepped: Stepped) -> dict[str, Mask]:
    """Stretches that nothing explains from their first second on."""
    misled = np.zeros(len(t_s), dtype=bool)
    for begin, end in parts:
        soon = begin + int(np.searchsorted(t_s[begin:end], t_s[begin] + _AT_ONCE_S))
        if any(verdict.isolated == "unanticipated" for verdict in stepped.verdicts[begin:soon]):
            first = next(k for k in range(begin, soon) if stepped.verdicts[k].detected)
            misled[first:end] = True
    says = "no fault explains it from the first second on: another aircraft or loading, or undeclared errors"
    return {says: misled}


def _since(parts: list[tuple[int, int]], rows: Rows, reasons: dict[str, Mask]) -> dict[str, Mask]:
    """The reasons there are; an alarm that was raised where one holds is none in what follows."""
    gone, since = np.logical_or.reduce(list(reasons.values())), np.zeros(len(rows.t_s), dtype=bool)
    for begin, end in parts:
        alarmed = begin + np.flatnonzero(rows.faulty[begin:end])
        if alarmed.size and gone[alarmed[0]]:
            since[alarmed[0] : end] = True
    reasons = reasons | {"the alarm was raised where nothing can be said": since & ~gone}
    return {says: mask for says, mask in reasons.items() if mask.any()}


def _verdict(samples: Samples, rows: Rows, stepped: Stepped, by: Known, ages: dict[str, float]) -> Document:
    """The document of verdict.json."""
    surfaces = list(by.aircraft.surfaces)
    alarmed = np.flatnonzero(rows.faulty)
    last = stepped.verdicts[alarmed[-1]] if alarmed.size else Verdict()
    said = [k for k in alarmed.tolist() if stepped.verdicts[k].isolated == last.isolated]
    held = [
        f"{name} is held, {age:.2g} s old on average: errors declared have to cover it"
        for name, age in ages.items()
    ]
    return {
        "flight": samples.name,
        "aircraft": by.aircraft.name,
        "declared": by.declared,
        "duration_s": float(samples.t_s[-1] - samples.t_s[0]),
        "recorded_s": len(samples.t_s) * samples.dt_s,
        "gaps": int(samples.run[-1]),
        "rate_hz": 1.0 / samples.dt_s,
        "faulty": bool(alarmed.size),
        "detection_s": float(samples.t_s[alarmed[0]]) if alarmed.size else None,
        "isolation_s": float(samples.t_s[said[0]]) if last.isolated else None,
        "isolated": last.isolated,
        "type": last.type,
        "estimate": last.estimate,
        "candidates": list(last.candidates),
        "credible": trust.account(rows.reasons, rows.credible),
        "events": findings.events_of(rows, surfaces),
        "can_separate": _separable(rows, surfaces),
        "isolability": {"together": []},
        "notes": [*samples.notes, *held],
    }


def _separable(rows: Rows, surfaces: list[str]) -> list[str]:
    """The loss of each surface that is excluded within a second in half of the healthy rows."""
    quiet = (rows.faulty == 0) & (rows.credible == 1)
    if not quiet.any():
        return []
    losses = 1.0 - np.median(rows.low[quiet], axis=0)
    return [
        f"{name}: a loss of more than {100.0 * loss:.2g} % shows within a second in half of the flight."
        if loss < 1.0
        else f"{name}: in half of the flight not even a complete loss would show within a second."
        for name, loss in zip(surfaces, losses.tolist(), strict=True)
    ]


def as_text(verdict: Document) -> str:
    """The verdict in lines for people."""
    return f"{findings.as_text(verdict)}\n  report: {verdict['folder']}/report.html"
