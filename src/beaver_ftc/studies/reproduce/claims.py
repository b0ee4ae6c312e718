"""Each statement of [Zhang2005, sec. VII], how we read it as a number, and whether ours bears it out."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np

from beaver_ftc.studies.reproduce.cases import ESTIMATORS, Flown
from beaver_ftc.studies.reproduce.choices import AMPLITUDE_DEG_S, FAULT_AT_S

Flights = Mapping[str, Flown]

DETECTED_WITHIN_S = 0.5  # the paper's own number
IMMEDIATELY_S = 0.1  # "almost immediately": less than the eye sees in a figure of 30 s
GOOD = 0.1  # of the reference's amplitude: RMS error of good tracking
DETERIORATED = 3.0  # times the RMS error before the fault: a change nobody overlooks
TAKEN_OVER = 0.2  # of the flap's travel: what the elevator may still move
CONTINUOUS_DEG_S = 60.0  # a rate that surface actuators follow [SL03]; a switch would be 100 times as fast


class Reading(NamedTuple):
    """A number that a statement is read as, in `unit`, and what it must be at most, or at least."""

    quantity: str
    unit: str
    limit: float
    at_least: bool = False

    def holds(self, number: float) -> bool:
        """Whether the number bears the statement out."""
        return bool(number >= self.limit if self.at_least else number <= self.limit)


class Claim(NamedTuple):
    """A published statement and how we read it; `measure` gives our number, `remark` says more in words."""

    where: str
    statement: str
    reading: Reading
    measure: Callable[[Flights], float]
    remark: Callable[[Flights], str] = lambda flights: ""


def _detection(name: str, flights: Flights) -> float:
    """From the fault on, s; infinite if there is none."""
    delay = flights[name].metrics["detection"]["delay_s"]
    return np.inf if delay is None else delay


def _isolation(fault: str, flights: Flights) -> float:
    """Isolation after detection, s; infinite if anything else is named."""
    found = flights[fault].metrics
    if found["isolation"]["fault"] != fault:
        return np.inf
    return round(found["isolation"]["time_s"] - found["detection"]["time_s"], 9)


def _tracking(name: str, axis: str, flights: Flights) -> float:
    """RMS error after the fault over the amplitude of the reference, infinite if the aircraft is lost."""
    flown = flights[name]
    return np.inf if flown.metrics["departure"] else flown.after_deg_s(axis) / AMPLITUDE_DEG_S


def _deterioration(name: str, flights: Flights) -> float:
    """RMS pitch rate error after the fault over that before, over all the flight there is."""
    return flights[name].rms_deg_s("q", FAULT_AT_S) / flights[name].before_deg_s("q")


def _last_to_go(flights: Flights) -> float:
    """From detection to the exclusion of the last of the two estimators that do not fit, s."""
    flown = flights["elevator"]
    times = [flown.excluded_at_s(name) for name in ("aileron", "rudder")]
    detected_s = flown.metrics["detection"]["time_s"]
    return np.inf if detected_s is None else round(max(times) - detected_s, 9)


def _adaptive_after(flights: Flights) -> float:
    """From detection to the adaptive law being in charge, s."""
    found = flights["elevator"].metrics
    begun = [change["time_s"] for change in found["supervisor"] if change["mode"] == "adaptive"]
    return round(begun[0] - found["detection"]["time_s"], 9) if begun else np.inf


def _flap_rate(flights: Flights) -> float:
    """Fastest motion the flap is commanded, deg/s."""
    log = flights["elevator"].log
    return float(np.max(np.abs(np.degrees(np.diff(log["flap_cmd_rad"]) / np.diff(log["t_s"])))))


def _share_of_elevator(flights: Flights) -> float:
    """Travel of the elevator over that of the flap, after the hand-over."""
    flown = flights["elevator"]
    after = flown.between(FAULT_AT_S + 3.0)
    if not after.any():
        return np.inf
    elevator, flap = (float(np.ptp(flown.log[f"{name}_cmd_rad"][after])) for name in ("elevator", "flap"))
    return elevator / flap if flap else np.inf


def _said_theta(name: str, flights: Flights) -> str:
    theta = flights[name].metrics["isolation"]["estimate"]
    return "" if theta is None else f"estimated theta {theta:.3f}, true -0.4"


def _sharpened(name: str, flights: Flights) -> str:
    beside = f"{name}-sharpened"
    return f"{_detection(beside, flights):.2f} s sharpened" if beside in flights else ""


def _named(name: str, flights: Flights) -> str:
    said = f"detected after {_detection(name, flights):.2f} s"
    return "; ".join(filter(None, [said, _sharpened(name, flights), _said_theta(name, flights)]))


def _degraded(flights: Flights) -> str:
    flown = flights["elevator-nominal"]
    return f"{flown.before_deg_s('q'):.3f} to {flown.after_deg_s('q'):.2f} deg/s RMS"


def _restored(flights: Flights) -> str:
    flown, nominal = flights["elevator"], flights["elevator-nominal"]
    return (
        f"{flown.after_deg_s('q'):.3f} deg/s RMS, {flown.before_deg_s('q'):.3f} before the fault, "
        f"{nominal.after_deg_s('q'):.2f} under the nominal law"
    )


def _lost(flights: Flights) -> str:
    departure = flights["unanticipated-nominal"].metrics["departure"]
    if departure is None:
        return "tracking lost, aircraft kept"
    return f"the aircraft departs in {departure['signal']} at {departure['time_s']:.2f} s"


def _last_standing(flights: Flights) -> str:
    flown, interval = flights["unanticipated"], flights.get("unanticipated-interval")
    named = max(ESTIMATORS, key=flown.named_s)
    if flown.named_s(named) == 0.0:
        return "at no time is a known fault left alone"
    said = f"the norm bound names the {named} for {flown.named_s(named):.2f} s before it is excluded too"
    if interval is None or interval.named_s(named):
        return said
    return f"{said}; the interval test never names it"


def _recovered(name: str, axis: str, flights: Flights) -> str:
    flown = flights[name]
    return f"{flown.after_deg_s(axis):.3f} deg/s RMS, {flown.before_deg_s(axis):.3f} before"


TRACKED_P, TRACKED_Q, TRACKED_R = (
    Reading(f"RMS error of {axis}", "of the reference's amplitude", GOOD) for axis in "pqr"
)
WORSE = Reading("RMS error of q", "times that before", DETERIORATED, at_least=True)
BELOW = Reading("largest |residual| / threshold", "", 1.0)
DETECTED = Reading("detection", "s after the fault", DETECTED_WITHIN_S)
ISOLATED = Reading("isolation", "s after detection", IMMEDIATELY_S)
CLAIMS = (
    Claim("Fig. 2a", "Without a fault the nominal law tracks the pitch rate well.", TRACKED_Q,
          lambda flights: flights["fault-free-nominal"].rms_deg_s("q", 2.0) / AMPLITUDE_DEG_S),
    Claim("Fig. 2b", "After the elevator fault the nominal law tracks much worse.", WORSE,
          partial(_deterioration, "elevator-nominal"), _degraded),
    Claim("Fig. 3", "Before the fault the residual stays below its threshold.", BELOW,
          lambda flights: flights["elevator"].closest_before_fault()),
    Claim("Fig. 3", "The elevator fault is detected within 0.5 s.", DETECTED,
          partial(_detection, "elevator"), partial(_sharpened, "elevator")),
    Claim("Fig. 4a, 4c", "The aileron's and the rudder's estimators exceed their thresholds almost at once.",
          Reading("last exclusion", "s after detection", IMMEDIATELY_S), _last_to_go),
    Claim("Fig. 4b", "No residual of the elevator's estimator ever exceeds its threshold.", BELOW,
          lambda flights: flights["elevator"].closest("elevator")),
    Claim("Fig. 4", "The fault is thereby isolated as the elevator's.", ISOLATED,
          partial(_isolation, "elevator"), partial(_said_theta, "elevator")),
    Claim("Fig. 5", "Right after detection the adaptive law takes over.",
          Reading("in charge", "s after detection", IMMEDIATELY_S), _adaptive_after,
          lambda flights: "the paper's text says about 10 s here, its fault comes at 12 s"),
    Claim("Fig. 5", "After isolation the flap moves in the elevator's place.",
          Reading("travel of the elevator", "of the flap's", TAKEN_OVER), _share_of_elevator),
    Claim("Fig. 5", "The hand-over from elevator to flap is continuous.",
          Reading("fastest motion of the flap", "deg/s", CONTINUOUS_DEG_S), _flap_rate),
    Claim("Fig. 5", "With reallocation the pitch rate is tracked acceptably in spite of the fault.",
          TRACKED_Q, partial(_tracking, "elevator", "q"), _restored),
    Claim("mentioned", "An aileron fault is detected and isolated just as well.", ISOLATED,
          partial(_isolation, "aileron"), partial(_named, "aileron")),
    Claim("mentioned", "An aileron fault leaves tracking satisfactory.", TRACKED_P,
          partial(_tracking, "aileron", "p"), partial(_recovered, "aileron", "p")),
    Claim("mentioned", "A rudder fault is detected and isolated just as well.", ISOLATED,
          partial(_isolation, "rudder"), partial(_named, "rudder")),
    Claim("mentioned", "A rudder fault leaves tracking satisfactory.", TRACKED_R,
          partial(_tracking, "rudder", "r"), partial(_recovered, "rudder", "r")),
    Claim("Fig. 6", "After the unanticipated fault the nominal law tracks much worse.", WORSE,
          partial(_deterioration, "unanticipated-nominal"), _lost),
    Claim("mentioned", "The unanticipated fault is detected within 0.5 s.", DETECTED,
          partial(_detection, "unanticipated"), partial(_sharpened, "unanticipated")),
    Claim("mentioned", "The unanticipated fault is not taken for one of the known ones.",
          Reading("last estimator excluded", "s after detection", DETECTED_WITHIN_S),
          partial(_isolation, "unanticipated"), _last_standing),
    Claim("Fig. 7", "The adaptive law keeps tracking acceptable in spite of the unanticipated fault.",
          TRACKED_Q, partial(_tracking, "unanticipated", "q"), partial(_recovered, "unanticipated", "q")),
)  # fmt: skip
