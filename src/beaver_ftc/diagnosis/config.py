"""What a scenario may say about the diagnosis (`fdi:`), with defaults and their reasons."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Bound = Annotated[float, Field(ge=0, le=100)]


class PerAxis(BaseModel):
    """One non-negative number for each of p, q and r."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    p: Bound = 0.0
    q: Bound = 0.0
    r: Bound = 0.0

    def as_tuple(self) -> tuple[float, float, float]:
        """(p, q, r)"""
        return self.p, self.q, self.r


class Bounds(BaseModel):
    """What uncertainty the diagnosis admits; thresholds follow from it [Zhang2005, sec. VII]."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    inertia_coupling: PerAxis = Field(
        PerAxis(p=0.25, q=0.25, r=0.25), description="relative error of Pqr, Qpr, Rpq: as published"
    )
    constant_rad_s2: PerAxis = Field(
        PerAxis(p=0.02, q=0.02, r=0.02), description="unstructured angular acceleration, rad/s2: as published"
    )


class FdiConfig(BaseModel):
    """Gains, bounds and the choice of scheme. All have defaults."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    scheme: str = Field("adaptive-estimators", description="a registered detector, or `none`")
    thresholds: Literal["interval", "published"] = Field(
        "interval", description="isolation test: signed interval or the paper's norm bound"
    )
    detection_pole_per_s: float = Field(
        10.0, gt=0, le=1000, description="Lambda0, 1/s: a fault a few times the bound shows within 0.1 s"
    )
    isolation_pole_per_s: float = Field(10.0, gt=0, le=1000, description="Lambda of the isolation estimators, 1/s")
    forgetting_time_s: float = Field(
        5.0, gt=0, le=3600, description="memory of the effectiveness estimates, s: longer than a reference period"
    )
    bounds: Bounds = Bounds()
