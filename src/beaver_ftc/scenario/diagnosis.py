"""What a scenario may say about the diagnosis (`fdi:`) and the control law (`control:`), with defaults and
their reasons."""

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, Strict, field_validator, model_validator

from beaver_ftc.aircraft import AXES
from beaver_ftc.design.turbulence import Severity
from beaver_ftc.documents.document import Conflict, Location, Section, deny, entry, number, refuse
from beaver_ftc.documents.errors import suggestion
from beaver_ftc.plugins import DETECTORS, LAWS, needs_leaders, refusal, wrong_options
from beaver_ftc.scenario.actuators import DeadBand, OfSurfaces
from beaver_ftc.scenario.airframe import checked_aircraft, left_out, named
from beaver_ftc.scenario.pairs import pairs_refused
from beaver_ftc.scenario.sensors import Sensors

if TYPE_CHECKING:
    from beaver_ftc.aircraft import Aircraft


def leaders_missed(scenario: Any, aircraft: "Aircraft") -> Iterator[Conflict]:
    """Laws and schemes that need a surface for each axis, of an aircraft without a rudder or ailerons."""
    if len(aircraft.primary) == len(AXES):
        return
    wanted: list[tuple[Location, str, str | None]]
    wanted = [(("control",), "law", scenario.control.law), (("fdi",), "scheme", scenario.fdi.scheme)]
    for i, change in enumerate(scenario.changes):
        wanted += [(("changes", i), "law", change.law), (("changes", i), "scheme", change.scheme)]
    for where, key, name in wanted:
        group = LAWS if key == "law" else DETECTORS
        if name is not None and needs_leaders(group, name):
            has = f"{aircraft.name} has {', '.join(aircraft.surfaces)}"
            yield (
                (*where, key),
                f"{name} needs a surface for each of roll, pitch and yaw, {has}, allowed: others",
            )


MAX_POLES = 6  # of the bank of detection filters, the published one included
DEADBEAT_PER_S = 1e6  # a pole at which exp(-lam dt) is 0: the filter keeps nothing but the last frame

Scheme = Annotated[str, named(partial(refusal, DETECTORS))]
Bound = Annotated[float, Field(ge=0, le=100)]
Share = Annotated[float, Field(ge=0, le=0.9)]
Deflection = Annotated[float, Field(ge=0, le=30)]
Pole = Annotated[float, Field(gt=0, le=DEADBEAT_PER_S)]


class PerAxis(Section, strict=True):
    """One non-negative number for each axis.

    p: roll
    q: pitch
    r: yaw
    """

    p: Bound = entry(0.0, examples=[0.1])
    q: Bound = entry(0.0, examples=[0.1])
    r: Bound = entry(0.0, examples=[0.1])

    def as_tuple(self) -> tuple[float, float, float]:
        """(p, q, r)"""
        return self.p, self.q, self.r


def _can_be_bounded(given: Sensors) -> Sensors:
    """Errors that have a bound, or a refusal."""
    loose = [name for name, sensor in given if not sensor.is_bounded]
    refuse([((name,), "a lag, a delay or a lost sample has no bound, allowed: 0") for name in loose])
    blind = [name for name, sensor in given if sensor.scale_error >= 1.0]
    says = "1 would admit an instrument that always reads 0, allowed: less than 1"
    refuse([((name, "scale_error"), says) for name in blind])
    return given


BoundedSensors = Annotated[Sensors, AfterValidator(_can_be_bounded)]


class ActuatorBound(Section, strict=True):
    """one surface.

    bandwidth: of the bandwidth, relative
    rate_limit: of the rate limit, relative
    dead_band_deg: largest distance from the command at which the actuator does not move, deg
    """

    bandwidth: Share = number(0.0, "share of 1", examples=[0.2])
    rate_limit: Share = number(0.0, "share of 1", examples=[0.2])
    dead_band_deg: DeadBand = number(0.0, "deg", examples=[0.1])

    @property
    def is_none(self) -> bool:
        """Whether the actuator is known exactly."""
        return not (self.bandwidth or self.rate_limit or self.dead_band_deg)


class ActuatorBounds(OfSurfaces):
    """Largest errors of the actuators. A key directly in this section applies to all surfaces, a key in the
    section of a surface only to this surface."""

    __pydantic_extra__: dict[str, ActuatorBound]
    of_one = ActuatorBound

    @property
    def is_none(self) -> bool:
        """Whether every actuator is known exactly."""
        return all(bound.is_none for _, bound in self)


class Bounds(Section, strict=True):
    """Declared errors, from which the thresholds follow.

    inertia_coupling: largest relative error of the inertia coupling
    constant_rad_s2: largest other error of the angular acceleration, rad/s2
    coefficients: largest relative error of the moment coefficients: of all, or of each by name
    inertia: largest relative error of Ix, Iy, Iz and Jxz
    sensors: largest measurement errors: noise, bias, resolution and slope error
    actuators: largest errors of the actuators
    deflection_deg: largest further error of the position of a surface, deg
    turbulence: strongest turbulence (Dryden model)
    vertical_wind_mps: strongest steady vertical wind, up or down, for the sensor monitor, m/s
    """

    inertia_coupling: PerAxis = number(PerAxis(p=0.25, q=0.25, r=0.25), "share of 1", examples=[{"p": 0.1}])
    constant_rad_s2: PerAxis = entry(PerAxis(p=0.02, q=0.02, r=0.02))
    coefficients: Share | dict[str, Share] = number(0.0, "share of 1", examples=[0.05])
    inertia: Share = number(0.0, "share of 1", examples=[0.05])
    sensors: BoundedSensors = entry(Sensors, examples=["tactical-grade"])
    actuators: ActuatorBounds = entry(ActuatorBounds, examples=[{"bandwidth": 0.2}])
    deflection_deg: Deflection = entry(0.0, examples=[0.2])
    turbulence: Severity = "none"
    vertical_wind_mps: float = entry(1.0, ge=0, le=100, examples=[3])

    @field_validator("coefficients")
    @classmethod
    def _known_terms(cls, given: float | dict[str, float]) -> float | dict[str, float]:
        known = sorted(term.name for term in checked_aircraft().moments)
        unknown = [name for name in given if name not in known] if isinstance(given, dict) else []
        refuse([((name,), f"unknown moment coefficient{suggestion(name, known)}") for name in unknown])
        return given


class Statistical(Section, strict=True):
    """Likelihood ratio tests in addition to the worst-case thresholds. Their alarm levels follow from the
    keys of this section.

    false_alarms_per_h: accepted number of false alarms in each flight hour
    misnaming: probability that noise excludes the true fault in one second
    uncertainty_rad_s: highest angular frequency of the model error, rad/s
    """

    false_alarms_per_h: float = number(1e-3, "1/h", gt=0, le=3600)
    misnaming: float = number(1e-4, "share of 1", gt=0, lt=0.5)
    uncertainty_rad_s: float = entry(15.0, gt=0, le=1000)


class Probing(Section):
    """Active diagnosis of flap and elevator. The flap moves by a small angle, and the elevator moves against
    it.

    If both surfaces follow their commands, their effects cancel, and the aircraft does not react. A reaction
    shows which surface is faulty. Probing begins some time after an alarm in pitch, if neither surface is
    named. This wait is long enough to detect a slow oscillation. Probing ends when a surface is named.
    """

    amplitude_deg: float = entry(3.0, "largest flap deflection, downwards, deg", gt=0, le=10)
    frequency_hz: float = entry(0.5, "frequency of its movements, Hz", gt=0, le=5)
    duration_s: float = entry(4.0, "longest duration, s", gt=0, le=60)


class Sharpen(Section, strict=True):
    """Steps that make the published tests more sensitive. Each step keeps the guarantees G1 (no false alarm)
    and G2 (no exclusion of the true fault)."""

    pole_bank: bool = entry(
        True,
        "several detection filters (`fdi.pole_bank_per_s`), each of which can raise the alarm",
    )
    memory: bool = entry(True, "each fault must explain the whole flight, not only the time after the alarm")
    shared_effectiveness: bool = entry(True, "each surface has one parameter for all axes")
    set_membership: bool = entry(
        True,
        "with `fault_profile: abrupt`: one frame can exclude a value of the parameter",
    )

    @model_validator(mode="before")
    @classmethod
    def _all_or_none(cls, given: Any) -> Any:
        if given in ("all", "none"):
            return dict.fromkeys(cls.model_fields, given == "all")
        return given

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: Any) -> dict[str, Any]:
        """One by one, or in a word."""
        one_by_one = handler(core)
        return one_by_one | {"anyOf": [{"enum": ["all", "none"]}, {"type": one_by_one.pop("type")}]}


class FdiConfig(Section, strict=True):
    """The diagnosis.

    scheme: diagnosis scheme, a name that `beaver-ftc list schemes` prints
    options: parameters of the scheme, by name
    fault_class: faults that the diagnosis looks for. `published`: a loss of effectiveness of aileron,
    elevator or rudder; sensors are assumed to be sound. `all`: all fault types on all surfaces, and faults
    of sensors
    pairs: true: also look for simultaneous faults of two surfaces (elevator with flap, aileron with rudder),
    with `fault_class: all`
    sensor_monitor: whether instruments are compared with each other. Left out, or `auto`: `always` with
    `fault_class: all`, otherwise `never`
    slowest_oscillation_rad_s: lowest angular frequency of an oscillating surface,
    rad/s
    slowest_rate_deg_s: lowest rate limit of a slow surface. A slower one counts as jammed, deg/s
    probing: active diagnosis, for `fault_class: all`. `{}`: on; left out: off
    statistical: statistical detector besides the worst-case detector. `{}`: on; left out: off
    authority: detector that can raise the alarm and exclude, with `statistical`
    thresholds: isolation tests: the residual must stay in an interval, or its magnitude below one bound.
    `zhang2005` sets `published`
    detection_pole_per_s: pole of the first detection filter, 1/s
    isolation_pole_per_s: pole of the isolation estimators, 1/s
    forgetting_time_s: time constant of the estimates, longer than one period of the reference, s
    sharpen: steps beyond the published scheme. `thresholds: published` sets `none`
    pole_bank_per_s: poles of the detection filters after the first, 1/s
    fault_profile: assumption about the size of a fault. `any`: it can change. `abrupt`: it is constant
    """

    scheme: Scheme = entry("adaptive-estimators", examples=["zhang2005"])
    options: dict[str, float] = entry(
        {}, range="as each option has it", needs={"scheme": "zhang2005"}, examples=[{"network_gain": 150}]
    )
    fault_class: Literal["published", "all"] = "published"
    pairs: bool = entry(False, needs={"fault_class": "all"}, examples=[True])
    sensor_monitor: Literal["always", "never", "auto"] | None = entry(None, examples=["always"])
    slowest_oscillation_rad_s: float = entry(1.0, gt=0, le=100)
    slowest_rate_deg_s: float = entry(0.5, gt=0, le=100)
    probing: Probing | None = entry(None, examples=[{}])
    statistical: Statistical | None = entry(None, examples=[{}])
    authority: Literal["either", "worst-case", "statistical"] = "either"
    thresholds: Literal["interval", "published"] = "interval"
    detection_pole_per_s: float = entry(10.0, gt=0, le=1000)
    isolation_pole_per_s: float = entry(10.0, gt=0, le=1000)
    forgetting_time_s: float = entry(5.0, gt=0, le=3600)
    bounds: Bounds = entry(left_out(Bounds))
    sharpen: Sharpen = entry(Sharpen(), examples=["none"])
    pole_bank_per_s: Annotated[tuple[Pole, ...], Strict(False)] = entry(
        (DEADBEAT_PER_S,), max_length=MAX_POLES - 1, examples=[[20, 100]]
    )
    fault_profile: Literal["any", "abrupt"] = "any"

    @property
    def is_ours(self) -> bool:
        """Whether our scheme diagnoses, which is compiled in."""
        return self.scheme == "adaptive-estimators"

    @property
    def is_published(self) -> bool:
        """Whether the published scheme diagnoses, and nothing else."""
        return self.scheme == "zhang2005"

    @property
    def diagnoses(self) -> bool:
        """Whether a scheme that is compiled in diagnoses, ours or the published one."""
        return self.is_ours or self.is_published

    def with_scheme(self, scheme: str, options: dict[str, float]) -> Self:
        """The same with another scheme; the published one has nothing that the paper has not."""
        further = _AS_PUBLISHED if scheme == "zhang2005" else {}
        return self.model_copy(update={"scheme": scheme, "options": options, **further})

    @property
    def weighs_chance(self) -> bool:
        """Whether our scheme has its statistical detector."""
        return self.statistical is not None and self.is_ours

    @property
    def looks_across(self) -> bool:
        """Whether what a surface cannot have done may exclude it. Of two faults at once one may do what the
        other does not."""
        return self.authority != "worst-case" and self.fault_class == "all" and not self.pairs

    def compares_across(self, substeps: int) -> bool:
        """Whether motion across a surface's column excludes the surface. Within a frame of several instants
        a column turns with the incidence while the surface moves, and shows across its mean."""
        return self.looks_across and substeps <= 1

    @property
    def monitors_sensors(self) -> bool:
        """Whether the sensor monitor runs: as said, otherwise if the class has faults of sensors."""
        by_class = "always" if self.fault_class == "all" else "never"
        said = None if self.sensor_monitor == "auto" else self.sensor_monitor
        return (said or by_class) == "always" and self.is_ours

    @property
    def assumes_sound_sensors(self) -> bool:
        """Whether a scheme that is compiled in diagnoses, and no sensor is in doubt."""
        return self.diagnoses and not self.monitors_sensors

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.pairs and self.fault_class != "all":
            deny("pairs of the published class are not known, allowed: true with fault_class: all", "pairs")
        if self.pairs and (why := pairs_refused(self.bounds.sensors, checked_aircraft())):
            deny(f"{why}, allowed: false", "pairs")
        if self.authority == "statistical" and self.statistical is None:
            deny("statistical wants fdi.statistical, e.g. {}, allowed: either, worst-case", "authority")
        refuse(wrong_options(DETECTORS, self.scheme, self.options))
        if self.is_published:
            as_published = _AS_PUBLISHED.items()
            beyond = [key for key, value in as_published if getattr(self, key) not in (value, None, "auto")]
            refuse(((key,), f"zhang2005 is the paper's alone, allowed: {_AS_SAID[key]}") for key in beyond)
        return self

    @model_validator(mode="before")
    @classmethod
    def _published_means_published(cls, given: Any) -> Any:
        if isinstance(given, dict) and given.get("scheme") == "zhang2005":
            return {"sharpen": "none", "thresholds": "published", **given}
        if isinstance(given, dict) and given.get("thresholds") == "published":
            return {"sharpen": "none", **given}
        return given


# What `scheme: zhang2005` goes with, as values and as a scenario says them.
_AS_PUBLISHED = {
    "fault_class": "published", "pairs": False, "sensor_monitor": "never", "probing": None,
    "statistical": None, "authority": "either", "thresholds": "published",
    "sharpen": Sharpen(pole_bank=False, memory=False, shared_effectiveness=False, set_membership=False),
}  # fmt: skip
_AS_SAID = {
    "fault_class": "published", "pairs": "false", "sensor_monitor": "never", "probing": "null",
    "statistical": "null", "authority": "either", "thresholds": "published", "sharpen": "none",
}  # fmt: skip


MODES = ("nominal", "adaptive", "reallocated", "unanticipated")  # of the supervisor, as the log numbers them

Law = Annotated[str, named(partial(refusal, LAWS))]


class EnginePower(Section, strict=True):
    """Control of pitch by engine power, if elevator and flap are both lost. It requires a law
    that reallocates, with `fault_class: all`, or an oracle law.

    enabled: false: the law does not move the engines
    speed_gain_inhg_per_mps: less manifold pressure for each m/s above the mean airspeed, inHg per m/s
    attitude_gain_inhg_per_deg: more manifold pressure for each deg that the nose is too high, inHg per deg
    washout_s: time constant of the mean airspeed, about one period of the phugoid, s
    attitude_memory_s: time constant of the memory of the pitch rate error, s
    smoothing_s: time constant of the lag on the measured airspeed,
    s
    lowest_inhg: manifold pressure with the throttle closed, inHg
    highest_inhg: highest manifold pressure, inHg
    rate_inhg_s: fastest change of the manifold pressure, inHg/s
    patience_s: time for which both surfaces must be lost before, s
    release_s: time for which a surface must act again after, s
    """

    enabled: bool = True
    speed_gain_inhg_per_mps: float = number(3.0, "inHg per m/s", ge=0, le=50)
    attitude_gain_inhg_per_deg: float = number(0.9, "inHg per deg", ge=0, le=50)
    washout_s: float = entry(20.0, gt=0, le=600)
    attitude_memory_s: float = entry(10.0, gt=0, le=600)
    smoothing_s: float = entry(0.5, ge=0.05, le=10)
    lowest_inhg: float = entry(10.0, ge=0, le=50)
    highest_inhg: float = entry(36.5, ge=0, le=50)
    rate_inhg_s: float = number(5.0, "inHg/s", gt=0, le=100)
    patience_s: float = entry(1.0, gt=0, le=60)
    release_s: float = entry(10.0, gt=0, le=600)

    @model_validator(mode="after")
    def _a_range(self) -> Self:
        if self.highest_inhg < self.lowest_inhg:
            deny(f"below lowest_inhg, allowed: {self.lowest_inhg:g} inHg or more", "highest_inhg")
        return self


class ControlConfig(Section, strict=True):
    """The control law and its gains, which the published study does not state.

    law: control law, a name that `beaver-ftc list laws` prints
    options: parameters of the law, by name
    gain_margin_db: smallest gain margin of each loop of the default law, dB
    phase_margin_deg: smallest phase margin of each loop of the default law, deg
    noise_share: largest standard deviation of the surface rate by gyro noise, divided by the rate limit of
    the surface
    proportional_per_s: proportional gain Kp of the tracking error, 1/s
    integral_per_s2: integral gain Ki of the tracking error, 1/s2
    reference_natural_frequency_rad_s: natural frequency of the reference model, higher than the bandwidth of
    the control loop, rad/s
    reference_damping: damping ratio of the reference model
    network_gain_per_s2: learning gain of the network of the laws `adaptive` and `fault-tolerant-published`,
    1/s2
    network_leak_per_s: rate at which the network forgets after the isolation, 1/s
    network_weight_limit_rad_s2: largest magnitude of each weight of the network, rad/s2
    effectiveness_rate_per_s: fastest change of the effectiveness that the law uses, 1/s
    least_effectiveness: smallest effectiveness with which the law still uses a surface
    hand_over_s: duration of the reallocation from a failed surface to its stand-in, s
    power: control of pitch by engine power, if elevator and flap are both lost: a law that reallocates,
    with `fault_class: all`, or an oracle law
    """

    law: Law = entry("fault-tolerant", examples=["nominal"])
    options: dict[str, float] = entry(
        {}, range="as each option has it", needs={"law": "zhang2005"}, examples=[{"network_gain": 40}]
    )
    gain_margin_db: float = number(6.0, "dB", gt=0, le=40)
    phase_margin_deg: float = entry(45.0, gt=0, le=80)
    noise_share: float = number(0.5, "share of 1", gt=0, le=1)
    proportional_per_s: float = entry(2.0, gt=0, le=500)
    integral_per_s2: float = number(1.0, "1/s2", ge=0, le=500)
    reference_natural_frequency_rad_s: float = entry(10.0, gt=0, le=100)
    reference_damping: float = number(1.0, "1", ge=0.2, le=5)
    network_gain_per_s2: float = number(60.0, "1/s2", ge=0, le=1000)
    network_leak_per_s: float = entry(1.0, ge=0, le=50)
    network_weight_limit_rad_s2: float = entry(20.0, gt=0, le=1000)
    effectiveness_rate_per_s: float = entry(4.0, gt=0, le=1000)
    least_effectiveness: float = number(0.1, "share of 1", gt=0, lt=1)
    hand_over_s: float = entry(1.0, gt=0, le=60)
    power: EnginePower = entry(EnginePower)

    @model_validator(mode="after")
    def _known_options(self) -> Self:
        refuse(wrong_options(LAWS, self.law, self.options))
        return self
