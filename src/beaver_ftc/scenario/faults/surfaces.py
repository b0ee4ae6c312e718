"""The faults that there are, of surfaces and of the aerodynamics: a row each (base.py)."""

from math import degrees, radians
from typing import Literal

from beaver_ftc.documents.document import Conflict, Number, entry, number
from beaver_ftc.scenario.airframe import Actuator, checked_aircraft
from beaver_ftc.scenario.faults.base import (
    Button,
    Gradual,
    Hidden,
    Past,
    Properties,
    Switched,
    constant,
    growing,
)

_ROUNDED = 1e-4  # of a stop in degrees as people write it


class LossOfEffectiveness(Gradual):
    """The surface gives only a part of its moment: 1 + theta, theta = -magnitude.

    actuator: the surface that fails
    magnitude: effectiveness lost: 0 healthy, 1 no moment at all, share of 1
    """

    properties = (("effectiveness", 1.0),)
    truth, size = ("magnitude", -1.0), ("of", "%")
    in_words = growing(magnitude=lambda value: f"{100 * value:g} %")
    examples = (("40 % loss", {"magnitude": 0.4}), ("total loss", {"magnitude": 1.0}))
    button = Button(1, "lose 40 %", {"magnitude": 0.4})
    hidden = (Hidden(3, {"magnitude": 0.4}), Hidden(4, {"magnitude": 0.7}))

    type: Literal["loss_of_effectiveness"]
    actuator: Actuator
    magnitude: Number = number(..., "share of 1", ge=0, le=1, examples=[0.4])

    @classmethod
    def size_in_words(cls, estimate: float) -> str:
        return f"{-100.0 * estimate:.3g} %"

    @classmethod
    def estimate_in_words(cls, estimate: float) -> str:
        return f"loss {cls.size_in_words(estimate)}"

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["effectiveness"] *= 1.0 - share * self.magnitude


class Stuck(Switched):
    """The surface jams.

    actuator: the surface that fails
    position_deg: where it jams, between its stops; left out: where it happens to be, deg
    """

    properties, holds = (("stuck", 0.0), ("stuck-at-rad", 0.0)), "stuck"
    adds, stays_where_it_is, truth, size = False, True, ("position_deg", 1.0), ("at", "deg")
    in_words = constant(position_deg="{:g} deg".format)
    examples = (("stuck +3 deg", {"off_deg": 3.0}), ("stuck -3 deg", {"off_deg": -3.0}))
    button, hidden, mavlink = Button(2, "jam", {}), (Hidden(2, {}),), (2, {})

    type: Literal["stuck"]
    actuator: Actuator
    position_deg: Number | None = number(None, "deg", ge=-90, le=90, examples=[3])

    def _conflicts(self) -> list[Conflict]:
        travel = checked_aircraft().travel[self.actuator]
        least, most = degrees(travel.min_rad), degrees(travel.max_rad)
        found = super()._conflicts()
        if self.position_deg is not None and not least - _ROUNDED <= self.position_deg <= most + _ROUNDED:
            allowed = f"allowed: {least:.6g} to {most:.6g} deg"
            says = f"{self.position_deg:g} is beyond the stops of {self.actuator}, {allowed}"
            found.append((("position_deg",), says))
        return found

    def strike(self, of: Properties, share: float, past: Past) -> None:
        if of["stuck"] == 0.0:
            of["stuck"] = 1.0
            of["stuck-at-rad"] = past.at_rad if self.position_deg is None else radians(self.position_deg)


class Hardover(Switched):
    """The surface runs at its rate limit to a stop."""

    properties, holds = (("hardover", 0.0),), "hardover"
    adds, size = False, ("at", "deg")
    in_words = constant(direction=lambda value: f"to the {'upper' if value > 0 else 'lower'} stop")
    examples = (("hardover +", {"direction": 1}), ("hardover -", {"direction": -1}))
    button, hidden = Button(4, "hardover", {"direction": 1}), (Hidden(1, {"direction": 1}, True),)
    mavlink = 4, {"direction": 1}

    type: Literal["hardover"]
    actuator: Actuator = entry(..., "the surface that fails")
    direction: Literal[1, -1] = entry(1, "the stop it runs to: 1 positive, -1 negative deflection")

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["hardover"] = float(self.direction)


class Float(Switched):
    """The surface trails in the wind and gives no moment."""

    properties, holds, adds = (("float", 0.0),), "float", False
    examples = (("float", {}),)
    button, mavlink = Button(3, "float", {}), (1, {})

    type: Literal["float"]
    actuator: Actuator = entry(..., "the surface that fails")

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["float"] = 1.0


class Bias(Gradual):
    """The surface stands off its command by a constant."""

    properties = (("bias-rad", 0.0),)
    truth, size = ("bias_deg", 1.0), ("of", "deg")
    in_words = growing(bias_deg="{:+g} deg".format)
    examples = (("bias +2 deg", {"bias_deg": 2.0}), ("bias -2 deg", {"bias_deg": -2.0}))
    button = Button(6, "bias", {"bias_deg": 3})

    type: Literal["bias"]
    actuator: Actuator = entry(..., "the surface that fails")
    bias_deg: Number = number(..., "deg", "added to the actuator's output", ge=-90, le=90, examples=[2])

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["bias-rad"] += share * radians(self.bias_deg)


class RateLimit(Gradual):
    """The surface moves slowly."""

    properties = (("rate-scale", 1.0),)
    in_words = growing(scale=lambda value: f"{100 * value:g} % of its rate")
    examples = (("rate limit 1.2 deg/s", {"scale": 0.02}),)
    button, mavlink = Button(7, "rate limit", {"scale": 0.05}), (5, {"scale": 0.1})

    type: Literal["rate_limit"]
    actuator: Actuator = entry(..., "the surface that fails")
    scale: Number = number(..., "share of 1", "what is left of the rate limit", ge=0, le=1, examples=[0.05])

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["rate-scale"] *= 1.0 - share * (1.0 - self.scale)


class Oscillatory(Gradual):
    """The surface swings about its command by itself."""

    properties = (("oscillation-amplitude-rad", 0.0), ("oscillation-frequency-rad_sec", 0.0))
    truth, size = ("amplitude_deg", 1.0), ("by", "deg")
    in_words = growing(amplitude_deg="{:g} deg".format, frequency_rad_s="{:g} rad/s".format)
    examples = (
        ("oscillation 0.5 deg, 1 rad/s", {"amplitude_deg": 0.5, "frequency_rad_s": 1.0}),
        ("oscillation 0.5 deg, 10 rad/s", {"amplitude_deg": 0.5, "frequency_rad_s": 10.0}),
        ("oscillation 2 deg, 5 rad/s", {"amplitude_deg": 2.0, "frequency_rad_s": 5.0}),
    )
    button = Button(5, "oscillate", {"amplitude_deg": 3, "frequency_rad_s": 6})
    mavlink = 3, {"amplitude_deg": 3.0, "frequency_rad_s": 10.0}

    type: Literal["oscillatory"]
    actuator: Actuator = entry(..., "the surface that fails")
    amplitude_deg: Number = number(..., "deg", "half of the swing", gt=0, le=90, examples=[2])
    frequency_rad_s: Number = number(
        ..., "rad/s", "angular frequency of the swing", gt=0, le=1000, examples=[5]
    )

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["oscillation-amplitude-rad"] = share * radians(self.amplitude_deg)
        of["oscillation-frequency-rad_sec"] = self.frequency_rad_s


class Unanticipated(Gradual):
    """A fault outside the declared class: an extra pitching moment coefficient on alpha^3 [Zhang2005]."""

    properties = (("Cm-alpha3", 0.0),)
    in_words = growing(Cm_alpha3="Cm_alpha3 {:g}".format)

    type: Literal["unanticipated"]
    Cm_alpha3: Number = number(10.0, "1/rad^3", "extra Cm on alpha^3, published case 10", ge=-1000, le=1000)

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["Cm-alpha3"] += share * self.Cm_alpha3
