"""What a flight has yielded, read off its frame record: the verdict, the accounts, the promise of detection.

The instant from which detection was certain is found by frame.py for the worst-case filters of the
diagnosis in charge. It binds nobody where those filters raise no alarm (a plug-in, or the statistical test
in sole authority), where they were not asked any more (an alarm before the fault, or of the watch over the
instruments), and where what they are told is off by more than is declared (a broken instrument, undeclared
errors). Then nothing is said.

And in what share of its frames the diagnosis could conclude nothing, and why.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import degrees, isfinite
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft
from beaver_ftc.control.envelope_protection import BANK_LIMIT, FASTEST, SLOWEST
from beaver_ftc.control.profile import AT_ONE_INSTANT, CHANNELS, LIMITED, NOT_JUDGED, SPEED
from beaver_ftc.design import altitude_of
from beaver_ftc.diagnosis import Verdict
from beaver_ftc.diagnosis.conclusion import (
    PLUGIN_DECIDES,
    SENSOR_BROKEN,
    SEVERAL_POSSIBLE,
    SURFACE_REFUTED,
    TYPES_REFUTED,
)
from beaver_ftc.diagnosis.monitors.records import sensor_monitor_finding
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, ROLL, STATISTICAL_DETECTOR, UNANTICIPATED, YAW
from beaver_ftc.diagnosis.types.findings import estimate_fault_parameter, fault_finding_dict
from beaver_ftc.diagnosis.types.registry import TYPE_NAMES
from beaver_ftc.loop.frame import isolated_theta
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.sensing import DEPARTURE_SIGNALS
from beaver_ftc.scenario.diagnosis import MODES
from beaver_ftc.scenario.faults import of_a_sensor
from beaver_ftc.scenario.measured import (
    ALTITUDE,
    BETWEEN,
    LATE,
    Span,
    as_altitudes,
    lies_outside,
    measured_spans,
    outside,
    quantities,
)
from beaver_ftc.scenario.schema import Scenario, stages
from beaver_ftc.scenario.signals import is_before
from beaver_ftc.scenario.undeclared import declares_all

SCHEME, NO_DIAGNOSIS = "scheme", "no diagnosis ran: fdi.scheme is none"
Reason = dict[str, Any]


def inconclusive_of(frame: np.void, aircraft: Aircraft) -> dict[str, Any] | None:
    """share: of all frames; from_s: the first of them; reasons: each with its share, which may overlap, with
    the span that was measured and that flown outside of it. None if there was no such frame."""
    counted = frame["accounts"]["inconclusive"]
    if not counted["frames"]:
        return None
    watched = int(counted["watched"])
    reasons = sorted(_reasons(counted, aircraft, float(frame["t"])), key=lambda reason: -reason["share"])
    for reason in reasons:
        reason["share"] /= watched
    share = int(counted["frames"]) / watched
    return {"share": share, "from_s": float(counted["from_s"]), "reasons": reasons}


def _reasons(counted: np.void, aircraft: Aircraft, end_s: float) -> Iterator[Reason]:
    """Each reason that was one; share: still the number of frames."""
    spans = measured_spans(aircraft)
    if counted["undiagnosed"]:
        yield {**_reason(SCHEME, int(counted["undiagnosed"]), None, None), "says": NO_DIAGNOSIS}
    if counted["late"]:
        yield _reason(LATE, int(counted["late"]), spans[LATE], (spans[LATE][1], end_s))
    for i, name in enumerate(quantities(aircraft)):
        if counted["beyond"][i]:
            flown = float(counted["least"][i]), float(counted["greatest"][i])
            flown = as_altitudes(flown) if name == ALTITUDE else flown
            yield _reason(name, int(counted["beyond"][i]), spans[name], flown)
    if counted["between"]:
        yield _reason(BETWEEN, int(counted["between"]), None, None)


def _reason(quantity: str, frames: int, measured: Span | None, flown: Span | None) -> Reason:
    return {
        "quantity": quantity, "share": frames, "measured": measured, "flown": flown,
        "says": outside(quantity, measured),
    }  # fmt: skip


def inconclusive_now(frame: np.void, aircraft: Aircraft) -> str:
    """Why the built-in diagnosis can conclude nothing at the frame just flown; empty if it can."""
    error_map = frame["fdi"]["bound"]["error_map"]
    if not frame["fdi"]["config"]["enabled"]:
        return NO_DIAGNOSIS
    if not error_map["n_boxes"] or not error_map["outside"]:
        return ""
    spans, names = measured_spans(aircraft), quantities(aircraft)
    place = dict(zip(names, error_map["coordinates"].tolist(), strict=False)) | {
        LATE: float(error_map["time_s"])
    }
    place[ALTITUDE] = altitude_of(place[ALTITUDE])
    why = [outside(name, spans[name]) for name in lies_outside(place, spans)]
    return "; ".join(why) or outside(BETWEEN, None)


@dataclass(frozen=True)
class Landing:
    """What a flight has yielded: metrics, texts and rows of tables are views of it. A field that is called
    as a key of the metrics is that key. Times in s since the start, rates in rad/s, per axis (p, q, r).

    isolated: a surface, a sensor, unanticipated, or None while more than one fault fits
    (`candidates`; with them what damage that the aircraft declares may have taken). so_far: whether it is a
    surface that our schemes name, which they do by exclusion: it is the only one left, until data exclude it
    as well; None of a plug-in's and of nothing. withdrawn: spells in which a surface was named before,
    {fault, type, from_s, to_s, because}, the last the latest; withdrawn_types: the same of types of which a
    surface was named that still is. estimate: the isolated fault's parameter, theta in [-1, 0] for a loss of
    effectiveness; estimate_at_s: the instant that it is of, None for the last frame. windows: what was found
    in each spell with the same faults, as in windows.py. guaranteed_delay_s: from the fault to the instant
    from which detection was certain, None if that never came. worst_residual_ratio: largest |residual| /
    threshold in healthy flight; closest_approach: the same of each filter of the bank, the published one
    first.
    surface_travel_rad: path of each surface, up and down added. engine_power: if pitch was left to the
    engine, since when and for how long, s, and the lowest and highest manifold pressure, inHg. faults: of
    several at once (`fdi.pairs`), as in types/findings.py, the first named first. statistical: when the
    statistical detector would have raised the alarm, its level in standard deviations, and the largest
    share of it reached in healthy flight. mode_changes, exits: how many there were of `supervisor` and
    `envelope_exits`, which hold the first and the last; the end of an exit that is still open is the end of
    the flight, and outside_at_end says that it is open. outside_s: time outside the validated envelope, all
    exits together. end: airspeed, m/s, and altitude, m, at the end. profile: largest deviation from
    the commanded one by channel of the autopilot, m, m/s, rad; None where it was not flown. arrival: the
    deviation through a lag of 10 s, with its sign. limits: of each limit that protection has put on
    the command since when, on what (airspeed_mps, bank_deg), "at most" or "at least", its value at last,
    why, and whether it is in force at the end. changes: what was changed in flight: time_s; law and
    scheme, None for what was not; sensors, True or False; and of a diagnosis that was replaced
    detection_time_s and isolated. The verdict above is the last diagnosis'. inconclusive: in what share of
    the frames the built-in diagnosis could conclude nothing, and why, as in `inconclusive_of`; else None.
    """

    scenario: Scenario
    frames: int
    columns: tuple[str, ...]
    detection_time_s: float | None
    detection_axis: str | None
    guaranteed_delay_s: float | None
    isolation_time_s: float | None
    isolated: str | None
    isolation_type: str | None
    candidates: tuple[str, ...]
    estimate: float | None
    pre_fault_rms_rad_s: tuple[float, float, float]
    post_fault_rms_rad_s: tuple[float, float, float] | None
    supervisor: tuple[tuple[float, str], ...]
    envelope_exits: tuple[tuple[float, float], ...]
    departure: tuple[float, str] | None
    saturation_s: dict[str, float]
    worst_residual_ratio: float
    closest_approach: tuple[float, ...] = ()
    surface_travel_rad: dict[str, float] = field(default_factory=dict)
    surface_energy_rad2_s: dict[str, float] = field(default_factory=dict)
    type_time_s: float | None = None
    estimate_interval: tuple[float, float] | None = None
    frequency_rad_s: float | None = None
    authority: dict[str, dict[str, float]] | None = None
    probing_s: tuple[float, float] | None = None
    engine_power: dict[str, float] | None = None
    faults: tuple[dict[str, Any], ...] = ()
    statistical: dict[str, float | None] | None = None
    mode_changes: int = 0
    exits: int = 0
    outside_s: float = 0.0
    outside_at_end: bool = False
    end: tuple[float, float] | None = None
    profile: dict[str, float | None] | None = None
    arrival: dict[str, float | None] | None = None
    limits: tuple[dict[str, Any], ...] = ()
    changes: tuple[dict[str, Any], ...] = ()
    so_far: bool | None = None
    withdrawn: tuple[dict[str, Any], ...] = ()
    withdrawn_types: tuple[dict[str, Any], ...] = ()
    windows: tuple[dict[str, Any], ...] = ()
    estimate_at_s: float | None = None
    inconclusive: dict[str, Any] | None = None


def _instant(seconds: float) -> float | None:
    return float(seconds) if seconds >= 0.0 else None


def _rms(square_sum: np.ndarray, frames: int) -> tuple[float, float, float] | None:
    if frames == 0:
        return None
    p, q, r = np.sqrt(square_sum / frames)
    return float(p), float(q), float(r)


def _estimate(fdi: np.void, surface: int) -> float:
    """theta of the isolated loss. Compiled code is asked only where it must be: the first call from Python
    takes a quarter of a second."""
    if fdi["statistical"]["test"]["enabled"]:
        return float(isolated_theta(fdi, surface))
    axis, estimator = int(fdi["layout"]["dominant_axis"][surface]), int(fdi["verdict"]["isolated_estimator"])
    return float(fdi["isolation"]["estimator"][estimator]["theta"][axis])


def _isolation(fdi: np.void, surfaces: Sequence[str]) -> dict[str, Any]:
    """isolated, isolation_type, candidates, estimate, isolation_time_s of a Landing."""
    if fdi["config"]["diagnoses_all_types"]:
        return fault_finding_dict(fdi, surfaces)
    isolated = int(fdi["verdict"]["isolated_estimator"])
    said: dict[str, Any] = {"isolated": None, "isolation_type": None, "estimate": None, "candidates": ()}
    said["isolation_time_s"] = None
    if not fdi["verdict"]["detected"]:
        return said
    if isolated == UNANTICIPATED:
        said |= {"isolated": "unanticipated", "isolation_type": "unanticipated"}
    else:
        estimators = fdi["isolation"]["estimator"][: int(fdi["isolation"]["config"]["n_estimators"])]
        left = [surfaces[int(fie["surface"])] for fie in estimators if not fie["excluded"]]
        if isolated == NOT_ISOLATED:  # a loss that is excluded is no damage excluded
            left += [
                s for s, taken in zip(surfaces, fdi["isolation"]["config"]["losable"], strict=True) if taken
            ]
        said["candidates"] = tuple(dict.fromkeys(left))
    if isolated >= 0:
        surface = int(fdi["isolation"]["estimator"][isolated]["surface"])
        said |= {"isolated": surfaces[surface], "isolation_type": "loss_of_effectiveness"}
        said["estimate"] = _estimate(fdi, surface)
    if isolated != NOT_ISOLATED:
        said["isolation_time_s"] = float(fdi["verdict"]["isolated_at_s"])
    return said


def _envelope_exits(frame: np.void) -> tuple[tuple[float, float], ...]:
    envelope, end_s = frame["accounts"]["envelope"], int(frame["k"]) * float(frame["dt"])
    known = slice(int(envelope["n_exits"]))  # as many as there is room for
    exits = zip(envelope["exit_at_s"][known], envelope["return_at_s"][known], strict=True)
    return tuple((float(out), float(back) if isfinite(back) else end_s) for out, back in exits)


def _probing_s(frame: np.void) -> tuple[float, float] | None:
    """When the active diagnosis began and ended."""
    probe = frame["control"]["probe"]
    began, ended = float(probe["memory"]["from_s"]), float(probe["memory"]["to_s"])
    if not probe["config"]["frames"] or began < 0.0:
        return None
    return began, (ended if ended >= 0.0 else float(frame["t"]))


def _authority(frame: np.void) -> dict[str, dict[str, float]] | None:
    """Per axis, after the fault: share of the demanded acceleration given, and for how long what holds the
    rates was beyond what the surfaces can give. Where they are more than lead the axes also what is left at
    the end, as far as the law knows, and what a healthy aircraft has there; with engines as effectors too."""
    if not frame["accounts"]["tracking"]["frames_since"]:
        return None
    authority, sums = {}, frame["accounts"]["authority"]
    each = zip(AXES, sums["demanded"], sums["lacking"], sums["beyond_frames"], strict=True)
    for axis, asked, lack, beyond in each:
        share = 1.0 - float(lack / asked) if asked > 0.0 else 1.0
        authority[axis] = {"given_share": share, "beyond_s": int(beyond) * float(frame["dt"])}
    control = frame["control"]
    has_more = control["layout"]["general"] or control["engines"]["config"]["n"]
    if has_more and np.any(control["axes"]["G"]):
        for i, axis in enumerate(AXES):
            authority[axis] |= _left(frame, i)
    return authority


def _left(frame: np.void, i: int) -> dict[str, float]:
    """What all surfaces together give about axis i at most, either way, rad/s2: what is believed to be left,
    and healthy; and what the engines give beside them, where they are effectors."""
    stops = frame["control"]["layout"]["low"], frame["control"]["layout"]["high"]
    left = np.array([frame["control"]["axes"]["G"][i] * stop for stop in stops])
    healthy = np.array([frame["prediction"]["G"][i] * stop for stop in stops])
    engines = frame["control"]["engines"]["output"]["authority"][:, i]
    given = {"engines_least_rad_s2": float(engines[0]), "engines_greatest_rad_s2": float(engines[1])}
    return {
        "least_rad_s2": float(left.min(axis=0).sum()),
        "greatest_rad_s2": float(left.max(axis=0).sum()),
        "healthy_least_rad_s2": float(healthy.min(axis=0).sum()),
        "healthy_greatest_rad_s2": float(healthy.max(axis=0).sum()),
    } | (given if frame["control"]["engines"]["config"]["n"] else {})


def _engine_power(frame: np.void) -> dict[str, float] | None:
    """Since when and for how long pitch was left to the engine, and how far it went; None if it never was."""
    enabled, power = frame["control"]["power"]["config"]["enabled"], frame["control"]["power"]["output"]
    if not enabled or power["from_s"] < 0.0:
        return None
    return {
        "from_s": float(power["from_s"]),
        "in_charge_s": int(power["frames"]) * float(frame["dt"]),
        "lowest_inhg": float(power["least"]),
        "highest_inhg": float(power["greatest"]),
    }


def _by_channel(frame: np.void, off: str) -> dict[str, float | None] | None:
    """A deviation from the commanded profile, by channel, None where it is not flown; None without any."""
    autopilot = frame["autopilot"]
    if not autopilot["enabled"]:
        return None
    flown = zip(CHANNELS, autopilot["is_commanded"], autopilot[off], strict=True)
    return {name: float(away) if commanded else None for name, commanded, away in flown}


def _profile(frame: np.void) -> dict[str, float | None] | None:
    """Largest deviation from the commanded profile, by channel; None where there is none, and of angles that
    had no time to settle."""
    off, autopilot = _by_channel(frame, "largest_deviation"), frame["autopilot"]
    if off is None:
        return None
    judged = {name: None if away == NOT_JUDGED else away for name, away in off.items()}
    of_speed = {
        LIMITED: autopilot["largest_deviation_from_airspeed_to_fly"],
        AT_ONE_INSTANT: autopilot["largest_instant_airspeed_deviation"],
    }
    flown = autopilot["is_commanded"][SPEED]
    return judged | {name: float(off) if flown else None for name, off in of_speed.items()}


def _limits(frame: np.void, surfaces: Sequence[str]) -> tuple[dict[str, Any], ...]:
    """What envelope protection has limited, in the order in which the limits began; value: at last, airspeed
    in m/s, bank in deg."""
    if not frame["autopilot"]["enabled"]:
        return ()
    holding, main = frame["autopilot"]["holding"], frame["control"]["layout"]["main"]
    effectiveness = frame["control"]["surfaces"]["output"]["effectiveness"]
    pitch = f"{surfaces[main[PITCH]]} acts as at {degrees(holding['mean_acting_elevator']):.1f} deg"
    lateral = min((main[ROLL], main[YAW]), key=lambda s: float(effectiveness[s]))
    left = f"{100 * effectiveness[lateral]:.0f} % of the {surfaces[lateral]} left"
    kinds = (
        (FASTEST, "airspeed_mps", "at most", pitch),
        (SLOWEST, "airspeed_mps", "at least", pitch),
        (BANK_LIMIT, "bank_deg", "at most", left),
    )
    began = []
    for k, what, side, why in kinds:
        if holding["from_s"][k] >= 0.0:
            value = degrees(holding["value"][k]) if k == BANK_LIMIT else float(holding["value"][k])
            said = {"time_s": float(holding["from_s"][k]), "limits": what, "side": side, "value": value}
            began.append(said | {"because": why, "in_force": bool(holding["in_force"][k])})
    return tuple(sorted(began, key=lambda limit: tuple(limit.values())))


def _statistical(fdi: np.void) -> dict[str, float | None] | None:
    """What the statistical detector made of the flight, if there was one."""
    tests, alarm = fdi["statistical"]["test"], fdi["statistical"]["alarm"]
    if not tests["enabled"]:
        return None
    return {
        "time_s": _instant(alarm["detected_at_s"]),
        "alarm_level": float(tests["alarm_level"]),
        "closest_approach": float(alarm["peak"]),
    }


def _alarm(fdi: np.void) -> dict[str, Any]:
    """detection_time_s and detection_axis of a Landing."""
    verdict = fdi["verdict"]
    return {
        "detection_time_s": _instant(verdict["detected_at_s"]),
        "detection_axis": AXES[int(verdict["axis"])] if verdict["detected"] else None,
    }


def _findings(frame: np.void, surfaces: Sequence[str]) -> dict[str, Any]:
    """What `_alarm` and `_isolation` have, of surfaces, of an instrument, or of both."""
    fdi, monitor = frame["fdi"], frame["fdi"]["sensor_monitor"]["output"]
    broken = sensor_monitor_finding(fdi["sensor_monitor"], float(frame["t"]))
    if broken is not None:
        broken["so_far"] = False if broken["isolated"] else None
        if not monitor["keeps_surface"]:
            return {"detection_axis": None, **broken}
    alarm, said = _alarm(fdi), _isolation(fdi, surfaces)
    said["so_far"] = None if said["isolated"] is None else said["isolated"] in surfaces
    if broken is None:
        return alarm | said
    if said["isolated"] in surfaces:  # its estimate is of the last frame with a sound sensor
        said["estimate_at_s"] = float(monitor["alarmed_at_s"]) - float(frame["dt"])
        if not fdi["config"]["diagnoses_all_types"]:
            effectiveness = frame["assessment"]["effectiveness"][surfaces.index(said["isolated"])]
            said["estimate"] = float(effectiveness) - 1.0
    found = said.get("faults") or (said,)
    parts = (*found, broken) if said["isolated"] else (broken, *found)
    return {**parts[0], **alarm, "faults": parts}


_WHY_WITHDRAWN = {
    SURFACE_REFUTED: "no fault of it explains the measurements",
    TYPES_REFUTED: "no fault type explains the measurements",
    SENSOR_BROKEN: "a sensor is broken",
    PLUGIN_DECIDES: "the detector gave another verdict",
    SEVERAL_POSSIBLE: "it is no longer the only explanation",
}


def _withdrawn(gone: np.ndarray, surfaces: Sequence[str]) -> tuple[dict[str, Any], ...]:
    """What was named and is not any more, with the reason, as many as there is room for."""
    return tuple(
        {
            "fault": surfaces[int(one["surface"])], "from_s": float(one["from_s"]),
            "to_s": float(one["to_s"]),
            "type": TYPE_NAMES[int(one["fault_type"])] if one["fault_type"] >= 0 else None,
            "because": _WHY_WITHDRAWN[int(one["reason"])],
        }
        for one in gone
    )  # fmt: skip


def found_so_far(frame: np.void, surfaces: Sequence[str], verdict: Verdict | None) -> dict[str, Any]:
    """Alarm and names as of the frame just flown; verdict: of a plug-in detector, the last one."""
    return _findings(frame, surfaces) if verdict is None else _of_verdict(frame["fdi"], verdict)


def verdict_of(frame: np.void, surfaces: Sequence[str]) -> Verdict:
    """What the built-in diagnosis makes of the flight so far, as a plug-in law is given it."""
    fdi = frame["fdi"]
    if not (fdi["verdict"]["detected"] or fdi["sensor_monitor"]["output"]["alarmed"]):
        return Verdict()
    said = _findings(frame, surfaces)
    return Verdict(
        detected=True,
        axis=said["detection_axis"],
        isolated=said["isolated"],
        type=said["isolation_type"],
        estimate=said["estimate"],
        candidates=said["candidates"],
    )


def words_follow_from(fdi: np.void) -> bytes:
    """What a verdict of the built-in diagnosis follows from, but for its estimate: others, if it changes."""
    types, surfaces = fdi["types"], fdi["types"]["surface"]
    evidence = surfaces["evidence"]
    brief = evidence["n_anomalous"] - evidence["n_rest"] < types["config"]["half_frames"]
    excluded = fdi["isolation"]["estimator"]["excluded"], surfaces["sets"]["excluded"]
    parts = fdi["verdict"], types["pair"]["group_alarm"], surfaces["status"], brief, *excluded
    return b"".join(part.tobytes() for part in parts)


def estimate_now(fdi: np.void, said: Verdict, surfaces: Sequence[str]) -> float | None:
    """The estimate of a verdict that otherwise still stands, of a diagnosis for every type."""
    surface, types = surfaces.index(str(said.isolated)), fdi["types"]
    pairs = types["pair"]["enabled"]
    status = types["surface"][surface]["status"] if pairs else fdi["verdict"]
    return estimate_fault_parameter(fdi, surface, int(status["fault_type"]))


def _of_verdict(fdi: np.void, verdict: Verdict) -> dict[str, Any]:
    """The same of a Landing, from a plug-in's verdict."""
    said = verdict if fdi["verdict"]["detected"] else Verdict()
    return _alarm(fdi) | {
        "isolated": said.isolated,
        "isolation_type": said.type if said.isolated else None,
        "candidates": tuple(said.candidates),
        "estimate": said.estimate if said.isolated else None,
        "isolation_time_s": float(fdi["verdict"]["isolated_at_s"]) if said.isolated else None,
    }


def guaranteed_delay_s(frame: np.void, scenario: Scenario, plugged: bool) -> float | None:
    """From the fault's first frame to the instant from which its alarm was certain, s; plugged: the detector
    is a plug-in."""
    certain_s = float(frame["accounts"]["guarantee"]["certain_after_s"])
    truth, fdi = frame["truth"], frame["fdi"]
    if certain_s < 0.0 or not truth["faulted"] or plugged:
        return None
    fault_s, verdict = float(truth["fault_at_s"]), fdi["verdict"]
    early = verdict["detected"] and is_before(verdict["detected_at_s"], fault_s)
    if (
        early
        or fdi["config"]["authority"] == STATISTICAL_DETECTOR
        or fdi["sensor_monitor"]["output"]["alarmed"]
    ):
        return None
    return None if _is_off(scenario, certain_s) else certain_s - fault_s


def _is_off(scenario: Scenario, certain_s: float) -> bool:
    """Whether by then an input of the diagnosis was off by more than its declared bound."""
    if any(of_a_sensor(fault) and fault.at_s <= certain_s for fault in scenario.faults):
        return True
    flown = [scenario, *(then for change, then in stages(scenario) if change.at_s <= certain_s)]
    return not all(map(declares_all, flown))


def landing_of(
    scenario: Scenario,
    frame: np.void,
    columns: tuple[str, ...],
    verdict: Verdict | None = None,
    replaced: tuple[dict[str, Any], ...] = (),
    windows: tuple[dict[str, Any], ...] = (),
) -> Landing:
    """Read the flight's outcome off its frame record; `verdict` is a plug-in detector's last one, `replaced`
    what changes in flight have ended, `windows` what was found in each."""
    fdi, accounts, dt = frame["fdi"], frame["accounts"], float(frame["dt"])
    tracking, envelope, supervisor = accounts["tracking"], accounts["envelope"], frame["supervisor"]
    surfaces, departed, found = scenario.airframe.surfaces, int(frame["departed"]), fdi["verdict"]
    known = slice(int(supervisor["n_modes"]))  # as many as there is room for
    modes = zip(supervisor["mode_at_s"][known], supervisor["mode_is"][known], strict=True)
    n_filters = max(int(fdi["bank"]["config"]["n_filters"]), 1)
    closest = tuple(fdi["bank"]["output"]["peak"][:n_filters].tolist())

    def by_surface(values: np.ndarray) -> dict[str, float]:
        return dict(zip(surfaces, values.tolist(), strict=True))

    return Landing(
        scenario=scenario,
        frames=int(frame["k"]),
        columns=columns,
        guaranteed_delay_s=guaranteed_delay_s(frame, scenario, verdict is not None),
        pre_fault_rms_rad_s=_rms(tracking["before"], int(tracking["frames_before"])) or (0.0, 0.0, 0.0),
        post_fault_rms_rad_s=_rms(tracking["since"], int(tracking["frames_since"])),
        supervisor=tuple((float(at_s), MODES[mode]) for at_s, mode in modes),
        mode_changes=int(supervisor["n_modes"]),
        envelope_exits=_envelope_exits(frame),
        exits=int(envelope["n_exits"]),
        outside_s=int(envelope["outside_frames"]) * dt,
        outside_at_end=bool(envelope["outside"]),
        end=(float(frame["truth"]["value"][ch.AIRSPEED]), float(frame["truth"]["value"][ch.ALTITUDE])),
        departure=(float(frame["t"]), DEPARTURE_SIGNALS[departed // 10]) if departed else None,
        saturation_s=by_surface(accounts["saturated_frames"] * dt),
        worst_residual_ratio=max(*closest, float(fdi["statistical"]["alarm"]["peak"])),
        statistical=_statistical(fdi),
        closest_approach=closest,
        authority=_authority(frame),
        probing_s=_probing_s(frame),
        engine_power=_engine_power(frame),
        profile=_profile(frame),
        arrival=_by_channel(frame, "mean_deviation"),
        limits=_limits(frame, surfaces),
        changes=replaced,
        withdrawn=_withdrawn(found["gone"][: int(found["n_gone"])], surfaces),
        withdrawn_types=_withdrawn(found["withdrawn_types"][: int(found["n_gone_types"])], surfaces),
        windows=windows,
        inconclusive=None if verdict is not None else inconclusive_of(frame, scenario.airframe),
        surface_travel_rad=by_surface(accounts["actuator_travel"]),
        surface_energy_rad2_s=by_surface(accounts["actuator_energy"]),
        **found_so_far(frame, surfaces, verdict),
    )
