"""What can break, and when: one class a fault type, a union on `type`."""

from typing import Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from beaver_ftc.documents.base import Conflict, Number, Section, number, order_conflicts, refuse
from beaver_ftc.scenario.names import UNANTICIPATED, Actuator
from beaver_ftc.scenario.sensor_faults import AnySensorFault, SensorFault

MOST_FAULTS = 1000  # of one flight: an hour of breaking and repairing by hand has room


class _Fault(Section):
    """When a fault is there; `end_s` makes it intermittent or repaired."""

    at_s: Number = number(unit="s", says="when the fault starts", ge=0, le=360_000)
    end_s: Number | None = number(None, unit="s", says="when it is gone; left out: it stays", gt=0)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        refuse(self._conflicts())
        return self

    def _conflicts(self) -> list[Conflict]:
        return order_conflicts(self.at_s, self.end_s, "at_s")


class _Switched(_Fault):
    """A fault that is either there or not: a jam does not grow."""

    profile: Literal["abrupt"] = Field(default="abrupt", description="this type of fault is always abrupt")


class _Gradual(_Fault):
    """A fault with a time profile B(t - at_s): a step, or 1 - exp(-kappa (t - at_s)) [Zhang2005]."""

    profile: Literal["abrupt", "incipient"] = Field(
        default="abrupt", description="a step, or growing as 1 - exp(-kappa t)"
    )
    kappa_per_s: Number | None = number(
        None, unit="1/s", says="growth rate of an incipient fault", gt=0, le=1000
    )

    def _conflicts(self) -> list[Conflict]:
        incipient, given = self.profile == "incipient", self.kappa_per_s is not None
        if incipient and not given:
            says = "required key is missing, allowed: the growth rate of the incipient fault, 1/s"
        else:
            says = "has no meaning here, allowed: only with profile: incipient"
        return super()._conflicts() + ([] if incipient == given else [(("kappa_per_s",), says)])


class LossOfEffectiveness(_Gradual):
    """The surface gives only a part of its moment: 1 + theta, theta = -magnitude."""

    type: Literal["loss_of_effectiveness"]
    actuator: Actuator = Field(description="the surface that fails")
    magnitude: Number = number(
        unit="share of 1", says="effectiveness lost: 0 healthy, 1 no moment at all", ge=0, le=1
    )


class Stuck(_Switched):
    """The surface jams."""

    type: Literal["stuck"]
    actuator: Actuator = Field(description="the surface that fails")
    position_deg: Number | None = number(
        None, unit="deg", says="where it jams; left out: where it happens to be", ge=-90, le=90
    )


class Hardover(_Switched):
    """The surface runs at its rate limit to a stop."""

    type: Literal["hardover"]
    actuator: Actuator = Field(description="the surface that fails")
    direction: Literal[1, -1] = Field(
        default=1, description="the stop it runs to: 1 positive, -1 negative deflection"
    )


class Float(_Switched):
    """The surface trails in the wind and gives no moment."""

    type: Literal["float"]
    actuator: Actuator = Field(description="the surface that fails")


class Bias(_Gradual):
    """The surface stands off its command by a constant."""

    type: Literal["bias"]
    actuator: Actuator = Field(description="the surface that fails")
    bias_deg: Number = number(unit="deg", says="added to the actuator's output", ge=-90, le=90)


class RateLimit(_Gradual):
    """The surface moves slowly."""

    type: Literal["rate_limit"]
    actuator: Actuator = Field(description="the surface that fails")
    scale: Number = number(unit="share of 1", says="what is left of the rate limit", ge=0, le=1)


class Oscillatory(_Gradual):
    """The surface swings about its command by itself."""

    type: Literal["oscillatory"]
    actuator: Actuator = Field(description="the surface that fails")
    amplitude_deg: Number = number(unit="deg", says="half of the swing", gt=0, le=90)
    frequency_rad_s: Number = number(unit="rad/s", says="angular frequency of the swing", gt=0, le=1000)


class Unanticipated(_Gradual):
    """A fault outside the declared class: an extra pitching moment coefficient on alpha^3 [Zhang2005]."""

    type: Literal["unanticipated"]
    Cm_alpha3: Number = number(
        10.0, unit="1/rad^3", says="extra Cm on alpha^3, published case 10", ge=-1000, le=1000
    )


SurfaceFault = Annotated[
    LossOfEffectiveness | Stuck | Hardover | Float | Bias | RateLimit | Oscillatory | Unanticipated,
    Field(discriminator="type"),
]


def place_of(fault: Any) -> str:
    """What a fault is of: a surface, a sensor, or the aerodynamics (`unanticipated`)."""
    return str(getattr(fault, "sensor", getattr(fault, "actuator", UNANTICIPATED)))


def of_a_sensor(fault: Any) -> bool:
    """Whether a fault, or what a file says of one, is an instrument's."""
    return "sensor" in fault if isinstance(fault, dict) else isinstance(fault, SensorFault)


def _tag(given: Any) -> str:
    return "(sensor)" if of_a_sensor(given) else "(surface)"  # no keys of the file


Fault = Annotated[
    Annotated[SurfaceFault, Tag("(surface)")] | Annotated[AnySensorFault, Tag("(sensor)")],
    Discriminator(_tag),
]
