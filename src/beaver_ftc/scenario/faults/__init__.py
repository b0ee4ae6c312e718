"""What can break, and when: a class a fault type, which is its row in every table, and their union on `type`.

A row says its parameters with unit and range, what it does to the aircraft's failure properties, and how it
is shown to people. First stands what all types have, then damage (a part of the aircraft is gone, with its
forces, its mass and the surfaces on it), then the faults of surfaces and of the aerodynamics. Every file of
this folder is read too: a fault type that can be injected is one class more. What the diagnosis makes of a
type stands in diagnosis/types/table/.
"""

import pkgutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from importlib import import_module
from math import degrees, radians
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, Self, get_args

from pydantic import Discriminator, Field, Tag, model_validator

from beaver_ftc.documents.document import Conflict, Number, Section, entry, number, order_conflicts, refuse
from beaver_ftc.documents.errors import suggestion
from beaver_ftc.scenario.airframe import Actuator, among, checked_aircraft, named
from beaver_ftc.scenario.instants import grown_share, is_in_force
from beaver_ftc.scenario.sensors import AnySensorFault, SensorFault, fault_name, sensor_words, sensors_there

Keys = Mapping[str, Any]  # of a fault in a scenario, beside type, actuator and times
Properties = dict[str, float]  # failure properties of one surface
InWords = Mapping[str, Callable[[Any], str]]  # of each parameter, its value in words


SURFACE_SAYS = "surface that fails. Of the Beaver: `aileron`, `elevator`, `rudder` or `flap`"


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
    """The memory of one fault in one flight. at_rad: position of the surface when the fault struck, with the
    offsets of all faults. kept: what a row that follows its surface keeps."""

    at_rad: float = 0.0
    kept: dict[str, float] = field(default_factory=dict)


class SurfaceFault(Section):
    """When a fault is there; `end_s` makes it intermittent or repaired."""

    # The row of its type; what is left out does not apply.
    properties: ClassVar[tuple[tuple[str, float], ...]] = ()  # those it changes, with their healthy values
    holds: ClassVar[str] = ""  # the property that, other than 0, keeps a surface from following its command
    adds: ClassVar[bool] = True  # whether a second one of the like changes anything
    stays_where_it_is: ClassVar[bool] = False  # whether it must be known where the surface was
    follows_surface: ClassVar[bool] = False  # whether `follow` is called in every frame
    truth: ClassVar[str] = ""  # the property that an estimate is of, as its difference from the healthy value
    masks: ClassVar[tuple[str, ...]] = ()  # types that do not act on a surface where this one is in force
    replaces_like: ClassVar[bool] = False  # of two of this type the later acts; else the earlier does
    size: ClassVar[tuple[str, str] | None] = None  # an estimate in words: "of" so many "%", or "deg"
    in_words: ClassVar[InWords] = {}  # its parameters
    examples: ClassVar[tuple[tuple[str, Keys], ...]] = ()  # of `matrix`: name, fault; off_deg: off the trim
    button: ClassVar[Button | None] = None
    hidden: ClassVar[tuple[Hidden, ...]] = ()
    mavlink: ClassVar[tuple[int, Keys] | None] = None  # the FAILURE_TYPE that asks for it, and its keys

    if TYPE_CHECKING:
        type: str
        profile: str

    at_s: Number = number(..., "s", "start of the fault", ge=0, le=360_000, examples=[12])
    end_s: Number | None = number(
        None, "s", "end of the fault; left out: the fault stays to the end of the flight", gt=0, examples=[20]
    )

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

    def follow(self, past: Past, position_rad: float) -> None:
        """Take in the position of the surface as a frame begins in which the fault is in force: that of the
        actuator with the offsets of all faults, this fault's own among them."""


class Switched(SurfaceFault):
    """A fault that is either there or not: a jam does not grow."""

    profile: Literal["abrupt"] = entry("abrupt", "time course: always abrupt", examples=["abrupt"])


class Gradual(SurfaceFault):
    """A fault with a time profile B(t - at_s): a step, or 1 - exp(-kappa (t - at_s)) [Zhang2005]."""

    profile: Literal["abrupt", "incipient"] = entry(
        "abrupt",
        "time course. `incipient`: growth as 1 - exp(-kappa (t - at_s))",
        needs={"kappa_per_s": 2},
        examples=["incipient"],
    )
    kappa_per_s: Number | None = number(
        None,
        "1/s",
        "kappa of an incipient fault",
        gt=0,
        le=1000,
        needs={"profile": "incipient"},
        examples=[2],
    )

    def _conflicts(self) -> list[Conflict]:
        incipient = self.profile == "incipient"
        given = self.kappa_per_s is not None
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
    return f"{case!r:.100} is not known{suggestion(case, tuple(aircraft.damage))}"


class Damage(Switched):
    """A case of damage that the aircraft file declares.

    case: name of the case
    """

    adds = False
    in_words = constant(case=lambda case: case.replace("-", " "))

    type: Literal["damage"]
    case: Annotated[str, named(_wrong)] = entry(..., examples=["left-wing-tip-off"])

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of[self.case] = 1.0


class LossOfEffectiveness(Gradual):
    """The surface gives (1 - magnitude) times its healthy moment.

    actuator: surface that fails. Of the Beaver: `aileron`, `elevator`, `rudder` or `flap`
    magnitude: lost share of the effectiveness, share of 1
    """

    properties = (("effectiveness", 1.0),)
    truth = "effectiveness"
    size = ("of", "%")
    in_words = growing(magnitude=lambda value: f"{100 * value:g} %")
    examples = (("40 % loss", {"magnitude": 0.4}), ("total loss", {"magnitude": 1.0}))
    button = Button(1, "lose 40 %", {"magnitude": 0.4})
    hidden = (Hidden(3, {"magnitude": 0.4}), Hidden(4, {"magnitude": 0.7}))

    type: Literal["loss_of_effectiveness"]
    actuator: Actuator
    magnitude: Number = number(..., "share of 1", ge=0, le=1, examples=[0.4])

    @classmethod
    def size_in_words(cls, estimate: float) -> str:
        return f"{round(-100.0 * estimate, 9) + 0.0:.3g} %"  # a sum with 0.0 is never -0

    @classmethod
    def estimate_in_words(cls, estimate: float) -> str:
        return f"loss {cls.size_in_words(estimate)}"

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["effectiveness"] *= 1.0 - share * self.magnitude


class Stuck(Switched):
    """The surface jams.

    actuator: surface that fails. Of the Beaver: `aileron`, `elevator`, `rudder` or `flap`
    position_deg: position of the jam; left out: the position at the start of the fault, deg
    """

    properties = (("stuck", 0.0), ("stuck-at-rad", 0.0))
    holds = "stuck"
    adds = False
    stays_where_it_is = True
    truth = "stuck-at-rad"
    size = ("at", "deg")
    masks = ("stuck", "float", "hardover", "bias", "rate_limit", "oscillatory")
    in_words = constant(position_deg="{:g} deg".format)
    examples = (("stuck +3 deg", {"off_deg": 3.0}), ("stuck -3 deg", {"off_deg": -3.0}))
    button = Button(2, "jam", {})
    hidden = (Hidden(2, {}),)
    mavlink = (2, {})

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
    """The surface runs to a stop at its rate limit."""

    properties = (("hardover", 0.0),)
    holds = "hardover"
    adds = False
    size = ("at", "deg")
    masks = ("hardover",)
    replaces_like = True
    in_words = constant(direction=lambda value: f"to the {'upper' if value > 0 else 'lower'} stop")
    examples = (("hardover +", {"direction": 1}), ("hardover -", {"direction": -1}))
    button = Button(4, "hardover", {"direction": 1})
    hidden = (Hidden(1, {"direction": 1}, True),)
    mavlink = 4, {"direction": 1}

    type: Literal["hardover"]
    actuator: Actuator = entry(..., SURFACE_SAYS)
    direction: Literal[1, -1] = entry(1, "stop to which the surface runs. 1: upper. -1: lower")

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["hardover"] = float(self.direction)


class Float(Switched):
    """The surface floats freely in the airflow and gives no moment."""

    properties = (("float", 0.0),)
    holds = "float"
    adds = False
    masks = ("float", "hardover", "bias", "rate_limit", "oscillatory")
    examples = (("float", {}),)
    button = Button(3, "float", {})
    mavlink = (1, {})

    type: Literal["float"]
    actuator: Actuator = entry(..., SURFACE_SAYS)

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["float"] = 1.0


class Bias(Gradual):
    """A constant is added to the position of the surface."""

    properties = (("bias-rad", 0.0),)
    truth = "bias-rad"
    size = ("of", "deg")
    in_words = growing(bias_deg="{:+g} deg".format)
    examples = (("bias +2 deg", {"bias_deg": 2.0}), ("bias -2 deg", {"bias_deg": -2.0}))
    button = Button(6, "bias", {"bias_deg": 3})

    type: Literal["bias"]
    actuator: Actuator = entry(..., SURFACE_SAYS)
    bias_deg: Number = number(..., "deg", "this constant", ge=-90, le=90, examples=[2])

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["bias-rad"] += share * radians(self.bias_deg)


class RateLimit(Gradual):
    """The rate limit is multiplied by `scale`."""

    properties = (("rate-scale", 1.0),)
    in_words = growing(scale=lambda value: f"{100 * value:g} % of its rate")
    examples = (("rate limit 1.2 deg/s", {"scale": 0.02}),)
    button = Button(7, "rate limit", {"scale": 0.05})
    mavlink = (5, {"scale": 0.1})

    type: Literal["rate_limit"]
    actuator: Actuator = entry(..., SURFACE_SAYS)
    scale: Number = number(
        ..., "share of 1", "remaining share of the rate limit", ge=0, le=1, examples=[0.05]
    )

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["rate-scale"] *= 1.0 - share * (1.0 - self.scale)


class Oscillatory(Gradual):
    """The surface oscillates about its commanded position."""

    properties = (("oscillation-amplitude-rad", 0.0), ("oscillation-frequency-rad_sec", 0.0))
    truth = "oscillation-amplitude-rad"
    size = ("by", "deg")
    masks = ("oscillatory",)
    replaces_like = True
    in_words = growing(amplitude_deg="{:g} deg".format, frequency_rad_s="{:g} rad/s".format)
    examples = (
        ("oscillation 0.5 deg, 1 rad/s", {"amplitude_deg": 0.5, "frequency_rad_s": 1.0}),
        ("oscillation 0.5 deg, 10 rad/s", {"amplitude_deg": 0.5, "frequency_rad_s": 10.0}),
        ("oscillation 2 deg, 5 rad/s", {"amplitude_deg": 2.0, "frequency_rad_s": 5.0}),
    )
    button = Button(5, "oscillate", {"amplitude_deg": 3, "frequency_rad_s": 6})
    mavlink = 3, {"amplitude_deg": 3.0, "frequency_rad_s": 10.0}

    type: Literal["oscillatory"]
    actuator: Actuator = entry(..., SURFACE_SAYS)
    amplitude_deg: Number = number(..., "deg", "amplitude of the oscillation", gt=0, le=90, examples=[2])
    frequency_rad_s: Number = number(
        ..., "rad/s", "angular frequency of the oscillation", gt=0, le=1000, examples=[5]
    )

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["oscillation-amplitude-rad"] = share * radians(self.amplitude_deg)
        of["oscillation-frequency-rad_sec"] = self.frequency_rad_s


class Unanticipated(Gradual):
    """An extra pitching moment that grows with the cube of alpha, outside every fault class
    [Zhang2005]."""

    properties = (("Cm-alpha3", 0.0),)
    in_words = growing(Cm_alpha3="Cm_alpha3 {:g}".format)

    type: Literal["unanticipated"]
    Cm_alpha3: Number = number(10.0, "1/rad^3", "coefficient of alpha^3 in Cm", ge=-1000, le=1000)

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["Cm-alpha3"] += share * self.Cm_alpha3


__all__ = [
    "DAMAGE", "HEALTHY", "HOLDING", "MOST_FAULTS", "SENSOR_TYPES", "TYPES", "UNANTICIPATED", "Bias", "Damage",
    "Fault", "FaultType", "LossOfEffectiveness", "Nameable", "SensorFault", "Unanticipated", "acting_at",
    "fault_name", "is_share", "masking", "of_a_sensor", "place_of", "size_at",
    "without_effect",
]  # fmt: skip

UNANTICIPATED, DAMAGE = "unanticipated", "damage"
LOSS_OF_EFFECTIVENESS = "loss_of_effectiveness"
MOST_FAULTS = 1000  # of one flight: an hour of breaking and repairing by hand has room


def _rows() -> dict[str, type[SurfaceFault]]:
    """Every class of this folder that has a `type`, by that; `unanticipated` last."""
    files = [vars(import_module(f"{__name__}.{info.name}")) for info in pkgutil.iter_modules(__path__)]
    found = [row for names in (dict(globals()), *files) for row in names.values() if isinstance(row, type)]
    rows = {
        get_args(row.model_fields["type"].annotation)[0]: row
        for row in found
        if issubclass(row, SurfaceFault) and "type" in row.model_fields
    }
    rows[UNANTICIPATED] = rows.pop(UNANTICIPATED)
    return rows


TYPES = _rows()
SENSOR_TYPES = {
    get_args(row.model_fields["type"].annotation)[0]: row for row in get_args(get_args(AnySensorFault)[0])
}
# Failure properties of a surface, and those by which it does not follow its command.
HEALTHY = {name: value for row in TYPES.values() for name, value in row.properties}
HOLDING = tuple(row.holds for row in TYPES.values() if row.holds)


def place_of(fault: Any) -> str:
    """What a fault is of: a surface, a sensor, else its type: `unanticipated`, `damage`."""
    return str(getattr(fault, "sensor", None) or getattr(fault, "actuator", None) or fault.type)


def masking(fault: Any, faults: Iterable[Any], t_s: float) -> Any:
    """Of `faults`, one of the same surface because of which a fault does not act at t_s, or None. A jam, for
    instance, masks an oscillation. Of two alike that begin at once, the first in the list is the earlier."""
    is_earlier = True
    for other in faults:
        if other is fault:
            is_earlier = False
            continue
        row = TYPES.get(other.type)
        if row is None or place_of(other) != place_of(fault) or fault.type not in row.masks:
            continue
        began_first = other.at_s < fault.at_s or (other.at_s == fault.at_s and is_earlier)
        is_first_to_act = other.type != fault.type or began_first != row.replaces_like
        if is_first_to_act and is_in_force(other, t_s):
            return other
    return None


def acting_at(faults: Sequence[Any], t_s: float) -> list[Any]:
    """The faults that are in force at t_s and that no other one masks."""
    return [one for one in faults if is_in_force(one, t_s) and masking(one, faults, t_s) is None]


def without_effect(faults: Sequence[Any]) -> Iterator[tuple[int, str]]:
    """The place of each fault that another one masks from its beginning, and what is wrong with that."""
    for i, fault in enumerate(faults):
        other = masking(fault, faults, fault.at_s)
        if other is not None:
            until = "" if other.end_s is None else f", or from {other.end_s:g} s on"
            allowed = f"allowed: before {other.at_s:g} s{until}, or on another surface"
            what = f"{fault.type} of {place_of(fault)} has no effect at {fault.at_s:g} s"
            yield i, f"{what}, while this surface has the fault {other.type}, {allowed}"


def size_at(kind: str | None, faults: Sequence[Any], t_s: float) -> float | None:
    """The true size, at t_s, of what an estimate of this type is of: theta, or rad, of all faults of one
    surface together. None for a type without a size, and where the flight alone shows it.

    faults: with the keys of their type as the mapping `size`.
    """
    row = TYPES.get(kind or "")
    acting = [fault for fault in acting_at(faults, t_s) if fault.type in TYPES]
    alike = [fault for fault in acting if fault.type == kind]
    if row is None or not row.truth or (row.stays_where_it_is and not (alike and alike[0].size)):
        return None
    properties = dict(HEALTHY)
    for fault in sorted(acting, key=lambda fault: fault.at_s):
        known = {"at_s": fault.at_s, "profile": fault.profile, **(fault.size or {})}
        declared = TYPES[fault.type].model_construct(**known)
        declared.strike(properties, grown_share(declared, t_s), Past())
    return properties[row.truth] - HEALTHY[row.truth]


def is_share(kind: str | None) -> bool:
    """Whether the estimate of a type is a share of 1, and not an angle."""
    row = TYPES.get(kind or "")
    return row is not None and row.size is not None and row.size[1] == "%"


def of_a_sensor(fault: Any) -> bool:
    """Whether a fault, or what a file says of one, is an instrument's."""
    return "sensor" in fault if isinstance(fault, dict) else isinstance(fault, SensorFault)


def _nameable() -> tuple[str, ...]:
    """What a diagnosis can name."""
    return (*checked_aircraft().surfaces, UNANTICIPATED, *map(sensor_words, sensors_there()))


Nameable = Annotated[str, among(_nameable)]


def _tag(given: Any) -> str:
    return "(sensor)" if of_a_sensor(given) else "(surface)"  # no keys of the file


if TYPE_CHECKING:
    Fault = SurfaceFault | AnySensorFault
    FaultType = str
else:
    FaultType = Literal[tuple(TYPES)]
    Fault = Annotated[
        Annotated[Annotated[reduce(or_, TYPES.values()), Field(discriminator="type")], Tag("(surface)")]
        | Annotated[AnySensorFault, Tag("(sensor)")],
        Discriminator(_tag),
    ]
