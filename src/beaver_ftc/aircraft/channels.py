"""Which output of an autopilot moves which surface: the section `channels` of an aircraft's file.

An output is a pulse of `pwm_us`, or what an autopilot that knows no pulses says of it, -1 to 1. Its share of
full travel is

    x = (pulse - trim) / (upper end - trim) above the trim, (pulse - trim) / (trim - lower end) below it

and a surface goes the sum of its outputs' `share` x towards its upper stop, or its lower one: several outputs
on one surface are a mix (elevons, a V-tail, flaperons).
"""

from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from beaver_ftc.documents.base import Flag, Number, Section, Whole, number, refuse

MOST_CHANNELS = 32  # of the longest packet there is
PWM_US = (1000.0, 2000.0)

_Pulse = Annotated[Number, Field(ge=500, le=2500)]


def _in_order(given: tuple[float, float]) -> tuple[float, float]:
    if not given[0] < given[1]:
        refuse([((), "ends out of order, allowed: [lower, upper]")])
    return given


def _not_nothing(share: float) -> float:
    if share == 0.0:
        refuse([((), "0 moves nothing, allowed: -1 to 1 without 0")])
    return share


class OutputSection(Section):
    """One output of an autopilot, as one surface or the engine takes it.

    channel: number of the output, 1 the first
    share: how much of the way to the stop full output is; below 0 towards the other one
    reversed: whether a longer pulse is less
    pwm_us: shortest and longest pulse, us
    trim_us: pulse that leaves a surface at 0 and closes a throttle, us; by itself the middle, of a throttle
        the lower end
    """

    channel: Whole = Field(ge=1, le=MOST_CHANNELS, examples=[1])
    share: Annotated[Number, Field(ge=-1, le=1), AfterValidator(_not_nothing)] = number(
        1.0, "share of 1", examples=[-1]
    )
    reversed: Flag = False
    pwm_us: Annotated[tuple[_Pulse, _Pulse], AfterValidator(_in_order)] = number(
        PWM_US, "us", examples=[[1100, 1900]]
    )
    trim_us: _Pulse | None = number(None, "us", examples=[1500])

    @model_validator(mode="after")
    def _trim_is_in_range(self) -> Self:
        low, high = self.pwm_us
        if self.trim_us is not None and not low <= self.trim_us <= high:
            refuse([(("trim_us",), f"is out of range, allowed: {low:g} to {high:g}, as pwm_us says")])
        return self


class ChannelsSection(Section):
    """Outputs of an autopilot, by what they move; a surface that is not here keeps its trim.

    surfaces: the outputs of each surface
    throttle: the output of the engine
    """

    surfaces: dict[str, Annotated[tuple[OutputSection, ...], Field(min_length=1, max_length=8)]]
    throttle: OutputSection | None = None
