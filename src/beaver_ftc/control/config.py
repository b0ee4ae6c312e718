"""What a scenario may say about the control law (`control:`), with defaults and their reasons."""

from pydantic import BaseModel, ConfigDict, Field


class ControlConfig(BaseModel):
    """The law and its gains. All have defaults."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    law: str = Field("fault-tolerant", description="nominal | adaptive | fault-tolerant | oracle, or a registered law")
