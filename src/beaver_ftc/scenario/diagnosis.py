"""What a scenario may say about the diagnosis (`fdi:`), with defaults and their reasons."""

from functools import partial
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, Strict, field_validator, model_validator

from beaver_ftc.design.dryden import Severity
from beaver_ftc.documents.document import Section, deny, entry, number, refuse
from beaver_ftc.documents.errors import suggestion
from beaver_ftc.plugins import DETECTORS, refusal, wrong_options
from beaver_ftc.scenario.airframe import checked_aircraft, named
from beaver_ftc.scenario.pairs import pairs_refused
from beaver_ftc.scenario.sensors import Sensors

MAX_POLES = 6  # of the bank of detection filters, the published one included
DEADBEAT_PER_S = 1e6  # a pole at which exp(-lam dt) is 0: the filter keeps nothing but the last frame

Scheme = Annotated[str, named(partial(refusal, DETECTORS))]
Bound = Annotated[float, Field(ge=0, le=100)]
Share = Annotated[float, Field(ge=0, le=0.9)]
Deflection = Annotated[float, Field(ge=0, le=30)]
Pole = Annotated[float, Field(gt=0, le=DEADBEAT_PER_S)]


class PerAxis(Section, strict=True):
    """One non-negative number for each of p, q and r.

    p: of roll
    q: of pitch
    r: of yaw
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


class Bounds(Section, strict=True):
    """What uncertainty the diagnosis admits; thresholds follow from it [Zhang2005, sec. VII].

    inertia_coupling: relative error of Pqr, Qpr, Rpq: as published
    constant_rad_s2: unstructured angular acceleration, rad/s2: as published
    coefficients: tolerance of the moment coefficients as a share: of all, or by name
    inertia: tolerance of Ix, Iy, Iz and Jxz as a share of each
    sensors: measurement errors, as those of the truth: a preset, or noise, bias, resolution, slope by
    signal
    deflection_deg: how far a surface may be from its actuator's model, deg
    turbulence: rotation of the air, which no instrument sees: Dryden, at the height flown, no less than above
    2000 ft
    vertical_wind_mps: the strongest steady vertical wind, up or down, by which the sensor monitor compares
    altitude and climb, m/s
    """

    inertia_coupling: PerAxis = number(PerAxis(p=0.25, q=0.25, r=0.25), "share of 1")
    constant_rad_s2: PerAxis = entry(PerAxis(p=0.02, q=0.02, r=0.02))
    coefficients: Share | dict[str, Share] = number(0.0, "share of 1", examples=[0.05])
    inertia: Share = number(0.0, "share of 1", examples=[0.05])
    sensors: BoundedSensors = entry(Sensors)
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
    """Likelihood ratio tests beside the worst-case thresholds; levels follow from the rates declared here.

    false_alarms_per_h: at most so many false alarms per flight hour under the noise declared
    misnaming: chance, within a second, that noise excludes the true fault
    uncertainty_rad_s: how fast an uncertainty that is merely bounded swings, rad/s: as published
    """

    false_alarms_per_h: float = number(1e-3, "1/h", gt=0, le=3600)
    misnaming: float = number(1e-4, "share of 1", gt=0, lt=0.5)
    uncertainty_rad_s: float = entry(15.0, gt=0, le=1000)


class Probing(Section):
    """A small movement of the flap, met by the elevator, to learn which of the two is at fault.

    If both follow, nothing is felt. It begins when the pitch axis is at fault and neither is named once a
    slow oscillation would have shown, and ends when one is.
    """

    amplitude_deg: float = entry(3.0, "greatest flap deflection, downwards, deg", gt=0, le=10)
    frequency_hz: float = entry(0.5, "movements a second, Hz", gt=0, le=5)
    duration_s: float = entry(4.0, "at most so long, s", gt=0, le=60)


class Sharpen(Section, strict=True):
    """Margin the published scheme gives away; each step loses no guarantee (theory.md, section 3)."""

    pole_bank: bool = entry(True, "alarm on the first of several filters: `fdi.pole_bank_per_s`")
    memory: bool = entry(True, "hold each fault against the whole flight, not only what follows the alarm")
    shared_effectiveness: bool = entry(True, "one parameter per surface, shared by the axes it moves")
    set_membership: bool = entry(True, "intersect the sets of a parameter declared constant")

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
    """Gains, bounds and the choice of scheme. All have defaults.

    scheme: a registered detector, `beaver-ftc list schemes` names them; none: nobody diagnoses
    options: parameters of a registered detector, by name
    fault_class: what may befall a surface: loss of effectiveness of aileron, elevator or rudder, or every
    fault type on all four
    pairs: also look for two faults at once on different surfaces (class `all`), pitch and roll-yaw each
    for itself
    sensor_monitor: hold the instruments against one another: auto, where the scenario breaks one
    slowest_oscillation_rad_s: oscillatory failures are this fast or faster (class `all`), rad/s
    slowest_rate_deg_s: a slow surface moves this fast or faster, a slower one is a jam (class `all`),
    deg/s
    probing: active diagnosis (class `all`): off unless given; `{}` for its defaults
    statistical: statistical detector beside the worst-case one: off unless given; `{}` for its defaults
    authority: whose alarms and exclusions count where there are two detectors
    thresholds: isolation test: signed interval or the paper's norm bound
    detection_pole_per_s: Lambda0, 1/s: a few times the bound shows in 0.1 s
    isolation_pole_per_s: Lambda of the isolation estimators, 1/s
    forgetting_time_s: memory of the estimates, s: longer than a reference period
    sharpen: steps beyond the published scheme: `all`, `none` or one by one
    pole_bank_per_s: filters beside the published one, 1/s; the default keeps a single frame
    fault_profile: what is assumed of the fault's course: nothing, or constant once it is there
    """

    scheme: Scheme = entry("adaptive-estimators", examples=["zhang2005"])
    options: dict[str, float] = entry(
        {}, range="as each option has it", needs={"scheme": "zhang2005"}, examples=[{"network_gain": 150}]
    )
    fault_class: Literal["published", "all"] = "published"
    pairs: bool = entry(False, needs={"fault_class": "all"}, examples=[True])
    sensor_monitor: Literal["auto", "always", "never"] = "auto"
    slowest_oscillation_rad_s: float = entry(1.0, gt=0, le=100)
    slowest_rate_deg_s: float = entry(0.5, gt=0, le=100)
    probing: Probing | None = None
    statistical: Statistical | None = None
    authority: Literal["either", "worst-case", "statistical"] = "either"
    thresholds: Literal["interval", "published"] = "interval"
    detection_pole_per_s: float = entry(10.0, gt=0, le=1000)
    isolation_pole_per_s: float = entry(10.0, gt=0, le=1000)
    forgetting_time_s: float = entry(5.0, gt=0, le=3600)
    bounds: Bounds = Bounds()
    sharpen: Sharpen = entry(Sharpen())
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

    def monitors_sensors(self, sensor_fails: bool) -> bool:
        """Whether the sensor monitor runs. A flight in which no instrument fails does without it: sound
        instruments never raise its alarm."""
        needed = {"always": True, "auto": sensor_fails, "never": False}
        return needed[self.sensor_monitor] and self.is_ours

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
            beyond = [key for key, value in _AS_PUBLISHED.items() if getattr(self, key) != value]
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
    "fault_class": "published", "pairs": False, "sensor_monitor": "auto", "probing": None,
    "statistical": None, "authority": "either", "thresholds": "published",
    "sharpen": Sharpen(pole_bank=False, memory=False, shared_effectiveness=False, set_membership=False),
}  # fmt: skip
_AS_SAID = {
    "fault_class": "published", "pairs": "false", "sensor_monitor": "auto", "probing": "null",
    "statistical": "null", "authority": "either", "thresholds": "published", "sharpen": "none",
}  # fmt: skip
