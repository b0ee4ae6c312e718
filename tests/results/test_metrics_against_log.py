"""Every field of metrics.json, computed again by NumPy from the log and the scenario of the same flight.

A field without a rule fails. What a log cannot show (the types of faults, what the law asked for) is held
against what bounds it.
"""

import sys
from dataclasses import dataclass
from importlib.metadata import version
from itertools import pairwise

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.results import model, verdict

AXES, SURFACES = "pqr", ("aileron", "elevator", "rudder", "flap")
MODES = ("nominal", "adaptive", "reallocated", "unanticipated")
DUST_S, SETTLED_S, MEAN_S = 1e-9, 30.0, 10.0
LOSS = {"type": "loss_of_effectiveness", "magnitude": 0.4, "at_s": 4.0}
RATES = {axis: [{"sine": {"amplitude_deg_s": 4, "frequency_hz": 0.3}}] for axis in AXES}
HARD = {"p": [{"sine": {"amplitude_deg_s": 25, "frequency_hz": 0.25}}]}
GUIDED = {
    "altitude_m": [{"hold": True}, {"at_s": 5, "value": 1838, "climb_mps": 2}],
    "airspeed_mps": [{"value": 45}, {"at_s": 8, "value": 47}],
    "heading_deg": [{"hold": True}, {"at_s": 10, "value": 20}],
}
NEVER_SETTLED = {"airspeed_mps": [{"value": 60}], "bank_deg": [{"value": 0}, {"at_s": 0.5, "value": 3}]}
LAWS = [{"at_s": 3, "law": "nominal"}, {"at_s": 20, "scheme": "adaptive-estimators"}]
EXPECTED = {
    "detected_within_s": 0.005, "isolated_as": "aileron", "isolated_within_s": 0.2, "no_false_alarm": True,
    "no_departure": True, "post_fault_rms_deg_s": {"p": 1.0, "q": 1.0}, "stays_in_envelope": True,
}  # fmt: skip
ELEVATOR, RUDDER = LOSS | {"actuator": "elevator"}, LOSS | {"actuator": "rudder", "at_s": 6.0}
FLIGHTS = {
    "faulted": {
        "duration_s": 9, "reference": HARD, "faults": [LOSS | {"actuator": "aileron", "magnitude": 0.8}],
        "expect": EXPECTED,
    },
    "healthy": {"duration_s": 44, "autopilot": GUIDED, "changes": LAWS},
    "out": {"duration_s": 8, "initial": {"airspeed_mps": 54.5}, "autopilot": NEVER_SETTLED},
    "lost": {
        "duration_s": 16, "reference": RATES, "control": {"law": "nominal"},
        "faults": [{"type": "unanticipated", "Cm_alpha3": 25, "at_s": 4.0}],
        "expect": {"no_departure": False},
    },
    "false-alarm": {
        "duration_s": 6, "reference": RATES, "uncertainty": {"coefficients": {"Cm_alpha": 1.1}},
        "faults": [ELEVATOR], "expect": {"isolated_as": "elevator", "no_false_alarm": False},
    },
    "in-turn": {
        "duration_s": 9, "reference": RATES, "faults": [RUDDER, ELEVATOR],
        "expect": {"isolated_as": ["elevator", "unanticipated"]},
    },
    "at-once": {
        "duration_s": 12, "reference": RATES, "fdi": {"fault_class": "all", "pairs": True},
        "faults": [RUDDER | {"type": "bias", "bias_deg": 3} | {"magnitude": None}, ELEVATOR],
    },
    "nobody-looks": {"duration_s": 3, "reference": RATES, "faults": [ELEVATOR | {"at_s": 0}],
                     "fdi": {"scheme": "none"}},
    "an-instrument": {
        "duration_s": 8, "reference": RATES,
        "faults": [{"sensor": "p", "type": "bias", "magnitude": 4, "at_s": 4.0}],
        "fdi": {"sensor_monitor": "always"},
    },
    "by-chance": {
        "duration_s": 9, "reference": RATES,
        "fdi": {"statistical": {}, "bounds": {"sensors": "tactical-grade"}},
        "sensors": "tactical-grade", "faults": [ELEVATOR],
    },
}  # fmt: skip
for flown in FLIGHTS.values():
    flown["faults"] = [
        {key: value for key, value in fault.items() if value is not None} for fault in flown.get("faults", ())
    ]


@dataclass
class Flown:
    """A flight as it was asked for, what it has logged, and its document."""

    given: dict
    metrics: dict
    log: dict
    scenario: bf.Scenario

    def __getitem__(self, column):
        return self.log[column]

    @property
    def t(self):
        return self["t_s"]

    @property
    def dt(self):
        return 1.0 / self.scenario.rate_hz

    @property
    def end_s(self):
        return len(self.t) * self.dt

    @property
    def faults(self):
        """As given, in the order in which they strike."""
        return sorted(self.given["faults"], key=lambda fault: fault["at_s"])

    @property
    def broken(self):
        """Instruments that break."""
        return [fault["sensor"] for fault in self.faults if "sensor" in fault]

    @property
    def diagnoses(self):
        return self.given.get("fdi", {}).get("scheme") != "none"

    @property
    def at_s(self):
        return self.faults[0]["at_s"] if self.faults else np.inf

    @property
    def after(self):
        return self.t >= self.at_s - DUST_S

    def has(self, column):
        return column in self.log

    def when(self, flags):
        """(first, end) of each run of rows in which a flag stands, s; an open one ends with the flight."""
        flags = np.asarray(flags, int)
        steps = np.diff(flags, prepend=0, append=0)
        instants = np.append(self.t, self.end_s)
        return [
            (instants[i], instants[j])
            for i, j in zip(*(np.flatnonzero(steps == s) for s in (1, -1)), strict=True)
        ]

    def since(self, time_s, at_s):
        """From the first frame with a fault to an instant; None before."""
        if time_s is None or not np.isfinite(at_s) or time_s < at_s - DUST_S:
            return None
        return time_s - self.t[self.t >= at_s - DUST_S][0]


# What the log shows of the verdict.


def alarms_s(flown):
    return [start for start, _ in flown.when(flown["detected"] == 1)]


def detected_s(flown):
    """Of the last diagnosis."""
    return alarms_s(flown)[-1] if flown["detected"][-1] == 1 else None


def names_in_time(flown):
    """(name, from s, to s) of every spell in which all faults of the class but one are excluded, or all; of
    an instrument, from where the tests between the instruments are failed."""
    if flown.broken and (loud := flown.when(flown["watch_share"] > 1.0)):
        return [(f"sensor {flown.broken[0]}", loud[0][0], flown.end_s)]
    left = np.array([flown[f"fie_{one}_excluded"] != 1 for one in SURFACES[:3]])
    found = []
    for s, surface in enumerate(SURFACES[:3]):
        found += [(surface, *span) for span in flown.when(alone(flown, left) & left[s])]
    found += [("unanticipated", *span) for span in flown.when((flown["detected"] == 1) & ~left.any(axis=0))]
    return sorted(found, key=lambda spell: spell[1])


def alone(flown, left):
    return (flown["detected"] == 1) & (left.sum(axis=0) == 1)


def named(flown):
    """(name, from s) at the end."""
    spells = [spell for spell in names_in_time(flown) if spell[2] > flown.t[-1]]
    return spells[0][:2] if spells else (None, None)


def meant_s(flown, name, time_s):
    """When the fault that is named began; None where none of them is meant."""
    own = [fault["at_s"] for fault in flown.faults if name_of(fault) == name]
    second = [fault["at_s"] for fault in flown.faults][1:2]
    if name == "unanticipated" and not own and second and time_s >= second[0] - DUST_S:
        own = second
    return own[0] if own else None


def is_outside(fault, fdi):
    """Whether the class does not have a fault: of an instrument, or other than a loss of a leader."""
    everything = fdi.get("fault_class") == "all"
    if "sensor" in fault:
        return fdi.get("sensor_monitor", "always" if everything else "never") == "never"
    loss = fault["type"] == "loss_of_effectiveness" and fault["actuator"] != "flap"
    return "actuator" in fault and not everything and not loss


def name_of(fault):
    """What the diagnosis ought to call it."""
    return f"sensor {fault['sensor']}" if "sensor" in fault else fault.get("actuator", fault["type"])


def premature(flown):
    name, time_s = named(flown)
    if name is None:
        return None
    at_s = meant_s(flown, name, time_s)
    return time_s < (flown.at_s if at_s is None else at_s) - DUST_S if flown.faults else False


def correct(flown):
    name, time_s = named(flown)
    return None if name is None else meant_s(flown, name, time_s) is not None and not premature(flown)


def isolation_delay(flown):
    name, time_s = named(flown)
    at_s = None if name is None else meant_s(flown, name, time_s)
    return flown.since(time_s, flown.at_s if at_s is None else at_s)


def all_names(flown):
    given = []
    for name, from_s, _ in names_in_time(flown):
        at_s = meant_s(flown, name, from_s)
        at_s = flown.at_s if at_s is None else at_s
        if from_s >= at_s - DUST_S:
            given.append((at_s, from_s, name))
    return list(dict.fromkeys(name for _, _, name in sorted(given)))


def taken_back(flown):
    """The log does not show why."""
    said = flown.metrics["isolation"]["withdrawn"]
    spells = [spell for spell in names_in_time(flown) if spell[2] <= flown.t[-1] and spell[0] in SURFACES]
    assert len(said) == len(spells)
    return [
        {"fault": name, "from_s": a, "to_s": b, "because": one["because"]}
        for (name, a, b), one in zip(spells, said, strict=True)
    ]


def type_of(flown):
    """The published class knows one type a surface; an instrument's is not named."""
    name, _ = named(flown)
    return "loss_of_effectiveness" if name in SURFACES else None if flown.broken else name


def estimate(flown):
    name, _ = named(flown)
    return flown[f"{name}_effectiveness_estimate"][-1] - 1.0 if name in SURFACES else None


def candidates(flown):
    if detected_s(flown) is None or flown.broken:
        return []
    return [surface for surface in SURFACES[:3] if flown[f"fie_{surface}_excluded"][-1] != 1]


def alarm_axis(flown):
    """The axis on which a filter has left its threshold by most."""
    if detected_s(flown) is None or flown.broken:
        return None
    row = np.flatnonzero(flown.t == detected_s(flown))[0]
    over = [
        abs(flown[f"{a}_alarm_residual_rad_s"][row]) / flown[f"{a}_alarm_threshold_rad_s"][row] for a in AXES
    ]
    return AXES[int(np.argmax(over))]


def loudest(flown, until_s=np.inf):
    """Largest share of the threshold that a filter reached before an instant."""
    rows = (flown.t > 0) & (flown.t < until_s - DUST_S)
    if not rows.any():
        return 0.0
    residual, threshold = (
        np.array([flown[f"{a}_alarm_{of}_rad_s"][rows] for a in AXES]) for of in ("residual", "threshold")
    )
    return float(np.max(np.abs(residual) / np.where(residual == 0.0, 1.0, threshold)))  # 0 of 0 is none


# What the log shows of the flight.


def rms(flown, rows):
    if not rows.any():
        return None
    off = {a: np.rad2deg(flown[f"{a}_model_rad_s"] - flown[f"{a}_rad_s"])[rows] for a in AXES}
    return {a: np.sqrt((each**2).mean()) for a, each in off.items()}


def steps_deg(flown):
    return {s: np.diff(np.rad2deg(flown[f"{s}_pos_rad"])) for s in SURFACES}


def supervisor(flown):
    mode = flown["mode"].astype(int)
    rows = np.flatnonzero(np.diff(mode, prepend=-1))
    return [{"time_s": flown.t[i], "mode": MODES[mode[i]]} for i in rows]


def fault_of(fault):
    place = {"actuator": fault.get("actuator")} | ({"sensor": fault["sensor"]} if "sensor" in fault else {})
    return place | {"type": fault["type"], "at_s": fault["at_s"]}


def whole_fault_of(fault):
    size = {k: v for k, v in fault.items() if k not in ("actuator", "sensor", "type", "at_s")}
    return fault_of(fault) | {"end_s": None, "profile": "abrupt", "size": size}


def exits(flown):
    return [{"start_s": a, "end_s": b} for a, b in flown.when(flown["envelope_valid"] == 0)]


def departure(flown):
    last = {"alpha": flown["alpha_rad"][-1] / 0.6, "beta": flown["beta_rad"][-1] / 0.6}
    last |= {axis: flown[f"{axis}_rad_s"][-1] / 6.0 for axis in AXES}
    over = [name for name, share in last.items() if abs(share) > 1.0]
    return {"time_s": flown.t[-1], "signal": over[0]} if over else None


COMMANDS = {
    "altitude_m": ("altitude_m", "altitude_command_m"),
    "airspeed_mps": ("airspeed_mps", "airspeed_command_mps"),
    "heading_deg": ("psi_rad", "heading_command_rad"),
    "bank_deg": ("phi_rad", "bank_command_rad"),
    "airspeed_limited_mps": ("airspeed_mps", "airspeed_limited_mps"),
    "airspeed_at_one_instant_mps": ("airspeed_mps", "airspeed_command_mps"),
}


def away(flown, channel):
    """How far a channel is off its command, frame by frame, deg for angles; None where it is not flown."""
    if channel.split("_")[0] not in " ".join(flown.given["autopilot"]):
        return None
    where, command = (flown[column] for column in COMMANDS[channel])
    off = where - command
    return np.rad2deg((off + np.pi) % (2 * np.pi) - np.pi) if channel.endswith("_deg") else off


MEANS = ("airspeed_mps", "airspeed_limited_mps")


def mean_of_late(flown, off):
    mean, means = 0.0, []
    for one in off:
        mean += flown.dt / MEAN_S * (one - mean)
        means.append(mean)
    return np.array(means)


def settled(flown, channel):
    """Rows that count: 30 s after a change of an angle and later."""
    rows = np.ones(len(flown.t), bool)
    for leg in flown.given["autopilot"][channel] if channel.endswith("_deg") else ():
        if not leg.get("hold"):
            rows &= (flown.t < leg.get("at_s", 0) - DUST_S) | (
                flown.t >= leg.get("at_s", 0) + SETTLED_S - DUST_S
            )
    return rows


def profile(flown):
    if "autopilot" not in flown.given:
        return None
    found = {}
    for channel in COMMANDS:
        off = away(flown, channel)
        if off is not None:
            off = mean_of_late(flown, off) if channel in MEANS else off
            rows = settled(flown, channel)
            off = np.abs(off[rows]).max() if rows.any() else None
        found[channel] = off
    return found


def arrival(flown):
    if "autopilot" not in flown.given or departure(flown):
        return None
    channels = [channel for channel in COMMANDS if channel.count("_") == 1]
    off = {channel: away(flown, channel) for channel in channels}
    means = {channel: None if of is None else mean_of_late(flown, of)[-1] for channel, of in off.items()}
    return means | {"in_envelope": bool(flown["envelope_valid"][-1])}


def changes(flown):
    found = []
    for change in flown.given.get("changes", ()):
        said = {"time_s": change["at_s"], "law": change.get("law"), "scheme": change.get("scheme")}
        ended = {"detection_time_s": None, "isolated": None} if "scheme" in change else {}
        found.append(said | {"sensors": False} | ended)
    return found


def expectations(flown):
    """Each of those that the flights above have, by rules of their own."""
    m, found = flown.metrics, []
    delays = {"detected_within_s": m["detection"]["delay_s"], "isolated_within_s": m["isolation"]["delay_s"]}
    for name, expected in flown.given.get("expect", {}).items():
        if name == "post_fault_rms_deg_s":
            for axis, limit in expected.items():
                actual = rms(flown, flown.after)[axis]
                found.append((f"{name}.{axis}", actual <= limit, limit, actual))
        elif name in delays:
            actual = delays[name]
            found.append((name, actual is not None and actual <= expected, expected, actual))
        elif name == "isolated_as":
            actual = all_names(flown) if isinstance(expected, list) else named(flown)[0]
            early = premature(flown) and not isinstance(expected, list)
            found.append((name, actual == expected and not early, expected, actual))
        else:
            actual = {
                "no_false_alarm": not any(time_s < flown.at_s - DUST_S for time_s in alarms_s(flown)),
                "no_departure": departure(flown) is None,
                "stays_in_envelope": not exits(flown),
            }[name]
            found.append((name, actual == expected, expected, actual))
    keys = ("name", "passed", "expected", "actual")
    return [dict(zip(keys, one, strict=True)) for one in found]


def versions(flown):
    found = {name: version(name) for name in ("beaver-ftc", "jsbsim", "numpy", "numba")}
    return found | {"python": ".".join(map(str, sys.version_info[:3]))}


OF_LOG = {
    "scenario": lambda f: f.scenario.name,
    "seed": lambda f: f.given.get("seed", 1),
    "frames": lambda f: len(f.t),
    "assumes": lambda f: ["sensors-sound"] * (f.diagnoses and not f.has("watch_share")),
    "outside_class": lambda f: [
        f"{name_of(fault)} {fault['type'].replace('_', ' ')} at {fault['at_s']:g} s"
        for fault in f.given["faults"] if f.diagnoses and is_outside(fault, f.given.get("fdi", {}))
    ],
    "flight": lambda f: {
        "airspeed_mps": f.given.get("initial", {}).get("airspeed_mps", 45.0),
        "altitude_m": 1828.8, "rate_hz": 100.0, "flown_s": f.end_s,
        "scheme": f.given.get("fdi", {}).get("scheme", "adaptive-estimators"),
        "fault_class": f.given.get("fdi", {}).get("fault_class", "published"),
        "law": f.given.get("control", {}).get("law", "fault-tolerant"),
    },
    "fault": lambda f: fault_of(f.faults[0]) if f.faults else None,
    "faults": lambda f: [whole_fault_of(fault) for fault in f.faults],
    "detection.detected": lambda f: detected_s(f) is not None,
    "detection.time_s": detected_s,
    "detection.delay_s": lambda f: f.since(detected_s(f), f.at_s),
    "detection.axis": alarm_axis,
    "isolation.isolated": lambda f: named(f)[0] is not None,
    "isolation.fault": lambda f: named(f)[0],
    "isolation.type": type_of,
    "isolation.time_s": lambda f: named(f)[1],
    "isolation.delay_s": isolation_delay,
    "isolation.correct": correct,
    "isolation.estimate": estimate,
    "isolation.candidates": candidates,
    "isolation.type_correct": lambda f: None if type_of(f) is None else correct(f),  # a name has one type
    "isolation.type_delay_s": lambda f: None,
    "isolation.estimate_deg": lambda f: None,
    "isolation.estimate_interval": lambda f: None,
    "isolation.frequency_rad_s": lambda f: None,
    "isolation.so_far": lambda f: None if named(f)[0] is None else named(f)[0] in SURFACES,
    "isolation.premature": premature,
    "isolation.withdrawn": taken_back,
    "isolation.names": all_names,
    "isolation.probing_s": lambda f: None,
    "isolation.faults": lambda f: [],
    "false_alarm": lambda f: any(time_s < f.at_s - DUST_S for time_s in alarms_s(f)),
    "fault_free_s": lambda f: min([f.end_s, f.at_s, *alarms_s(f)]),
    "tracking.pre_fault_rms_deg_s": lambda f: rms(f, ~f.after) if f.at_s > 0 else None,
    "tracking.post_fault_rms_deg_s": lambda f: rms(f, f.after),
    "tracking.surface_travel_deg": lambda f: {s: np.abs(step).sum() for s, step in steps_deg(f).items()},
    "tracking.surface_energy_deg2_s": lambda f: {s: (x**2).sum() / f.dt for s, x in steps_deg(f).items()},
    "supervisor": supervisor,
    "changes": changes,
    "mode_changes_left_out": lambda f: len(supervisor(f)) - len(f.metrics["supervisor"]),
    "envelope_exits": exits,
    "envelope.exits": lambda f: len(exits(f)),
    "envelope.outside_s": lambda f: (f["envelope_valid"] == 0).sum() * f.dt,
    "envelope.exits_left_out": lambda f: len(exits(f)) - len(f.metrics["envelope_exits"]),
    "departure": departure,
    "engine_power": lambda f: None,
    "profile": profile,
    "arrival": arrival,
    "limits": lambda f: [],
    "saturation_s": lambda f: {s: f[f"{s}_saturated"].sum() * f.dt for s in SURFACES},
    "expectations": expectations,
    "passed": lambda f: all(one["passed"] for one in expectations(f)),
    "versions": versions,
}  # fmt: skip
"""The value of a field, or of a section."""


# What the log bounds only.


def guarantee(flown, said):
    """No alarm comes later than it was certain to, and it is said of no alarm before the fault."""
    found = flown.metrics["detection"]["delay_s"]
    if said is not None:
        assert found is not None
        assert found <= said + DUST_S
    assert said is None or not flown.metrics["false_alarm"]


def chance(flown, said):
    """The level is beyond that of one test at the rate declared; the alarm is where a ratio passes it."""
    if "statistical" not in flown.given.get("fdi", {}):
        assert said is None
        return
    ratios = np.array([flown[name] for name in flown.log if name.endswith("_likelihood_share")])
    loud = flown.t[(ratios > 1.0).any(axis=0)]
    assert said["time_s"] == pytest.approx(loud[0])
    assert 0.0 < said["closest_approach"] < 1.0
    assert said["alarm_level"] > 5.0  # standard deviations: 1e-3 an hour, at 100 Hz


def blind(flown, said):
    if flown.scenario.fdi.scheme != "none":
        assert said is None
        assert all((flown[f"{axis}_eta_bar_rad_s2"] < 1e5).all() for axis in AXES)
        return
    assert (said["share"], said["from_s"]) == (1.0, 0.0)
    assert [reason["share"] for reason in said["reasons"]] == [1.0]


def authority(flown, said):
    """All that was asked for is given as long as nothing is saturated."""
    if not flown.after.any():
        assert said is None
        return
    saturated = np.array([flown[f"{s}_saturated"][flown.after] for s in SURFACES]).any(axis=0)
    for axis in AXES:
        assert 0.0 <= said[axis]["given_share"] <= 1.0
        assert 0.0 <= said[axis]["beyond_s"] <= flown.after.sum() * flown.dt + DUST_S
    shares = [said[axis]["given_share"] for axis in AXES]
    assert (min(shares) < 1.0 - 1e-6) == bool(saturated.any())


def several(flown, said):
    """The log does not show which types are left: the names are those of the faults, none before it began,
    what is estimated is inside its interval, and the truth is as well."""
    found = {one["fault"]: one for one in said["faults"] if one["fault"]}
    assert said["names"] == [fault["actuator"] for fault in flown.faults if fault["actuator"] in found]
    assert len(found) == 2
    for fault in flown.faults:
        one, true = found[fault["actuator"]], -fault.get("magnitude", np.nan)
        bias = "bias_deg" in fault
        assert one["delay_s"] == pytest.approx(flown.since(one["time_s"], fault["at_s"]))
        assert (one["correct"], one["premature"], one["so_far"]) == (True, False, True)
        assert one["type"] in (None, fault["type"])
        assert one["type_correct"] is (True if one["type"] else None)
        assert fault["type"] in one["candidates"]
        if one["type"]:
            low, high = one["estimate_interval"]
            assert low <= one["estimate"] <= high
            assert low <= (np.deg2rad(fault["bias_deg"]) if bias else true) <= high
            assert 0.0 <= one["type_delay_s"] <= flown.end_s - fault["at_s"]
            assert one["estimate_deg"] == (pytest.approx(np.rad2deg(one["estimate"])) if bias else None)
    first = min(found.values(), key=lambda one: one["time_s"])
    assert {key: said[key] for key in first} == first
    assert said["isolated"]
    assert set(said) - set(first) == {"isolated", "withdrawn", "names", "probing_s", "faults"}
    assert (said["withdrawn"], said["probing_s"], first["frequency_rad_s"]) == ([], None, None)


def windows(flown, found):
    """Between two instants at which a fault begins or ends, while one is in force."""
    spans = [(fault["at_s"], fault.get("end_s") or flown.end_s) for fault in flown.faults]
    edges = sorted({time_s for span in spans for time_s in span if time_s <= flown.end_s})
    expected = [(a, b) for a, b in pairwise(edges) if any(begin <= a and b <= end for begin, end in spans)]
    assert [(one["from_s"], one["to_s"]) for one in found] == [pytest.approx(span) for span in expected]
    for one in found:
        assert one["detected"] is (one["time_s"] is not None)
        assert one["time_s"] is None or one["from_s"] <= one["time_s"] < one["to_s"]


HINTS = {
    "airspeed ": lambda f: (
        "autopilot" not in f.given and abs(f["airspeed_mps"][-1] - f.scenario.initial.airspeed_mps) > 5
    ),
    "the residual of the healthy": lambda f: bool(f.faults) and 0.9 <= loudest(f, f.at_s) <= 1.0,
    "the residual already": lambda f: not f.faults and 0.9 <= loudest(f, np.inf) <= 1.0,
    "the alarm came within one frame": lambda f: (
        (
            (f.metrics["detection"]["delay_s"] or np.inf) <= f.dt + DUST_S
            or f.metrics["detection"]["delay_s"] == 0.0
        )
        and f.given.keys().isdisjoint({"sensors", "actuators", "environment"})
        and f.given.get("uncertainty", {}).keys() <= {"inertia_coupling", "sinusoid"}
    ),
    "faults on several": lambda f: len(f.faults) > 1 and not f.scenario.fdi.pairs,
    "no alarm, and none": lambda f: (
        bool(f.faults)
        and f.scenario.fdi.scheme != "none"
        and not alarms_s(f)
        and f.metrics["detection"]["guaranteed_delay_s"] is None
    ),
}


def hints(flown, said):
    assert [one for one in said if not one.startswith(tuple(HINTS))] == []
    for begins, needed in HINTS.items():
        assert sum(one.startswith(begins) for one in said) == needed(flown), begins


BOUNDED = {
    "windows": windows,
    "detection.guaranteed_delay_s": guarantee,
    "detection.statistical": chance,
    "detection.inconclusive": blind,
    "authority": authority,
    "hints": hints,
}


def fields(section, rules, path=""):
    """(path, value) of everything that has a rule, or that nothing is below."""
    for key, value in section.items():
        here = f"{path}.{key}" if path else key
        if here in rules or not isinstance(value, dict):
            yield here, value
        else:
            yield from fields(value, rules, here)


def compare(found, expected, where):
    if isinstance(expected, dict):
        assert isinstance(found, dict), where
        assert list(found) == list(expected) or set(found) - {"reason"} == set(expected), where
        for key in expected:
            compare(found[key], expected[key], f"{where}.{key}")
    elif isinstance(expected, list):
        assert isinstance(found, list), where
        assert len(found) == len(expected), where
        for i, (one, other) in enumerate(zip(found, expected, strict=True)):
            compare(one, other, f"{where}[{i}]")
    elif isinstance(expected, float | np.floating) and found is not None:
        assert found == pytest.approx(expected, rel=1e-6, abs=2e-6), where
    else:
        assert found == expected, where


@pytest.fixture(scope="module", params=FLIGHTS)
def flown(request):
    given = FLIGHTS[request.param]
    flight = bf.fly(bf.load({"name": request.param} | given))
    log = {name: np.asarray(flight.log[name]) for name in flight.log.columns}
    return Flown(given, flight.metrics, log, flight.scenario)


def rules_of(flown):
    """By field: what takes the flight and the value found, and asserts."""

    def equal(where):
        return lambda flown, found: compare(found, OF_LOG[where](flown), where)

    bounded = BOUNDED | ({"isolation": several} if flown.scenario.fdi.pairs else {})
    return {where: equal(where) for where in OF_LOG} | bounded


def test_every_field_is_what_the_log_says(flown):
    rules, wrong = rules_of(flown), []
    for where, found in fields(flown.metrics, rules):
        try:
            rules[where](flown, found)
        except (AssertionError, KeyError) as error:
            wrong.append(f"{where}: {found!r}: {error!r:.300}")
    assert not wrong, "\n".join(wrong)


def test_an_airspeed_that_is_within_what_is_expected_as_a_mean_alone():
    """In gusts, the elevator jammed, the airspeed leaves at one instant the band that its mean keeps."""
    flight = bf.fly(bf.load("mission-elevator-jammed"))
    off = np.asarray(flight.log["airspeed_mps"]) - np.asarray(flight.log["airspeed_command_mps"])
    age_s = np.arange(off.size) / flight.scenario.rate_hz
    kernel = np.exp(-age_s / MEAN_S) / MEAN_S / flight.scenario.rate_hz  # the lag's impulse response
    mean, at_once = np.abs(np.convolve(off, kernel)[: off.size]).max(), np.abs(off).max()
    (judged,) = (one for one in flight.metrics["expectations"] if one["name"] == "airspeed_within_mps")
    assert judged["passed"]
    assert mean < judged["expected"] < at_once
    assert judged["actual"] == pytest.approx(mean, rel=2e-3)
    said = f"airspeed {judged['actual']:.3g} m/s (10 s mean; largest at one instant {at_once:.3g})"
    assert said in dict(verdict.verdict_lines(model.Metrics.of(flight.metrics)))["profile"]
