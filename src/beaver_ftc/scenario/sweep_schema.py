"""The sweep file: a base scenario, what varies in it, and what the statistics must show."""

from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from beaver_ftc.documents.base import Conflict, Number, Section, Whole, refuse
from beaver_ftc.scenario.schema import NAME_PATTERN

MAX_RUNS = 10_000_000
Sampling = Literal["random", "grid", "lhs", "sobol"]
KINDS = ("uniform", "loguniform", "normal", "linspace", "choice")
COUNTED = ("linspace", "choice")  # kinds with a finite number of values: what a grid is made of

Span = tuple[Number, Number]


class Variation(Section):
    """How one key varies: a mapping of exactly one kind to its parameters."""

    uniform: Span | None = Field(default=None, description="[lowest, highest], all values equally likely")
    loguniform: Span | None = Field(
        default=None, description="[lowest, highest], all ratios equally likely, lowest over 0"
    )
    normal: Span | None = Field(default=None, description="[mean, standard deviation]")
    within: Span | None = Field(
        default=None, description="[lowest, highest] that `normal` is cut to; only with normal"
    )
    linspace: tuple[Number, Number, Annotated[Whole, Field(ge=1, le=1_000_000)]] | None = Field(
        default=None, description="[first, last, count], gone through in turn"
    )
    choice: tuple[Any, ...] | None = Field(
        default=None, min_length=1, max_length=100_000, description="a list of values, all equally likely"
    )

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        given = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(given) != 1:
            refuse([((), f"{len(given)} kinds of variation, allowed: exactly one of {', '.join(KINDS)}")])
        refuse([*self._order_conflicts(), *self._normal_conflicts()])
        return self

    def _order_conflicts(self) -> list[Conflict]:
        says = "out of order, allowed: [lowest, highest]"
        spans = [(key, span) for key in ("uniform", "loguniform", "within") if (span := getattr(self, key))]
        conflicts: list[Conflict] = [((key,), says) for key, (lowest, highest) in spans if lowest >= highest]
        if self.loguniform and self.loguniform[0] <= 0:
            conflicts.append((("loguniform",), "has no logarithm, allowed: a lowest value over 0"))
        return conflicts

    def _normal_conflicts(self) -> list[Conflict]:
        if self.within and not self.normal:
            return [(("within",), "has no meaning here, allowed: only with normal")]
        if self.normal and self.normal[1] <= 0:
            return [(("normal",), "a spread of zero or less, allowed: [mean, standard deviation over 0]")]
        return []

    @property
    def kind(self) -> str:
        """Which of KINDS it is."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)

    @property
    def count(self) -> int | None:
        """How many values there are; None for a continuous kind."""
        if self.linspace is not None:
            return self.linspace[2]
        return None if self.choice is None else len(self.choice)

    def probes(self) -> tuple[Any, ...]:
        """Values at which the base is tried when the file is read: the ends, or every choice."""
        if self.choice is not None:
            return self.choice
        if self.normal is not None:
            return (self.normal[0], *(self.within or ()))
        span = self.uniform or self.loguniform or self.linspace
        assert span is not None
        return span[:2]


class Level(Section):
    """A bound on a number that the flights estimate; with a confidence, on its one-sided confidence bound."""

    at_least: Number | None = Field(default=None, description="smallest value allowed")
    at_most: Number | None = Field(default=None, description="largest value allowed")
    confidence: Number | None = Field(
        default=None, ge=0.5, lt=1, description="left out: the estimate itself is held against the bound"
    )

    @model_validator(mode="after")
    def _bounds_something(self) -> Self:
        if self.at_least is None and self.at_most is None:
            refuse([((), "bounds nothing, allowed: at_least, at_most or both")])
        return self


class QuantileLevel(Level):
    """A bound on a quantile over the flights."""

    quantile: Number = Field(default=0.95, gt=0, lt=1, description="which quantile, 0.5 is the median")


class AxisLevels(Section):
    """One bound an axis."""

    p: QuantileLevel | None = None
    q: QuantileLevel | None = None
    r: QuantileLevel | None = None


class SweepExpect(Section):
    """What the statistics of a sweep must show; what is left out is not asserted."""

    detection_rate: Level | None = Field(default=None, description="share of faults that were detected")
    isolation_rate: Level | None = Field(default=None, description="share of faults that were named rightly")
    false_alarms_per_hour: Level | None = Field(default=None, description="per hour without a fault")
    departure_rate: Level | None = Field(default=None, description="share of flights that lost the aircraft")
    failure_rate: Level | None = Field(default=None, description="share of flights that could not be flown")
    pass_rate: Level | None = Field(
        default=None, description="share of flights that met every expectation of the base scenario"
    )
    detection_delay_s: QuantileLevel | None = Field(
        default=None, description="from fault to alarm; a missed fault counts as infinite"
    )
    isolation_delay_s: QuantileLevel | None = Field(
        default=None, description="from fault to the right name; a fault not named rightly counts as infinite"
    )
    post_fault_rms_deg_s: AxisLevels | None = Field(
        default=None, description="RMS tracking error after the fault; a departure counts as infinite"
    )
    tracking_ratio: AxisLevels | None = Field(
        default=None,
        description="RMS error after / before the fault; a departure counts as infinite",
    )


class SweepFile(Section):
    """Many flights: a base scenario, what varies in it, and what the statistics must show."""

    model_config = ConfigDict(title="beaver-ftc sweep")

    name: str = Field(
        pattern=NAME_PATTERN, max_length=70, description="name of the result folder: letters, digits, - and _"
    )
    description: str = Field(default="", max_length=2000, description="what the sweep is to show")
    base: str | dict[str, Any] = Field(
        description="a built-in scenario's name, a scenario file beside this one, or a scenario itself"
    )
    set: dict[str, Any] = Field(
        default_factory=dict, description="dotted keys of the base to new values, the same in all flights"
    )
    runs: Whole | None = Field(
        default=None, ge=1, le=MAX_RUNS, description="number of flights; left out: one a point of the grid"
    )
    seed: Whole = Field(default=1, ge=0, le=2**63 - 1, description="of all values and of each flight's seed")
    sampling: Sampling = Field(default="random", description="how values are drawn that are not linspace")
    vary: dict[str, Variation] = Field(
        default_factory=dict, max_length=200, description="dotted keys of the base to how they vary"
    )
    expect: SweepExpect = Field(default_factory=SweepExpect, description="what the statistics must show")

    @model_validator(mode="after")
    def _parts_fit_together(self) -> Self:
        refuse([*self._grid_conflicts(), *self._runs_conflicts()])
        return self

    @property
    def grid_size(self) -> int:
        """Number of points gone through in turn: of the `linspace` keys, and in a grid of all keys."""
        size = 1
        for how in self.vary.values():
            if how.linspace is not None or self.sampling == "grid":
                size *= how.count or 1
        return size

    @property
    def flights(self) -> int:
        """Number of flights."""
        return self.grid_size if self.runs is None else self.runs

    def _grid_conflicts(self) -> list[Conflict]:
        if self.sampling != "grid":
            return []
        says = f"cannot be counted, allowed in a grid: {', '.join(COUNTED)}"
        return [(("vary", key), says) for key, how in self.vary.items() if how.count is None]

    def _runs_conflicts(self) -> list[Conflict]:
        size = self.grid_size
        if self.runs is None:
            if size > MAX_RUNS:
                return [(("vary",), f"a grid of {size} points, allowed: at most {MAX_RUNS}")]
            says = "required key is missing, allowed: the number of flights (only a grid gives it)"
            return [(("runs",), says)] if size == 1 else []
        return []


def sweep_json_schema() -> dict[str, Any]:
    """The JSON Schema of a sweep file, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **SweepFile.model_json_schema()}
