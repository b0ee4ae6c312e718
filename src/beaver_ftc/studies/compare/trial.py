"""Fly one case with every scheme and law that is compared, and return the result of each."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import hypot, inf
from time import thread_time

from beaver_ftc.diagnosis.rivals import TunedValuesByGrade, flight_grade, load_tuned_values, tuned_values
from beaver_ftc.documents.errors import BeaverFtcError
from beaver_ftc.loop.loop import Loop
from beaver_ftc.loop.outcome import Landing
from beaver_ftc.plugins import DETECTORS, LAWS, is_compiled
from beaver_ftc.results.judgement import strikes_within
from beaver_ftc.results.metrics import measure
from beaver_ftc.results.model import Rates
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import Statistical
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.compare.replay import Trace, record, replay, trace
from beaver_ftc.studies.compare.sets import SetFlight
from beaver_ftc.studies.engine.statistics import or_never

SCHEME, LAW, ORACLE = "adaptive-estimators", "fault-tolerant", "oracle"
STATISTICAL = f"{SCHEME} with fdi.statistical"  # our scheme with its statistical detector beside it


@dataclass(frozen=True)
class Entry:
    """A scheme and a law that fly together."""

    scheme: str
    law: str


@dataclass(frozen=True)
class Result:
    """The result of an entry in a case. A time or an error that does not exist is infinite.

    - fault_free_s: time in which an alarm would be false, s. faulted: whether the fault begins in the flight.
    - delay_s, isolation_delay_s: from the fault to the alarm, and to its right name, s. correct: whether the
      name at the end is right, without a false alarm before the fault.
    - rms_deg_s: RMS tracking error of all axes after the fault, or of the whole flight without a fault;
      infinite after a departure. before_deg_s, after_deg_s: the same before and after the fault.
    - travel_deg_s: path of all surfaces over the time flown.
    - energy_deg2_s2: mean square of the speeds, (deg/s)2, summed over the surfaces; proportional to the power
      that viscous friction takes.
    - us: processor time of a frame, microseconds. error: why the flight failed, or None.
    """

    entry: Entry
    false_alarm: bool
    fault_free_s: float
    faulted: bool
    delay_s: float = inf
    correct: bool = False
    isolation_delay_s: float = inf
    rms_deg_s: float = inf
    departed: bool = False
    us: float = 0.0
    error: str | None = None
    before_deg_s: float = inf
    after_deg_s: float = inf
    travel_deg_s: float = inf
    energy_deg2_s2: float = inf


@dataclass
class Trial:
    """The results of one case of a set. traces: by scheme. failures: the reasons why traces are missing."""

    set: str
    results: list[Result] = field(default_factory=list)
    traces: dict[str, Trace] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)


def entries_of(schemes: Sequence[str], laws: Sequence[str]) -> list[Entry]:
    """Every scheme with our law, every law with our scheme, our own pair, and the oracle with our scheme."""
    pairs = [Entry(scheme, LAW) for scheme in schemes] + [Entry(SCHEME, law) for law in laws]
    return list(dict.fromkeys([*pairs, Entry(SCHEME, LAW), Entry(SCHEME, ORACLE)]))


def with_entry(scenario: Scenario, entry: Entry, chosen: TunedValuesByGrade | None = None) -> Scenario:
    """The scenario with this scheme and law, each with the values that were tuned for it on flights of this
    grade.

    chosen: tuned values as in tuned.json; without them, each flies with its defaults. Options in the scenario
    belong to the scheme and the law that the scenario names. For these, they replace the tuned values.
    """
    scheme = SCHEME if entry.scheme == STATISTICAL else entry.scheme
    scheme_options = scenario.fdi.options if scheme == scenario.fdi.scheme else {}
    fdi = scenario.fdi.with_scheme(scheme, dict(scheme_options))
    if entry.scheme == STATISTICAL and fdi.statistical is None:
        fdi = fdi.model_copy(update={"statistical": Statistical()})
    law_options = scenario.control.options if entry.law == scenario.control.law else {}
    control = scenario.control.model_copy(update={"law": entry.law, "options": law_options})
    changed = scenario.model_copy(update={"fdi": fdi, "control": control})
    grade = grade_of(scenario)
    for group, name, options in ((DETECTORS, entry.scheme, scheme_options), (LAWS, entry.law, law_options)):
        values = tuned_values(chosen or {}, grade, group, name)
        tuned = {k: v for k, v in values.items() if k not in options and not _is_set(scenario, k, group)}
        changed = with_values(changed, group, tuned)
    return changed


def _is_set(scenario: Scenario, key: str, group: str) -> bool:
    """Whether the scenario itself sets a parameter. Only a key with dots, such as
    `fdi.statistical.misnaming`, can be set there."""
    name = "fdi" if group == DETECTORS else "control"
    section, _, subkey = key.partition(".")
    return section == name and subkey.split(".")[0] in getattr(scenario, name).model_fields_set


def with_values(scenario: Scenario, group: str, values: Mapping[str, float]) -> Scenario:
    """The scenario with these values of its detector or law. A key with dots is a key of the scenario; any
    other is an option of the detector or law."""
    options = "fdi.options" if group == DETECTORS else "control.options"
    keys = {key if "." in key else f"{options}.{key}": value for key, value in values.items()}
    return scenario.with_(keys) if keys else scenario


def grade_of(scenario: Scenario) -> str:
    """The grade of flights that a scenario belongs to."""
    return flight_grade(not Declared.of(scenario).is_noise_free, scenario.known_actuators.is_ideal)


def fly_case(
    case: SetFlight,
    entries: Sequence[Entry],
    chosen: TunedValuesByGrade | None = None,
    trade_off: bool = True,
) -> Trial:
    """Fly a case with every entry, and record it under the nominal law for the trade-off of each scheme.

    chosen: tuned values of schemes and laws; None is the values that ship with the package. trade_off:
    whether to record the case, which fills `traces`.
    """
    chosen = load_tuned_values() if chosen is None else chosen
    trial = Trial(case.set, [_fly(case.scenario, entry, chosen) for entry in entries])
    if trade_off:
        schemes = dict.fromkeys(entry.scheme for entry in entries if entry.scheme != "none")
        _add_traces(trial, case.scenario, schemes, chosen)
    return trial


def _add_traces(trial: Trial, scenario: Scenario, schemes: Iterable[str], chosen: TunedValuesByGrade) -> None:
    """Record the scenario under the nominal law, and add the trace of each scheme over this flight."""
    try:
        recording = record(scenario)
    except BeaverFtcError as error:
        trial.failures.append(str(error))
        return
    for scheme in schemes:
        try:
            fdi = with_entry(scenario, Entry(scheme, LAW), chosen).fdi
            if scheme != SCHEME and (scheme == STATISTICAL or is_compiled(DETECTORS, scheme)):
                # only a flight with this compiled scheme has its statistic: the case is flown again
                with_scheme = record(scenario.model_copy(update={"fdi": fdi}))
                trial.traces[scheme] = trace(with_scheme, with_scheme.built_in)
            else:
                trial.traces[scheme] = replay(recording, scheme, fdi.options)
        except Exception as error:  # a plug-in may raise anything, and the comparison continues
            trial.failures.append(f"{scheme}, on a recorded flight: {type(error).__name__}: {error}")


def _fly(scenario: Scenario, entry: Entry, chosen: TunedValuesByGrade) -> Result:
    """The result of an entry; its `error` has the reason if the flight fails."""
    try:
        loop = Loop(with_entry(scenario, entry, chosen))
        began = thread_time()
        for _ in loop.chunks():
            pass
        flown_s = thread_time() - began
        flight = loop.land()
        loop.release()
        return result_of(flight, entry, 1e6 * flown_s / flight.frames)
    except BeaverFtcError as error:
        return Result(
            entry, false_alarm=False, fault_free_s=0.0, faulted=bool(scenario.faults), error=str(error)
        )


def result_of(flight: Landing, entry: Entry, us: float) -> Result:
    """The result of a flight. us: processor time of a frame, microseconds."""
    metrics = measure(flight)
    fault = metrics.fault
    tracking = metrics.tracking
    end_s = flight.frames / flight.scenario.rate_hz
    departed = metrics.departure is not None
    faulted = fault is not None and strikes_within(fault.at_s, end_s)
    rms_before, rms_after = _size(tracking.pre_fault_rms_deg_s), _size(tracking.post_fault_rms_deg_s)
    whole_flight = rms_before if tracking.post_fault_rms_deg_s is None else rms_after
    return Result(
        entry=entry,
        false_alarm=metrics.false_alarm,
        fault_free_s=metrics.fault_free_s,
        faulted=faulted,
        delay_s=or_never(metrics.detection.delay_s),
        correct=metrics.fault_named,
        isolation_delay_s=or_never(metrics.isolation.delay_s) if metrics.fault_named else inf,
        rms_deg_s=inf if departed else whole_flight,
        before_deg_s=inf if departed and not faulted else rms_before,
        after_deg_s=inf if departed else rms_after,
        travel_deg_s=sum(tracking.surface_travel_deg.values()) / end_s,
        energy_deg2_s2=sum(tracking.surface_energy_deg2_s.values()) / end_s,
        departed=departed,
        us=us,
    )


def _size(rms: Rates | None) -> float:
    """The RMS error over all axes, deg/s; infinite if the flight has no such part."""
    return inf if rms is None else hypot(*vars(rms).values())
