"""What a flight has yielded (`Landing`), read off its frame record: findings of the diagnosis; accounts."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import degrees, isfinite
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES, PITCH, ROLL, YAW
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
from beaver_ftc.diagnosis.types.registry import TYPE_NAMES
from beaver_ftc.loop.findings import found_so_far, instant
from beaver_ftc.loop.guarantee import guaranteed_delay_s
from beaver_ftc.loop.inconclusive import inconclusive_of
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.sensing import DEPARTURE_SIGNALS
from beaver_ftc.scenario.diagnosis import MODES
from beaver_ftc.scenario.schema import Scenario

Found = dict[str, Any]  # by the keys of the metrics


@dataclass(frozen=True)
class Landing:
    """What a flight has yielded: metrics, texts and rows of tables are views of it.

    A field with the name of a key of the metrics is that key (results/model.py). Times are in s since the
    start, rates in rad/s, per axis (p, q, r). None: there is none.

    of the diagnosis, by findings.py; of the last one, if it was changed in flight:

    isolated               a surface, a sensor, unanticipated; None while more than one fault fits
    candidates             what fits; of several, also what damage that the aircraft declares may take
    estimate               parameter of the isolated fault: theta in [-1, 0] of a loss of effectiveness
    estimate_at_s          when `estimate` is of; None for the last frame
    so_far                 whether `isolated` is a surface, which our schemes name by exclusion: the name
                           stands until data exclude that surface as well; None of a plug-in's verdict
    faults                 of several at once: a finding each, by time of the name
    withdrawn, _types      spells in which a surface was named before, the last the latest; and the same of
                           types of which a surface was named that still is
    guaranteed_delay_s     from the fault to when detection was certain; None if it never was
    statistical            alarm of the statistical detector, its level in standard deviations, and the
                           largest share of it in healthy flight
    windows                what was found in each spell with the same faults (windows.py)
    changes                what was changed in flight (changing.py)
    inconclusive           when nothing could be concluded (inconclusive.py); None of a plug-in's diagnosis

    of the accounts:

    worst_residual_ratio   largest |residual| / threshold in healthy flight
    closest_approach       the same of each filter of the bank, the published one first
    supervisor             (time, mode) of the first and the last of `mode_changes`, as many as are recorded
    envelope_exits         (from, to) of the first and the last of `exits`; an open one ends with the flight
    outside_s              outside the validated envelope, all exits together
    outside_at_end         whether the last exit is still open
    end                    airspeed, m/s, and altitude, m
    surface_travel_rad     path of each surface, up and down added
    profile, arrival       by channel of the autopilot, m, m/s, rad, None where it was not flown: the largest
                           deviation from the command, and that through a lag of 10 s at the end, with sign
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
    faults: tuple[Found, ...] = ()
    statistical: dict[str, float | None] | None = None
    mode_changes: int = 0
    exits: int = 0
    outside_s: float = 0.0
    outside_at_end: bool = False
    end: tuple[float, float] | None = None
    profile: dict[str, float | None] | None = None
    arrival: dict[str, float | None] | None = None
    limits: tuple[Found, ...] = ()
    changes: tuple[Found, ...] = ()
    so_far: bool | None = None
    withdrawn: tuple[Found, ...] = ()
    withdrawn_types: tuple[Found, ...] = ()
    windows: tuple[Found, ...] = ()
    estimate_at_s: float | None = None
    inconclusive: Found | None = None


def _rms(square_sum: np.ndarray, frames: int) -> tuple[float, float, float] | None:
    """Root of the mean of each axis; None without frames."""
    if frames == 0:
        return None
    p, q, r = np.sqrt(square_sum / frames).tolist()
    return p, q, r


def _envelope_exits(frame: np.void) -> tuple[tuple[float, float], ...]:
    """When the flight left the envelope, and when it came back: of the exits that there is room for."""
    envelope, end_s = frame["accounts"]["envelope"], int(frame["k"]) * float(frame["dt"])
    n = int(envelope["n_exits"])
    exits = zip(envelope["exit_at_s"][:n].tolist(), envelope["return_at_s"][:n].tolist(), strict=True)
    return tuple((out, back if isfinite(back) else end_s) for out, back in exits)


def _probing_s(frame: np.void) -> tuple[float, float] | None:
    """When the active diagnosis began and ended."""
    probe = frame["control"]["probe"]
    began, ended = float(probe["memory"]["from_s"]), float(probe["memory"]["to_s"])
    if not probe["config"]["frames"] or began < 0.0:
        return None
    return began, (ended if ended >= 0.0 else float(frame["t"]))


def _authority(frame: np.void) -> dict[str, dict[str, float]] | None:
    """Per axis, after the fault: share of the demanded acceleration that was given, and for how long what
    holds the rates was beyond what the surfaces can give. If there are further surfaces than the leading
    ones, or engines as effectors, also the ranges of acceleration at the end."""
    if not frame["accounts"]["tracking"]["frames_since"]:
        return None
    sums, control = frame["accounts"]["authority"], frame["control"]
    has_more = control["layout"]["general"] or control["engines"]["config"]["n"]
    has_ranges = has_more and np.any(control["axes"]["G"])
    authority = {}
    for i, axis in enumerate(AXES):
        asked, lack = sums["demanded"][i], sums["lacking"][i]
        authority[axis] = {
            "given_share": 1.0 - float(lack / asked) if asked > 0.0 else 1.0,
            "beyond_s": int(sums["beyond_frames"][i]) * float(frame["dt"]),
            **(_ranges(frame, i) if has_ranges else {}),
        }
    return authority


def _ranges(frame: np.void, i: int) -> dict[str, float]:
    """Least and greatest acceleration about axis i, rad/s2, that all surfaces together give, with the
    effectiveness that the law assumes and with that of a healthy aircraft; and that the engines give, if they
    are effectors."""
    control = frame["control"]
    stops = np.array([control["layout"]["low"], control["layout"]["high"]])
    ranges = {}
    for whose, G in (("", control["axes"]["G"]), ("healthy_", frame["prediction"]["G"])):
        ends = G[i] * stops  # (2, surfaces)
        ranges[f"{whose}least_rad_s2"] = float(ends.min(axis=0).sum())
        ranges[f"{whose}greatest_rad_s2"] = float(ends.max(axis=0).sum())
    if control["engines"]["config"]["n"]:
        least, greatest = control["engines"]["output"]["authority"][:, i].tolist()
        ranges |= {"engines_least_rad_s2": least, "engines_greatest_rad_s2": greatest}
    return ranges


def _engine_power(frame: np.void) -> dict[str, float] | None:
    """Since when and for how long pitch was left to the engine, and how far it went; None if it never was."""
    power = frame["control"]["power"]["output"]
    if not frame["control"]["power"]["config"]["enabled"] or power["from_s"] < 0.0:
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
    flown = zip(CHANNELS, autopilot["is_commanded"], autopilot[off].tolist(), strict=True)
    return {name: away if commanded else None for name, commanded, away in flown}


def _profile(frame: np.void) -> dict[str, float | None] | None:
    """Largest deviation from the commanded profile, by channel; None where there is none, and of angles that
    had no time to settle."""
    off, autopilot = _by_channel(frame, "largest_deviation"), frame["autopilot"]
    if off is None:
        return None
    judged = {name: None if away == NOT_JUDGED else away for name, away in off.items()}
    flown = autopilot["is_commanded"][SPEED]
    for name, record in (
        (LIMITED, "largest_limited_deviation"),
        (AT_ONE_INSTANT, "largest_instant_deviation"),
    ):
        judged[name] = float(autopilot[record]) if flown else None
    return judged


def _limits(frame: np.void, surfaces: Sequence[str]) -> tuple[Found, ...]:
    """What envelope protection has limited, in the order in which the limits began; value: at last, airspeed
    in m/s, bank in deg."""
    if not frame["autopilot"]["enabled"]:
        return ()
    holding, main = frame["autopilot"]["holding"], frame["control"]["layout"]["main"]
    effectiveness = frame["control"]["surfaces"]["output"]["effectiveness"]
    pitch = f"{surfaces[main[PITCH]]} acts as at {degrees(holding['mean_acting_elevator']):.1f} deg"
    lateral = min((main[ROLL], main[YAW]), key=lambda s: float(effectiveness[s]))
    left = f"{100 * effectiveness[lateral]:.0f} % of the {surfaces[lateral]} left"
    kinds = {
        FASTEST: ("airspeed_mps", "at most", pitch),
        SLOWEST: ("airspeed_mps", "at least", pitch),
        BANK_LIMIT: ("bank_deg", "at most", left),
    }
    began = []
    for k, (limits, side, because) in kinds.items():
        if holding["from_s"][k] >= 0.0:
            value = float(holding["value"][k])
            began.append({
                "time_s": float(holding["from_s"][k]), "limits": limits, "side": side,
                "value": degrees(value) if k == BANK_LIMIT else value, "because": because,
                "in_force": bool(holding["in_force"][k]),
            })  # fmt: skip
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


def _withdrawn(gone: np.ndarray, surfaces: Sequence[str]) -> tuple[Found, ...]:
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


def landing_of(
    scenario: Scenario,
    frame: np.void,
    columns: tuple[str, ...],
    verdict: Verdict | None,
    replaced: tuple[Found, ...],
    windows: tuple[Found, ...],
) -> Landing:
    """Read the flight's outcome off its frame record; `verdict` is a plug-in detector's last one, `replaced`
    what changes in flight have ended, `windows` what was found in each."""
    fdi, accounts, dt = frame["fdi"], frame["accounts"], float(frame["dt"])
    tracking, envelope, supervisor = accounts["tracking"], accounts["envelope"], frame["supervisor"]
    surfaces, departed, found = scenario.airframe.surfaces, int(frame["departed"]), fdi["verdict"]
    n_modes = int(supervisor["n_modes"])
    # as many as there is room for
    modes = zip(supervisor["mode_at_s"][:n_modes].tolist(), supervisor["mode_is"][:n_modes], strict=True)
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
        supervisor=tuple((at_s, MODES[mode]) for at_s, mode in modes),
        mode_changes=n_modes,
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
