"""What a scenario may say about the control law (`control:`), with defaults and their reasons."""

from functools import partial
from typing import Annotated, Self

from pydantic import model_validator

from beaver_ftc.documents.document import Section, deny, entry, number, refuse
from beaver_ftc.plugins import LAWS, refusal, wrong_options
from beaver_ftc.scenario.airframe import named

MODES = ("nominal", "adaptive", "reallocated", "unanticipated")  # of the supervisor, as the log numbers them

Law = Annotated[str, named(partial(refusal, LAWS))]


class EnginePower(Section, strict=True):
    """Engine power on pitch, once neither elevator nor flap acts on it; with the fault-tolerant law and
    fault_class: all, and with the oracle. docs/explanation/fault-types.md has the design.

    enabled: false: the engine stays as trimmed, whatever is lost
    speed_gain_inhg_per_mps: less power for more airspeed than usual, inHg per m/s: damps the phugoid
    attitude_gain_inhg_per_deg: more power for a nose too high, inHg per deg: power lowers it
    washout_s: usual airspeed: the mean over about so long, a phugoid's period, s
    attitude_memory_s: how long a missed pitch rate is remembered, s
    smoothing_s: lag on the airspeed, against noise and gusts, s
    lowest_inhg: manifold pressure with the throttle closed, inHg
    highest_inhg: highest manifold pressure, inHg: the R-985's take-off rating
    rate_inhg_s: fastest change, inHg/s: the whole range in five seconds
    patience_s: how long pitch must have been lost before power takes over, s
    release_s: and how long not, before the engine goes back to its trim, s
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
    """The law and its gains. All have defaults; the paper prints none of them.

    law: a registered law, `beaver-ftc list laws` names them, e.g. nominal, adaptive, oracle
    options: parameters of a registered law, by name
    gain_margin_db: of every loop of the default law, up and down, dB
    phase_margin_deg: of every loop of the default law, deg
    noise_share: of a surface's rate limit, that gyro noise may cost with the default law, as a standard
    deviation: it stays within the limit 95 % of the time
    proportional_per_s: Kp, 1/s: error bandwidth, well above the 0.2 Hz references
    integral_per_s2: Ki, 1/s2: Kp^2/4, two equal real error poles at Kp/2
    reference_natural_frequency_rad_s: reference model, rad/s: faster than the loop, slower than a 20 Hz
    frame
    reference_damping: reference model damping ratio: no overshoot
    network_gain_per_s2: learning gain, 1/s2: with the FDAE's pole a well damped observer
    network_leak_per_s: how fast the network lets go once the isolated fault explains the error, 1/s
    network_weight_limit_rad_s2: projection bound on every weight, rad/s2
    effectiveness_rate_per_s: fastest change of the effectiveness the law uses, 1/s: bumpless
    least_effectiveness: projection: a surface weaker than this is not divided by, but given up
    hand_over_s: duration of the continuous hand-over to the flap, s
    power: engine power on pitch, when elevator and flap are lost
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
