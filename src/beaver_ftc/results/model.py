"""The document metrics.json as records, one for each section, in the order of the document. The columns of a
sweep and the attributes of a `Flight` are parts of it.

The fields of a record are the keys of its section, in their order. Times are in s from the start of the
flight, delays in s from the first frame with the fault, rates in deg/s. None: the quantity does not exist.
"""

from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import Any, Self

from beaver_ftc.documents import files
from beaver_ftc.results.part import Known, Part, as_json_value
from beaver_ftc.scenario.faults import DAMAGE, LOSS_OF_EFFECTIVENESS, UNANTICIPATED, of_a_sensor
from beaver_ftc.scenario.sensors import sensor_words

Document = files.Document
Span = tuple[float, float]


Quantity = float | None
"""A number; None if the quantity does not exist."""
BySurface = dict[str, float]  # a number for each surface, by its name


@dataclass(frozen=True)
class FlightCondition(Part):
    """The flight condition, the scheme of the diagnosis and the control law. flown_s: duration, s."""

    airspeed_mps: float
    altitude_m: float
    rate_hz: float
    flown_s: float
    scheme: str
    fault_class: str
    law: str


@dataclass(frozen=True)
class Fault(Part):
    """The first fault of the scenario.

    - `actuator`: name of the surface; None for an unanticipated fault and for a fault of an instrument.
    - `type`: fault type, as in a scenario file.
    - `at_s`: time at which the fault begins, s.
    - `sensor`: name of the instrument for a fault of an instrument; otherwise None.
    """

    actuator: str | None
    sensor: Known[str] = field(default=None, kw_only=True)
    type: str
    at_s: float


_NO_SIZE = {"actuator", "sensor", "type", "at_s", "end_s", "profile"}  # keys of a fault that are not its size


@dataclass(frozen=True)
class DeclaredFault(Fault):
    """A declared fault, with which names given by the diagnosis are compared.

    end_s: time at which it ends, s; None if it lasts to the end. profile: how it grows, as in a scenario
    file. size: the parameters that only its type has.
    """

    end_s: Quantity = None
    profile: str = "abrupt"
    size: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of_scenario(cls, fault: Any) -> Self:
        """The record of a fault of a `schema.Scenario`."""
        return cls(
            getattr(fault, "actuator", None),
            fault.type,
            fault.at_s,
            fault.end_s,
            str(fault.profile),
            fault.model_dump(exclude=_NO_SIZE, exclude_none=True),
            sensor=fault.sensor if of_a_sensor(fault) else None,
        )

    def is_named_by(self, name: str | None, removed_surfaces: frozenset[str] = frozenset()) -> bool:
        """Whether a name is right. removed_surfaces: surfaces that damage takes away.

        fault              right names
        of an instrument   the instrument, `unanticipated`
        damage             `unanticipated`, each removed surface
        unanticipated      `unanticipated`
        of a surface       the surface
        """
        if self.sensor is not None:
            return name in (sensor_words(self.sensor), UNANTICIPATED)
        if self.type == DAMAGE:
            return name == UNANTICIPATED or name in removed_surfaces
        return name is not None and name == (UNANTICIPATED if self.type == UNANTICIPATED else self.actuator)

    def is_of_type(self, kind: str | None) -> bool | None:
        """Whether a type is right; None if no type is named, and for a fault of an instrument, which has
        none."""
        if self.sensor is not None:
            return None
        if self.type == DAMAGE:  # a surface that is gone has lost all its effect
            return None if kind in (None, UNANTICIPATED) else kind == LOSS_OF_EFFECTIVENESS
        return None if kind is None else kind == self.type


@dataclass(frozen=True)
class Statistical(Part):
    """The alarm of the statistical detector.

    - `time_s`: time of the alarm, s; None without an alarm.
    - `alarm_level`: an alarm is raised when the detector's score exceeds this level, in standard deviations.
    - `closest_approach`: largest score before a fault, divided by the alarm level.
    """

    time_s: Quantity
    alarm_level: float
    closest_approach: float


@dataclass(frozen=True)
class Inconclusive(Part):
    """The frames in which the built-in diagnosis can conclude nothing.

    - `share`: number of these frames divided by the number of all frames, 0 to 1.
    - `from_s`: time of the first of these frames, s.
    - `reasons`: one mapping for each reason: the `quantity`, its own `share` of the frames, the range that
      was `measured`, the range that was `flown` outside of it, and what it `says`.
    """

    share: float
    from_s: float
    reasons: tuple[Document, ...]


@dataclass(frozen=True)
class Detection(Part):
    """The alarm of a flight. Fields without a value are None.

    - `detected`: True if an alarm was raised.
    - `time_s`: time of the alarm, s.
    - `delay_s`: time from the first frame with the fault to the alarm, s.
    - `axis`: axis of the alarm, `p`, `q` or `r`.
    - `guaranteed_delay_s`: time from the fault to the instant at which an alarm became certain, s.
    - `statistical`: alarm of the statistical detector.
    - `inconclusive`: frames in which the diagnosis can conclude nothing.
    """

    detected: bool
    time_s: Quantity
    delay_s: Quantity
    axis: str | None
    guaranteed_delay_s: Quantity
    statistical: Statistical | None
    inconclusive: Inconclusive | None


@dataclass(frozen=True)
class Named(Part):
    """A fault that the diagnosis named. Fields without a value are None.

    - `fault`: name of the surface or sensor, or `unanticipated`; None while several candidates remain.
    - `type`: fault type.
    - `time_s`: time at which the fault was named, s. `delay_s`: time from the fault to this instant, s.
    - `correct`: True if this fault is the true fault, and if it was not named before it began.
    - `candidates`: names or fault types that are not excluded.
    - `type_correct`: True if `type` is the type of the true fault.
    - `type_delay_s`: time from the fault to the instant at which its type was named, s.
    - `estimate`: estimated size of the fault. The size of a loss of effectiveness is theta, from -1 to 0. The
      size of any other fault is an angle, rad.
    - `estimate_deg`: the same size as an angle, deg.
    - `estimate_interval`: lower and upper end of the interval that contains the size of the fault, in the
      unit of `estimate`.
    - `frequency_rad_s`: frequency of an oscillating fault, rad/s.
    - `so_far`: True if the name was given because all other candidates are excluded. Later data can exclude
      this name, too.
    - `premature`: True if the name was given before the fault began.
    - `estimate_at_s`: time to which `estimate` belongs, s, if it is not the last frame of the flight.
    """

    fault: str | None
    type: str | None
    time_s: Quantity
    delay_s: Quantity
    correct: bool | None
    candidates: tuple[str, ...]
    type_correct: bool | None
    type_delay_s: Quantity
    estimate: Quantity
    estimate_deg: Quantity
    estimate_interval: Span | None
    frequency_rad_s: Quantity
    so_far: bool | None
    premature: bool | None
    _: KW_ONLY
    estimate_at_s: Known[float] = None


@dataclass(frozen=True)
class NameInWindow(Named):
    """A fault that the diagnosis named in a window. `Named` explains the other fields.

    - `true_size`: true size at `estimate_at_s`, in the unit of `estimate`; None if there is no fault of this
      type then.
    """

    _: KW_ONLY
    true_size: Quantity = None


@dataclass(frozen=True)
class Window(Part):
    """A part of the flight in which the same faults are in force.

    - `from_s`, `to_s`: begin and end of the window, s.
    - `faults`: places, in the list `faults` of the metrics, of the faults that act at its end.
    - `detected`: True if the test of a detector exceeded its threshold in the window.
    - `time_s`, `delay_s`: time of the first such frame, s, and the delay from the begin of the window, s.
    - `isolation`: one `NameInWindow` for each fault that is named in the last frame of the window. If no
      fault is named, there is one entry without a name.
    """

    from_s: float
    to_s: float
    faults: tuple[int, ...]
    detected: bool
    time_s: Quantity
    delay_s: Quantity
    isolation: tuple[NameInWindow, ...]


@dataclass(frozen=True)
class Withdrawn(Part):
    """A fault that the diagnosis named, and later withdrew during the flight.

    - `fault`: the name of the fault.
    - `from_s`, `to_s`: times at which the name was given and withdrawn, s.
    - `type`: the fault type that was named with it, or None.
    - `because`: reason of the diagnosis.
    """

    fault: str
    from_s: float
    to_s: float
    _: KW_ONLY
    type: Known[str] = None
    because: Known[str] = None


@dataclass(frozen=True)
class Isolation(Named):
    """The fault that the diagnosis named. `Named` explains the fields that are not listed here.

    - `isolated`: True if a fault was named.
    - `withdrawn`: names of faults that the diagnosis gave and later withdrew, in the order of time.
    - `names`: all names of faults that the diagnosis gave, each once, in the order in which the faults begin.
      Withdrawn names are included, but premature names are not.
    - `probing_s`: times at which probing began and ended, s; None without probing.
    - `faults`: one `Named` for each fault if several faults were named at once; otherwise empty.
    - `types_withdrawn`: fault types that the diagnosis gave and later withdrew, while the name of the surface
      remained; None if there are none.
    """

    isolated: bool
    withdrawn: tuple[Withdrawn, ...]
    names: tuple[str, ...]
    probing_s: Span | None
    faults: tuple[Named, ...]
    _: KW_ONLY
    types_withdrawn: Known[tuple[Withdrawn, ...]] = None

    _first = ("isolated", "fault", "type", "time_s", "delay_s", "correct", "estimate")
    _last = ("estimate_at_s", "types_withdrawn")


@dataclass(frozen=True)
class Rates(Part):
    """One number for each axis, deg/s."""

    p: Quantity
    q: Quantity
    r: Quantity


@dataclass(frozen=True)
class Tracking(Part):
    """The tracking errors and the movement of the surfaces.

    - `pre_fault_rms_deg_s`, `post_fault_rms_deg_s`: RMS tracking error of each axis before and after the
      first fault, deg/s. A value is None if the flight has no time before or after the fault.
    - `surface_travel_deg`: a mapping from surface to the length of its path, deg. Upward and downward
      movements are added.
    - `surface_energy_deg2_s`: a mapping from surface to the integral of its squared angular speed, deg²/s.
    """

    pre_fault_rms_deg_s: Rates | None
    post_fault_rms_deg_s: Rates | None
    surface_travel_deg: BySurface
    surface_energy_deg2_s: BySurface


@dataclass(frozen=True)
class ModeChange(Part):
    """A change of the supervisor's mode.

    - `time_s`: time from which the mode is active, s.
    - `mode`: `nominal`, `adaptive`, `reallocated` or `unanticipated`.
    """

    time_s: float
    mode: str


@dataclass(frozen=True)
class ChangeInFlight(Part):
    """A change of law, scheme or sensors in flight.

    - `law`, `scheme`: the new law and scheme; None if unchanged. `sensors`: True if the sensors changed.
    - `renewed`: True if the change restarted the diagnosis. Only then the document has the next two keys.
    - `detection_time_s`, `isolated`: time of the alarm, s, and name of the fault of the diagnosis before.
    - `false_alarm`: True if that alarm was false.
    """

    time_s: float
    law: str | None
    scheme: str | None
    sensors: bool
    detection_time_s: Quantity
    isolated: str | None
    _: KW_ONLY
    false_alarm: Known[bool] = None
    renewed: bool = True

    def document(self) -> Document:
        """The section, without alarm and name if the diagnosis was not restarted."""
        section = super().document()
        left_out = () if section.pop("renewed") else ("detection_time_s", "isolated")
        return {key: value for key, value in section.items() if key not in left_out}

    @classmethod
    def of(cls, section: Any) -> Self:
        """The record of a section of JSON, which has an alarm if the diagnosis was restarted."""
        return super().of({**section, "renewed": "detection_time_s" in section})


@dataclass(frozen=True)
class EnvelopeExit(Part):
    """A time outside the validated envelope, from start_s to end_s."""

    start_s: float
    end_s: float


@dataclass(frozen=True)
class EnvelopeExitTotals(Part):
    """Number and sum of the times outside the envelope.

    exits_left_out: how many of them are not in the list `envelope_exits`.
    """

    exits: int
    outside_s: float
    exits_left_out: int


@dataclass(frozen=True)
class Departure(Part):
    """The loss of the aircraft.

    - `time_s`: time of the loss, s.
    - `signal`: the signal that left its limits.
    """

    time_s: float
    signal: str


@dataclass(frozen=True)
class AxisAuthority(Part):
    """Control authority about one axis after the fault.

    - `given_share`: share of the demanded angular acceleration that the surfaces gave.
    - `beyond_s`: time for which the surfaces could not hold the rate, s.
    - `least_rad_s2`, `greatest_rad_s2`: range of the angular acceleration that all surfaces can give at the
      end, with the effectiveness that the law assumes.
    - `healthy_...`, `engines_...`: the same range of the healthy aircraft, and of the engines.
    """

    given_share: float
    beyond_s: float
    _: KW_ONLY
    least_rad_s2: Known[float] = None
    greatest_rad_s2: Known[float] = None
    healthy_least_rad_s2: Known[float] = None
    healthy_greatest_rad_s2: Known[float] = None
    engines_least_rad_s2: Known[float] = None
    engines_greatest_rad_s2: Known[float] = None


@dataclass(frozen=True)
class Authority(Part):
    """Control authority by axis."""

    p: AxisAuthority
    q: AxisAuthority
    r: AxisAuthority


@dataclass(frozen=True)
class EnginePowerUse(Part):
    """Control of pitch by engine power.

    - `from_s`: time at which it began, s. `in_charge_s`: sum of its times, s.
    - `lowest_inhg`, `highest_inhg`: range of the manifold pressure, inHg.
    """

    from_s: float
    in_charge_s: float
    lowest_inhg: float
    highest_inhg: float


@dataclass(frozen=True)
class Deviations(Part):
    """Deviations from the commanded profile by channel; None if the channel has no command, or if a largest
    angle had no time to settle."""

    altitude_m: Quantity
    airspeed_mps: Quantity
    heading_deg: Quantity
    bank_deg: Quantity


@dataclass(frozen=True)
class ProfileDeviations(Deviations):
    """The largest deviations. Airspeeds are means over 10 s.

    - `airspeed_limited_mps`: deviation from the commanded airspeed, limited to speeds that the aircraft can
      hold.
    - `airspeed_at_one_instant_mps`: largest deviation of the airspeed itself, without a mean.
    """

    airspeed_limited_mps: Quantity
    airspeed_at_one_instant_mps: Quantity


@dataclass(frozen=True)
class ArrivalDeviations(Deviations):
    """The mean deviations at the end of the flight, with signs.

    - `in_envelope`: True if the flight ends in the validated envelope.
    """

    in_envelope: bool


@dataclass(frozen=True)
class ProtectionLimit(Part):
    """A limit that the envelope protection sets to a command.

    - `time_s`: time from which it is active, s. `in_force`: True if it is active at the end.
    - `limits`, `side`, `value`: the limited command, the side and the limit in the unit of the command.
    - `because`: reason of the limit.
    """

    time_s: float
    limits: str
    side: str
    value: float
    because: str
    in_force: bool


@dataclass(frozen=True)
class Expectation(Part):
    """One expectation of the scenario, and its result.

    - `name`: key of the expectation in the section `expect`.
    - `passed`: True if it was met.
    - `expected`, `actual`: expected and actual value.
    - `reason`: reason why the expectation was not met; None if it was met or if no reason is known.
    """

    name: str
    passed: bool
    expected: Any
    actual: Any
    _: KW_ONLY
    reason: Known[str] = None

    @property
    def expected_and_actual_text(self) -> str:
        """Expected and actual value, as tests and CI show them."""
        expected, actual = map(as_json_value, (self.expected, self.actual))
        return f"expected {expected}, actual {actual}"


@dataclass(frozen=True)
class Judged:
    """Whether a flight, a sweep or a plan met its expectations.

    error: the reason why it could not be flown, or None. took_s: its computing time, s.
    """

    name: str
    passed: bool = False
    expectations: tuple[Expectation, ...] = ()
    error: str | None = None
    took_s: float = 0.0


@dataclass(frozen=True)
class CertificateCounts(Part):
    """The counts of a certificate. statements: those with a proof. without: alarms or exclusions without a
    proof."""

    statements: int
    without: int


@dataclass(frozen=True)
class LatencyMs(Part):
    """Time from a packet to its answer, ms."""

    median: float
    p99: float
    largest: float


@dataclass(frozen=True)
class PacketIntervalMs(Part):
    """Time between two packets, ms."""

    mean: float
    jitter_rms: float
    largest: float


@dataclass(frozen=True)
class Link(Part):
    """The link to an autopilot: rates, counts of packets and times. beaver_ftc_links/sitl/link.py counts
    them.

    - `diagnosed_from_s`: begin of the diagnosis, s.
    - `speed`: simulated time over real time. `late_ms`: delay behind real time, ms.
    - `said`: messages to the ground station.
    """

    protocol: str
    packets_hz: float
    frames_hz: float
    frames: int
    repeated: int
    late: int
    missed: int
    resets: int
    malformed: int
    strangers: int
    off_rate: int
    silences: int
    latency_ms: LatencyMs
    interval_ms: PacketIntervalMs
    longest_silence_s: float
    diagnosed_from_s: Quantity
    speed: float
    late_ms: float
    said: tuple[Document, ...]


@dataclass(frozen=True)
class Metrics(Part):
    """The document metrics.json.

    - `assumes`: assumptions of the diagnosis about the truth, such as `sensors-sound`.
    - `outside_class`: faults of surfaces and sensors that the declared class does not contain.
    - `fault_free_s`: time in which an alarm would be false, s.
    - `saturation_s`: a mapping from surface to the time for which it was saturated, s.
    - `link`: only under an autopilot. `interrupted_s`: time at which such a flight was interrupted, s.
    - `certificate`: only of a flight with a certificate.
    """

    scenario: str
    seed: int
    frames: int
    flight: FlightCondition
    fault: Fault | None
    faults: tuple[DeclaredFault, ...]
    assumes: tuple[str, ...]
    outside_class: tuple[str, ...]
    detection: Detection
    isolation: Isolation
    false_alarm: bool
    fault_free_s: float
    tracking: Tracking
    supervisor: tuple[ModeChange, ...]
    changes: tuple[ChangeInFlight, ...]
    mode_changes_left_out: int
    envelope_exits: tuple[EnvelopeExit, ...]
    envelope: EnvelopeExitTotals
    departure: Departure | None
    authority: Authority | None
    engine_power: EnginePowerUse | None
    profile: ProfileDeviations | None
    arrival: ArrivalDeviations | None
    limits: tuple[ProtectionLimit, ...]
    saturation_s: BySurface
    hints: tuple[str, ...]
    expectations: tuple[Expectation, ...]
    passed: bool
    versions: dict[str, str]
    _: KW_ONLY
    windows: Known[tuple[Window, ...]] = None
    interrupted_s: Known[float] = None
    link: Known[Link] = None
    certificate: Known[CertificateCounts] = None

    @property
    def judged(self) -> Judged:
        """The flight with its expectations, as `Judged`."""
        return Judged(self.scenario, self.passed, self.expectations)

    @property
    def fault_found_s(self) -> Quantity:
        """Delay from the fault to the alarm, s; None without an alarm, or if the alarm was false."""
        return None if self.false_alarm else self.detection.delay_s

    @property
    def fault_named(self) -> bool:
        """Whether the fault was named correctly, without a false alarm before it."""
        return bool(self.isolation.correct) and not self.false_alarm


_READ_BY_ALL = ("flight", "detection", "isolation", "tracking")  # sections that every flight has


def read_metrics(path: Path) -> Document:
    """The document metrics.json of a flight. Raises OSError, and ValueError for any other document."""
    document: Document = files.read_json(path)
    try:
        metrics = Metrics.of(document)
    except (AttributeError, TypeError) as error:
        raise ValueError("holds no metrics of a flight") from error
    if any(getattr(metrics, section) is None for section in _READ_BY_ALL):
        raise ValueError("lacks a section that every flight has")
    return document
