"""What a fault of the aircraft is: a class a type, which is its row in every table.

It says its parameters with unit and range, what it does to the aircraft's failure properties, and how it is
shown to people. What the diagnosis makes of a type stands in diagnosis/types/table/.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, Self

from pydantic import model_validator

from beaver_ftc.documents.document import Conflict, Number, Section, entry, number, order_conflicts, refuse

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
