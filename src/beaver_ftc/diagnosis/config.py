"""What a scenario may say about the diagnosis (`fdi:`), with defaults and their reasons."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field


class FdiConfig(BaseModel):
    """Gains, bounds and the choice of scheme. All have defaults."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    scheme: str = Field("adaptive-estimators", description="a registered detector, or `none`")
    thresholds: Literal["interval", "published"] = Field(
        "interval", description="isolation test: signed interval (SPEC 5) or the paper's norm bound"
    )
