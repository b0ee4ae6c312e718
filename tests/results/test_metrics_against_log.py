"""What metrics.json says of a flight, computed again by NumPy from its log and its scenario."""

from itertools import accumulate

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.results import model, verdict

AXES, SURFACES, LEADERS = "pqr", ("aileron", "elevator", "rudder", "flap"), ("aileron", "elevator", "rudder")
MODES = ("nominal", "adaptive", "reallocated", "unanticipated")
DUST_S, SETTLED_S, MEAN_S = 1e-9, 30.0, 10.0
RATES = {axis: [{"sine": {"amplitude_deg_s": 4, "frequency_hz": 0.3}}] for axis in AXES}
ELEVATOR = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.4, "at_s": 4.0}
RUDDER = ELEVATOR | {"actuator": "rudder", "at_s": 6.0}
GUIDED = {
    "altitude_m": [{"hold": True}, {"at_s": 5, "value": 1838, "climb_mps": 2}],
    "airspeed_mps": [{"value": 45}, {"at_s": 8, "value": 47}],
    "heading_deg": [{"hold": True}, {"at_s": 10, "value": 20}],
}
FLIGHTS = {
    "faulted": {
        "duration_s": 9, "faults": [ELEVATOR | {"actuator": "aileron", "magnitude": 0.8}],
        "reference": {"p": [{"sine": {"amplitude_deg_s": 25, "frequency_hz": 0.25}}]},
    },
    "healthy": {
        "duration_s": 44, "autopilot": GUIDED,
        "changes": [{"at_s": 3, "law": "nominal"}, {"at_s": 20, "scheme": "adaptive-estimators"}],
    },
    "out": {
        "duration_s": 8, "initial": {"airspeed_mps": 54.5},
        "autopilot": {"airspeed_mps": [{"value": 60}], "bank_deg": [{"value": 0}, {"at_s": 0.5, "value": 3}]},
    },
    "lost": {
        "duration_s": 16, "reference": RATES, "control": {"law": "nominal"},
        "faults": [{"type": "unanticipated", "Cm_alpha3": 25, "at_s": 4.0}],
    },
    "false-alarm": {
        "duration_s": 6, "reference": RATES, "uncertainty": {"coefficients": {"Cm_alpha": 1.1}},
        "faults": [ELEVATOR],
    },
    "in-turn": {
        "duration_s": 9, "reference": RATES, "faults": [RUDDER, ELEVATOR],
    },
    "nobody-looks": {"duration_s": 3, "reference": RATES, "faults": [ELEVATOR | {"at_s": 0}],
                     "fdi": {"scheme": "none"}},
    "by-chance": {
        "duration_s": 9, "reference": RATES, "sensors": "tactical-grade", "faults": [ELEVATOR],
        "fdi": {"statistical": {}, "bounds": {"sensors": "tactical-grade"}},
    },
}  # fmt: skip
# Where the aircraft is, where it is told to be, and whether that is an angle.
CHANNELS = {
    "altitude_m": ("altitude_m", "altitude_command_m", False),
    "airspeed_mps": ("airspeed_mps", "airspeed_command_mps", False),
    "heading_deg": ("psi_rad", "heading_command_rad", True),
    "bank_deg": ("phi_rad", "bank_command_rad", True),
    "airspeed_limited_mps": ("airspeed_mps", "airspeed_limited_mps", False),
    "airspeed_at_one_instant_mps": ("airspeed_mps", "airspeed_command_mps", False),
}


def spells(flags, t, end_s):
    """(first, end) of each run of rows with a flag, s; an open one ends with the flight."""
    steps, instants = np.diff(np.asarray(flags, int), prepend=0, append=0), np.append(t, end_s)
    return list(zip(instants[steps == 1], instants[steps == -1], strict=True))


def mean_of_late(off, dt):
    """A lag of 10 s that starts at 0."""
    means = accumulate(off, lambda mean, one: mean + dt / MEAN_S * (one - mean), initial=0.0)
    return np.array([*means])[1:]


def names_in_time(log, t, end_s):
    """(name, from s, to s) where all faults of the class but one are excluded, or all."""
    left, alarm = np.array([log[f"fie_{one}_excluded"] != 1 for one in LEADERS]), log["detected"] == 1
    flags = {name: alarm & left[s] & (left.sum(axis=0) == 1) for s, name in enumerate(LEADERS)}
    flags["unanticipated"] = alarm & ~left.any(axis=0)
    found = [(name, *spell) for name, at in flags.items() for spell in spells(at, t, end_s)]
    return sorted(found, key=lambda spell: spell[1])


def verdict_of(given, log, t, end_s):
    """The sections on detection and isolation."""
    faults = sorted(given.get("faults", ()), key=lambda fault: fault["at_s"])
    at_s = faults[0]["at_s"] if faults else np.inf
    alarms_s = [start for start, _ in spells(log["detected"] == 1, t, end_s)]
    named = names_in_time(log, t, end_s)

    def since(time_s, at_s):
        """From the first frame with a fault; None before it."""
        if time_s is None or not np.isfinite(at_s) or time_s < at_s - DUST_S:
            return None
        return time_s - t[t >= at_s - DUST_S][0]

    def meant_s(name, time_s):
        """When the fault began that a name given then means; from the second fault on none explains all."""
        own = [fault["at_s"] for fault in faults if fault.get("actuator", fault["type"]) == name]
        second = [fault["at_s"] for fault in faults[1:] if time_s >= fault["at_s"] - DUST_S]
        return own[0] if own else second[0] if name == "unanticipated" and second else None

    time_s = alarms_s[-1] if log["detected"][-1] == 1 else None
    row = t == time_s
    residual, threshold = (
        [log[f"{a}_alarm_{of}_rad_s"][row] for a in AXES] for of in ("residual", "threshold")
    )
    shares = np.abs(residual) / np.array(threshold)
    detection = {
        "detected": time_s is not None, "time_s": time_s, "delay_s": since(time_s, at_s),
        "axis": AXES[int(np.argmax(shares))] if row.any() else None,
    }  # fmt: skip
    last = [spell for spell in named if spell[2] > t[-1]]
    name, named_s, _ = last[0] if last else (None, None, None)
    began_s = None if name is None else meant_s(name, named_s)
    judged_s = at_s if began_s is None else began_s
    early = None if name is None else bool(faults) and named_s < judged_s - DUST_S
    given_s = [(meant_s(one, a), a, one) for one, a, _ in named]
    given_s = [(at_s if m is None else m, a, one) for m, a, one in given_s]
    gone = [spell for spell in named if spell[2] <= t[-1] and spell[0] in SURFACES]
    left = [one for one in LEADERS if log[f"fie_{one}_excluded"][-1] != 1]
    is_surface = name in SURFACES
    isolation = {
        "isolated": name is not None, "fault": name, "time_s": named_s, "premature": early,
        "type": "loss_of_effectiveness" if is_surface else name,
        "delay_s": None if name is None else since(named_s, judged_s),
        "correct": None if name is None else began_s is not None and not early,
        "estimate": log[f"{name}_effectiveness_estimate"][-1] - 1.0 if is_surface else None,
        "candidates": left if time_s is not None else [],
        "names": list(dict.fromkeys(one for m, a, one in sorted(given_s) if a >= m - DUST_S)),
    }  # fmt: skip
    return {
        "detection": detection, "isolation": isolation,
        "withdrawn": [{"fault": one, "from_s": a, "to_s": b} for one, a, b in gone],
        "false_alarm": any(alarm_s < at_s - DUST_S for alarm_s in alarms_s),
        "fault_free_s": min([end_s, at_s, *alarms_s]),
    }  # fmt: skip


def flight_of(given, log, t, dt):
    """The sections on what was flown."""
    end_s = t.size * dt
    at_s = min((fault["at_s"] for fault in given.get("faults", ())), default=np.inf)
    after = t >= at_s - DUST_S
    off = {a: np.rad2deg(log[f"{a}_model_rad_s"] - log[f"{a}_rad_s"]) for a in AXES}
    steps = {s: np.diff(np.rad2deg(log[f"{s}_pos_rad"])) for s in SURFACES}
    rms = [
        {a: np.sqrt(np.mean(off[a][rows] ** 2)) for a in AXES} if rows.any() else None
        for rows in (~after, after)
    ]
    tracking = {
        "pre_fault_rms_deg_s": rms[0], "post_fault_rms_deg_s": rms[1],
        "surface_travel_deg": {s: np.abs(step).sum() for s, step in steps.items()},
        "surface_energy_deg2_s": {s: (step**2).sum() / dt for s, step in steps.items()},
    }  # fmt: skip
    outside = spells(log["envelope_valid"] == 0, t, end_s)
    last = {n: abs(log[f"{n}_rad"][-1]) / 0.6 for n in ("alpha", "beta")}
    last |= {a: abs(log[f"{a}_rad_s"][-1]) / 6.0 for a in AXES}
    gone = [name for name, share in last.items() if share > 1.0]
    mode = log["mode"].astype(int)
    return {
        "frames": t.size, "tracking": tracking,
        "supervisor": [
            {"time_s": t[i], "mode": MODES[mode[i]]} for i in np.flatnonzero(np.diff(mode, prepend=-1))
        ],
        "envelope_exits": [{"start_s": a, "end_s": b} for a, b in outside],
        "envelope.exits": len(outside), "envelope.outside_s": (log["envelope_valid"] == 0).sum() * dt,
        "departure": {"time_s": t[-1], "signal": gone[0]} if gone else None,
        "saturation_s": {s: log[f"{s}_saturated"].sum() * dt for s in SURFACES},
        **profile_of(given, log, t, dt, bool(gone)),
    }  # fmt: skip


def profile_of(given, log, t, dt, is_lost):
    """How far each channel was off its command: angles 30 s after a change and later, airspeeds as a mean."""
    if "autopilot" not in given:
        return {"profile": None, "arrival": None}
    profile, arrival = {}, {"in_envelope": bool(log["envelope_valid"][-1])}
    for channel, (where, command, is_angle) in CHANNELS.items():
        off = None
        if channel.split("_")[0] in {flown.split("_")[0] for flown in given["autopilot"]}:
            off, settled = log[where] - log[command], np.ones(t.size, bool)
            if is_angle:
                off = np.rad2deg((off + np.pi) % (2 * np.pi) - np.pi)
                for leg in given["autopilot"][channel]:
                    age_s = t - leg.get("at_s", 0)
                    settled &= bool(leg.get("hold")) | (age_s < -DUST_S) | (age_s >= SETTLED_S - DUST_S)
            late = mean_of_late(off, dt)
            flown = late if channel in ("airspeed_mps", "airspeed_limited_mps") else off
            off = np.abs(flown[settled]).max() if settled.any() else None
        profile[channel] = off
        if channel.count("_") == 1:
            arrival[channel] = None if channel.split("_")[0] not in str(given["autopilot"]) else late[-1]
    return {"profile": profile, "arrival": None if is_lost else arrival}


def differences(said, found, path=""):
    """Where what is said differs from what is found; keys that are not looked for are left alone."""
    if isinstance(found, dict) and isinstance(said, dict):
        return [d for key in found for d in differences(said[key], found[key], f"{path}.{key}")]
    if isinstance(found, list | tuple) and isinstance(said, list | tuple) and len(found) == len(said):
        pairs = enumerate(zip(said, found, strict=True))
        return [d for i, pair in pairs for d in differences(*pair, f"{path}[{i}]")]
    number = isinstance(found, float | np.floating) and said is not None
    same = said == pytest.approx(found, rel=1e-6, abs=2e-6) if number else said == found
    return [] if same else [f"{path}: {said!r}, found {found!r}"]


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_document_is_what_the_log_says(name):
    given = FLIGHTS[name]
    flight = bf.fly(bf.load({"name": name} | given))
    log, dt = {column: np.asarray(flight.log[column]) for column in flight.log.columns}, 1 / 100
    t = log["t_s"]
    found = verdict_of(given, log, t, t.size * dt) | flight_of(given, log, t, dt)
    said = flight.metrics | {"withdrawn": flight.metrics["isolation"]["withdrawn"]}
    said |= {f"envelope.{key}": value for key, value in said["envelope"].items()}
    assert differences(said, found) == []
    guaranteed_s, delay_s = (said["detection"][key] for key in ("guaranteed_delay_s", "delay_s"))
    assert guaranteed_s is None or (delay_s <= guaranteed_s + DUST_S and not said["false_alarm"])
    if found["tracking"]["post_fault_rms_deg_s"]:
        rows = t >= min(fault["at_s"] for fault in given["faults"]) - DUST_S
        full = not any(log[f"{s}_saturated"][rows].any() for s in SURFACES)
        assert (min(said["authority"][a]["given_share"] for a in AXES) > 1.0 - 1e-6) == full


def test_an_airspeed_that_is_within_what_is_expected_as_a_mean_alone():
    """In gusts, the elevator jammed, the airspeed leaves at one instant the band that its mean keeps."""
    flight = bf.fly(bf.load("mission-elevator-jammed"))
    off = np.asarray(flight.log["airspeed_mps"]) - np.asarray(flight.log["airspeed_command_mps"])
    mean = np.abs(mean_of_late(off, 1.0 / flight.scenario.rate_hz)).max()
    at_once = np.abs(off).max()
    (judged,) = (one for one in flight.metrics["expectations"] if one["name"] == "airspeed_within_mps")
    assert judged["passed"]
    assert mean < judged["expected"] < at_once
    assert judged["actual"] == pytest.approx(mean, rel=2e-3)
    said = f"airspeed {judged['actual']:.3g} m/s (10 s mean; largest at one instant {at_once:.3g})"
    assert said in dict(verdict.verdict_lines(model.Metrics.of(flight.metrics)))["profile"]
