"""What a scenario may say about the diagnosis (`fdi:`), with defaults and their reasons."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Strict, model_validator

from beaver_ftc.diagnosis.state import DEADBEAT_PER_S, MAX_POLES

Bound = Annotated[float, Field(ge=0, le=100)]
Pole = Annotated[float, Field(gt=0, le=DEADBEAT_PER_S)]


class PerAxis(BaseModel):
    """One non-negative number for each of p, q and r."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)

    p: Bound = 0.0
    q: Bound = 0.0
    r: Bound = 0.0

    def as_tuple(self) -> tuple[float, float, float]:
        """(p, q, r)"""
        return self.p, self.q, self.r


def _known_scheme(name: str) -> str:
    from beaver_ftc.plugins import DETECTORS, refusal
    from beaver_ftc.scenario.base import refuse

    wrong = refusal(DETECTORS, name)
    refuse([((), wrong)] if wrong else [])
    return name


class Bounds(BaseModel):
    """What uncertainty the diagnosis admits; thresholds follow from it [Zhang2005, sec. VII]."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)

    inertia_coupling: PerAxis = Field(
        PerAxis(p=0.25, q=0.25, r=0.25), description="relative error of Pqr, Qpr, Rpq: as published"
    )
    constant_rad_s2: PerAxis = Field(
        PerAxis(p=0.02, q=0.02, r=0.02), description="unstructured angular acceleration, rad/s2: as published"
    )


class Probing(BaseModel):
    """A small movement of the flap, met by the elevator, to learn which of the two is at fault.

    If both follow, nothing is felt. It begins when the pitch axis is at fault and neither is named once a slow
    oscillation would have shown, and ends when one is.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    amplitude_deg: float = Field(3.0, gt=0, le=10, description="greatest flap deflection, downwards, deg")
    frequency_hz: float = Field(0.5, gt=0, le=5, description="movements a second, Hz")
    duration_s: float = Field(4.0, gt=0, le=60, description="at most so long, s")


class Sharpen(BaseModel):
    """Margin the published scheme gives away; each step loses no guarantee (docs/theory.md, section 3)."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    pole_bank: bool = Field(True, description="alarm on the first of several filters: `fdi.pole_bank_per_s`")
    memory: bool = Field(
        True, description="hold each fault against the whole flight, not only what follows the alarm"
    )
    shared_effectiveness: bool = Field(
        True, description="one parameter per surface, shared by the axes it moves"
    )
    set_membership: bool = Field(True, description="intersect the sets of a parameter declared constant")

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


class FdiConfig(BaseModel):
    """Gains, bounds and the choice of scheme. All have defaults."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)

    scheme: Annotated[str, AfterValidator(_known_scheme)] = Field(
        "adaptive-estimators",
        description="a registered detector (`beaver-ftc list`), module:Class of an installed package, none",
    )
    options: dict[str, float] = Field({}, description="parameters of a registered detector, by name")
    fault_class: Literal["published", "all"] = Field(
        "published",
        description="what may befall a surface: loss of effectiveness of aileron, elevator or rudder, "
        "or every fault type on all four",
    )
    slowest_oscillation_rad_s: float = Field(
        1.0, gt=0, le=100, description="oscillatory failures are this fast or faster (class `all`), rad/s"
    )
    probing: Probing | None = Field(
        None, description="active diagnosis (class `all`): off unless given; `{}` for its defaults"
    )
    thresholds: Literal["interval", "published"] = Field(
        "interval", description="isolation test: signed interval or the paper's norm bound"
    )
    detection_pole_per_s: float = Field(
        10.0, gt=0, le=1000, description="Lambda0, 1/s: a few times the bound shows in 0.1 s"
    )
    isolation_pole_per_s: float = Field(
        10.0, gt=0, le=1000, description="Lambda of the isolation estimators, 1/s"
    )
    forgetting_time_s: float = Field(
        5.0, gt=0, le=3600, description="memory of the estimates, s: longer than a reference period"
    )
    bounds: Bounds = Bounds()
    sharpen: Sharpen = Field(
        Sharpen(), description="steps beyond the published scheme: `all`, `none` or one by one"
    )
    pole_bank_per_s: Annotated[tuple[Pole, ...], Strict(False)] = Field(
        (DEADBEAT_PER_S,),
        max_length=MAX_POLES - 1,
        description="filters beside the published one, 1/s; the default keeps a single frame",
    )
    fault_profile: Literal["any", "abrupt"] = Field(
        "any", description="what is assumed of the fault's course: nothing, or constant once it is there"
    )

    @model_validator(mode="before")
    @classmethod
    def _published_means_published(cls, given: Any) -> Any:
        if isinstance(given, dict) and given.get("thresholds") == "published":
            return {"sharpen": "none", **given}
        return given
