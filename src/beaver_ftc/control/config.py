"""What a scenario may say about the control law (`control:`), with defaults and their reasons."""

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field


def _known_law(name: str) -> str:
    from beaver_ftc.plugins import LAWS, refusal
    from beaver_ftc.scenario.base import refuse

    wrong = refusal(LAWS, name)
    refuse([((), wrong)] if wrong else [])
    return name


class ControlConfig(BaseModel):
    """The law and its gains. All have defaults; the paper prints none of them."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)

    law: Annotated[str, AfterValidator(_known_law)] = Field(
        "fault-tolerant",
        description="nominal | adaptive | fault-tolerant | oracle, a registered law (see `beaver-ftc list`), "
        "or module:Class of an installed package",
    )
    options: dict[str, float] = Field({}, description="parameters of a registered law, by name")
    proportional_per_s: float = Field(
        2.0, gt=0, le=50, description="Kp, 1/s: error bandwidth, well above the 0.2 Hz references"
    )
    integral_per_s2: float = Field(
        1.0, ge=0, le=500, description="Ki, 1/s2: Kp^2/4, two equal real error poles at Kp/2"
    )
    reference_natural_frequency_rad_s: float = Field(
        10.0,
        gt=0,
        le=100,
        description="reference model, rad/s: faster than the loop, slower than a 20 Hz frame",
    )
    reference_damping: float = Field(
        1.0, ge=0.2, le=5, description="reference model damping ratio: no overshoot"
    )
    network_gain_per_s2: float = Field(
        60.0, ge=0, le=1000, description="learning gain, 1/s2: with the FDAE's pole a well damped observer"
    )
    network_leak_per_s: float = Field(
        1.0,
        ge=0,
        le=50,
        description="how fast the network lets go once the isolated fault explains the error, 1/s",
    )
    network_weight_limit_rad_s2: float = Field(
        20.0, gt=0, le=1000, description="projection bound on every weight, rad/s2"
    )
    effectiveness_rate_per_s: float = Field(
        4.0, gt=0, le=1000, description="fastest change of the effectiveness the law uses, 1/s: bumpless"
    )
    least_effectiveness: float = Field(
        0.1, gt=0, lt=1, description="projection: a surface weaker than this is not divided by, but given up"
    )
    hand_over_s: float = Field(
        1.0, gt=0, le=60, description="duration of the continuous hand-over to the flap, s"
    )
