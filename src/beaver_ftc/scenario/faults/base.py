"""The faults of an aircraft: a class a type, which is its row in every table.

It says its parameters with unit and range, what it does to the aircraft's failure properties, and how it
is shown to people. First stands what all types have, then damage (a part of the aircraft is gone, with its
forces, its mass and the surfaces on it), then the faults of surfaces and of the aerodynamics. What the
diagnosis makes of a type stands in diagnosis/types/table/.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import degrees, radians
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, Self

from pydantic import model_validator

from beaver_ftc.documents.document import Conflict, Number, Section, entry, number, order_conflicts, refuse
from beaver_ftc.documents.errors import suggestion
from beaver_ftc.scenario.airframe import Actuator, checked_aircraft, named

Keys = Mapping[str, Any]  # of a fault in a scenario, beside type, actuator and times
Properties = dict[str, float]  # failure properties of one surface
InWords = Mapping[str, Callable[[Any], str]]  # of each parameter, its value in words


class Button(NamedTuple):
    """Of the live page: its place among the others, what it says, and the fault it makes."""

    place: int
    says: str
    keys: Keys


class Hidden(NamedTuple):
    """Of the live page's game: a fault to be found by its effect. Its place among the others, its keys, and
    whether it also shows on a surface that rests while all is well."""

    place: int
    keys: Keys
    on_any_surface: bool = False


@dataclass
class Past:
    """The memory of one fault in one flight. at_rad: where the actuator was when the fault struck. kept: what
    a row that follows its actuator keeps."""

    at_rad: float = 0.0
    kept: dict[str, float] = field(default_factory=dict)


class SurfaceFault(Section):
    """When a fault is there; `end_s` makes it intermittent or repaired."""

    # The row of its type; what is left out does not apply.
    properties: ClassVar[tuple[tuple[str, float], ...]] = ()  # those it changes, with their healthy values
    holds: ClassVar[str] = ""  # the property that, other than 0, keeps a surface from following its command
    adds: ClassVar[bool] = True  # whether a second one of the like changes anything
    stays_where_it_is: ClassVar[bool] = False  # whether it must be known where the actuator was
    follows_actuator: ClassVar[bool] = False  # whether `follow` is called in every frame
    truth: ClassVar[tuple[str, float] | None] = None  # the key that an estimate is of, and the sign of that
    size: ClassVar[tuple[str, str] | None] = None  # an estimate in words: "of" so many "%", or "deg"
    in_words: ClassVar[InWords] = {}  # its parameters
    examples: ClassVar[tuple[tuple[str, Keys], ...]] = ()  # of `matrix`: name, fault; off_deg: off the trim
    button: ClassVar[Button | None] = None
    hidden: ClassVar[tuple[Hidden, ...]] = ()
    mavlink: ClassVar[tuple[int, Keys] | None] = None  # the FAILURE_TYPE that asks for it, and its keys

    if TYPE_CHECKING:
        type: str
        profile: str

    at_s: Number = number(..., "s", "when the fault starts", ge=0, le=360_000, examples=[12])
    end_s: Number | None = number(None, "s", "when it is gone; left out: it stays", gt=0, examples=[20])

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        refuse(self._conflicts())
        return self

    def _conflicts(self) -> list[Conflict]:
        return order_conflicts(self.at_s, self.end_s, "at_s")

    @classmethod
    def size_in_words(cls, estimate: float) -> str:
        """The size that an estimate which is no angle amounts to, with its unit."""
        return f"{estimate:.3g}"

    @classmethod
    def estimate_in_words(cls, estimate: float) -> str:
        """Quantity and size of an estimate that is no angle."""
        return cls.size_in_words(estimate)

    def strike(self, of: Properties, share: float, past: Past) -> None:
        """Change the failure properties of its place, given how far it has grown (0 to 1) and its memory."""
        raise NotImplementedError

    def follow(self, past: Past, actuator_rad: float) -> None:
        """Take in where the actuator is as a frame begins in which the fault is in force."""


class Switched(SurfaceFault):
    """A fault that is either there or not: a jam does not grow."""

    profile: Literal["abrupt"] = entry("abrupt", "this type of fault is always abrupt", examples=["abrupt"])


class Gradual(SurfaceFault):
    """A fault with a time profile B(t - at_s): a step, or 1 - exp(-kappa (t - at_s)) [Zhang2005]."""

    profile: Literal["abrupt", "incipient"] = entry(
        "abrupt", "a step, or growing as 1 - exp(-kappa t)", needs={"kappa_per_s": 2}, examples=["incipient"]
    )
    kappa_per_s: Number | None = number(
        None,
        "1/s",
        "growth rate of an incipient fault",
        gt=0,
        le=1000,
        needs={"profile": "incipient"},
        examples=[2],
    )

    def _conflicts(self) -> list[Conflict]:
        incipient, given = self.profile == "incipient", self.kappa_per_s is not None
        if incipient and not given:
            says = "required key is missing, allowed: the growth rate of the incipient fault, 1/s"
        else:
            says = "has no meaning here, allowed: only with profile: incipient"
        return super()._conflicts() + ([] if incipient == given else [(("kappa_per_s",), says)])


def constant(**in_words: Callable[[Any], str]) -> InWords:
    """Parameters of a fault in words."""
    return in_words


def growing(**in_words: Callable[[Any], str]) -> InWords:
    """Parameters of a fault in words, and its growth rate."""
    return {**in_words, "kappa_per_s": "growing at {:g} /s".format}


_ROUNDED = 1e-4  # of a stop in degrees as people write it


def _wrong(case: str) -> str | None:
    """What is wrong with the name of a case."""
    aircraft = checked_aircraft()
    if not aircraft.damage:
        return f"{aircraft.name} declares no damage, allowed: an aircraft that does"
    if case in aircraft.damage:
        return None
    return f"{case[:100]!r} is not known{suggestion(case, tuple(aircraft.damage))}"


class Damage(Switched):
    """A case of damage that the aircraft declares: it acts on aerodynamics and mass, and takes surfaces.

    case: which, by its name in the aircraft's file
    """

    adds = False
    in_words = constant(case=lambda case: case.replace("-", " "))

    type: Literal["damage"]
    case: Annotated[str, named(_wrong)] = entry(..., examples=["left-wing-tip-off"])

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of[self.case] = 1.0


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
