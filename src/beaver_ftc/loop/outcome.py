"""What a flight has yielded, read off its frame record: the verdict, the accounts, the guaranteed detection.

accounts.py finds the instant from which detection was certain, for the worst-case filters of the diagnosis.
There is no guarantee where these filters raise no alarm (a plug-in, or the statistical test in sole
authority), where they were no longer evaluated (an alarm before the fault, or of the sensor monitor), and
where an input was off by more than is declared (a broken sensor, undeclared errors).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import degrees, isfinite
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.control.envelope_protection import BANK_LIMIT, FASTEST, SLOWEST
from beaver_ftc.control.profile import AT_ONE_INSTANT, CHANNELS, LIMITED, NOT_JUDGED, SPEED
from beaver_ftc.diagnosis import Verdict
from beaver_ftc.diagnosis.conclusion import (
    PLUGIN_DECIDES,
    SENSOR_BROKEN,
    SEVERAL_POSSIBLE,
    SURFACE_REFUTED,
    TYPES_REFUTED,
)
from beaver_ftc.diagnosis.state import PITCH, ROLL, STATISTICAL_DETECTOR, YAW
from beaver_ftc.diagnosis.types.registry import TYPE_NAMES
from beaver_ftc.loop.findings import found_so_far, instant
from beaver_ftc.loop.inconclusive import inconclusive_of
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.sensing import DEPARTURE_SIGNALS
from beaver_ftc.scenario.diagnosis import MODES
from beaver_ftc.scenario.faults import of_a_sensor
from beaver_ftc.scenario.schema import Scenario, stages
from beaver_ftc.scenario.signals import is_before
from beaver_ftc.scenario.undeclared import declares_all


@dataclass(frozen=True)
class Landing:
    """What a flight has yielded: metrics, texts and rows of tables are views of it.

    A field with the name of a key of the metrics is that key. Times are in s since the start, rates in rad/s,
    per axis (p, q, r).
    """

    scenario: Scenario
    frames: int
    columns: tuple[str, ...]
    detection_time_s: float | None
    detection_axis: str | None
    guaranteed_delay_s: float | None  # from the fault to when detection was certain; None if it never was
    isolation_time_s: float | None
    isolated: str | None  # a surface, a sensor, unanticipated; None while more than one fault fits
    isolation_type: str | None
    candidates: tuple[str, ...]  # what fits; of several, also what damage that the aircraft declares may take
    estimate: float | None  # parameter of the isolated fault: theta in [-1, 0] of a loss of effectiveness
    pre_fault_rms_rad_s: tuple[float, float, float]
    post_fault_rms_rad_s: tuple[float, float, float] | None
    # The first and the last of `mode_changes` and `exits`, as many as the records hold; an exit that is open
    # ends with the flight.
    supervisor: tuple[tuple[float, str], ...]
    envelope_exits: tuple[tuple[float, float], ...]
    departure: tuple[float, str] | None
    saturation_s: dict[str, float]
    worst_residual_ratio: float  # largest |residual| / threshold in healthy flight
    closest_approach: tuple[float, ...] = ()  # the same of each filter of the bank, the published one first
    surface_travel_rad: dict[str, float] = field(default_factory=dict)  # path, up and down added
    surface_energy_rad2_s: dict[str, float] = field(default_factory=dict)
    type_time_s: float | None = None
    estimate_interval: tuple[float, float] | None = None
    frequency_rad_s: float | None = None
    authority: dict[str, dict[str, float]] | None = None
    probing_s: tuple[float, float] | None = None
    engine_power: dict[str, float] | None = None  # see `_engine_power`
    faults: tuple[
        dict[str, Any], ...
    ] = ()  # of several at once: as in types/findings.py, by time of the name
    # When the statistical detector would have raised the alarm, its level in standard deviations, and the
    # largest share of it in healthy flight.
    statistical: dict[str, float | None] | None = None
    mode_changes: int = 0
    exits: int = 0
    outside_s: float = 0.0  # outside the validated envelope, all exits together
    outside_at_end: bool = False  # whether the last exit is still open
    end: tuple[float, float] | None = None  # airspeed, m/s, and altitude, m
    # By channel of the autopilot, m, m/s, rad, None where it was not flown: the largest deviation from the
    # command, and the deviation through a lag of 10 s at the end, with its sign.
    profile: dict[str, float | None] | None = None
    arrival: dict[str, float | None] | None = None
    limits: tuple[dict[str, Any], ...] = ()  # see `_limits`
    changes: tuple[dict[str, Any], ...] = ()  # see changing.py; the verdict above is the last diagnosis'
    # Whether `isolated` is a surface, which our schemes name by exclusion: the name stands until data exclude
    # that surface as well. None of a plug-in's verdict and of none.
    so_far: bool | None = None
    # Spells in which a surface was named before, {fault, type, from_s, to_s, because}, the last the latest;
    # and the same of types of which a surface was named that still is.
    withdrawn: tuple[dict[str, Any], ...] = ()
    withdrawn_types: tuple[dict[str, Any], ...] = ()
    windows: tuple[dict[str, Any], ...] = ()  # what was found in each spell with the same faults: windows.py
    estimate_at_s: float | None = None  # when `estimate` is of; None for the last frame
    inconclusive: dict[str, Any] | None = None  # see `inconclusive_of`; None of a plug-in's diagnosis


def _rms(square_sum: np.ndarray, frames: int) -> tuple[float, float, float] | None:
    if frames == 0:
        return None
    p, q, r = np.sqrt(square_sum / frames)
    return float(p), float(q), float(r)


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


def _statistical(frame: np.void) -> dict[str, float | None] | None:
    """What the statistical detector made of the flight, if there was one."""
    tests, alarm = (frame["fdi"]["statistical"][part] for part in ("test", "alarm"))
    if not tests["enabled"]:
        return None
    return {
        "time_s": instant(alarm["detected_at_s"]),
        "alarm_level": float(tests["alarm_level"]),
        "closest_approach": float(frame["accounts"]["closest"]["score"]),
    }


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
    verdict: Verdict | None,
    replaced: tuple[dict[str, Any], ...],
    windows: tuple[dict[str, Any], ...],
) -> Landing:
    """Read the flight's outcome off its frame record; `verdict` is a plug-in detector's last one, `replaced`
    what changes in flight have ended, `windows` what was found in each."""
    fdi, accounts, dt = frame["fdi"], frame["accounts"], float(frame["dt"])
    tracking, envelope, supervisor = accounts["tracking"], accounts["envelope"], frame["supervisor"]
    surfaces, departed, found = scenario.airframe.surfaces, int(frame["departed"]), fdi["verdict"]
    known = slice(int(supervisor["n_modes"]))  # as many as there is room for
    modes = zip(supervisor["mode_at_s"][known], supervisor["mode_is"][known], strict=True)
    n_filters = max(int(fdi["bank"]["config"]["n_filters"]), 1)
    closest = tuple(accounts["closest"]["filter"][:n_filters].tolist())

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
        worst_residual_ratio=max(*closest, float(accounts["closest"]["score"])),
        statistical=_statistical(frame),
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
