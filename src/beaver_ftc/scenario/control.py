"""What a scenario may say about the control law (`control:`), with defaults and their reasons."""

from typing import Annotated, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from beaver_ftc.documents.base import refuse
from beaver_ftc.plugins import LAWS, refusal


def known_law(name: str) -> str:
    """A law there is, or a refusal."""
    wrong = refusal(LAWS, name)
    refuse([((), wrong)] if wrong else [])
    return name


class EnginePower(BaseModel):
    """Engine power on pitch, once neither elevator nor flap acts on it; with the fault-tolerant law and
    fault_class: all, and with the oracle. docs/fault-types.md has the design."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)

    enabled: bool = Field(True, description="false: the engine stays as trimmed, whatever is lost")
    speed_gain_inhg_per_mps: float = Field(
        3.0,
        ge=0,
        le=50,
        description="less power for more airspeed than usual, inHg per m/s: damps the phugoid",
    )
    attitude_gain_inhg_per_deg: float = Field(
        0.9, ge=0, le=50, description="more power for a nose too high, inHg per deg: power lowers it"
    )
    washout_s: float = Field(
        20.0, gt=0, le=600, description="usual airspeed: the mean over about so long, a phugoid's period, s"
    )
    attitude_memory_s: float = Field(
        10.0, gt=0, le=600, description="how long a missed pitch rate is remembered, s"
    )
    smoothing_s: float = Field(
        0.5, ge=0.05, le=10, description="lag on the airspeed, against noise and gusts, s"
    )
    lowest_inhg: float = Field(
        10.0, ge=0, le=50, description="manifold pressure with the throttle closed, inHg"
    )
    highest_inhg: float = Field(
        36.5, ge=0, le=50, description="highest manifold pressure, inHg: the R-985's take-off rating"
    )
    rate_inhg_s: float = Field(
        5.0, gt=0, le=100, description="fastest change, inHg/s: the whole range in five seconds"
    )
    patience_s: float = Field(
        1.0, gt=0, le=60, description="how long pitch must have been lost before power takes over, s"
    )
    release_s: float = Field(
        10.0, gt=0, le=600, description="and how long not, before the engine goes back to its trim, s"
    )

    @model_validator(mode="after")
    def _a_range(self) -> Self:
        says = f"below lowest_inhg, allowed: {self.lowest_inhg:g} inHg or more"
        refuse([(("highest_inhg",), says)] if self.highest_inhg < self.lowest_inhg else [])
        return self


class ControlConfig(BaseModel):
    """The law and its gains. All have defaults; the paper prints none of them."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)

    law: Annotated[str, AfterValidator(known_law)] = Field(
        "fault-tolerant",
        description="a registered law, `beaver-ftc list laws` names them, e.g. nominal, adaptive, oracle",
    )
    options: dict[str, float] = Field({}, description="parameters of a registered law, by name")
    gain_margin_db: float = Field(
        6.0, gt=0, le=40, description="of every loop of the default law, up and down, dB"
    )
    phase_margin_deg: float = Field(45.0, gt=0, le=80, description="of every loop of the default law, deg")
    noise_share: float = Field(
        0.5,
        gt=0,
        le=1,
        description="of a surface's rate limit, that gyro noise may cost with the default law, as a standard "
        "deviation: it stays within the limit 95 % of the time",
    )
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
    power: EnginePower = Field(
        default_factory=EnginePower, description="engine power on pitch, when elevator and flap are lost"
    )
