"""The vehicle file: which columns of a log are rates and commands, and what each surface makes of these.

It names columns, not code. Unknown keys and every other mistake are refused with one line each:
`FILE:LINE: key: what is wrong, what is allowed`.
"""

import re
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_serializer, model_validator

from beaver_ftc.documents import (
    BadInput,
    Conflict,
    Location,
    Number,
    Section,
    number,
    parse_document,
    refuse,
    suggestion,
    text_of,
)
from beaver_ftc.documents import validate_model as validate
from beaver_ftc.scenario import looks_like_a_path
from beaver_ftc_logs.units import ACCELERATION, ANGLE, LENGTH, RATE, SECONDS, SPEED, UNITS, units_of

_MAX_BYTES = 1_000_000
MOST_PER_HOUR = 1000.0
_USUAL_HZ, _LAW_HZ = 20.0, 100.0
_FOLDER = Path(__file__).parent / "vehicles"

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$", max_length=100)]
_NAME = re.compile(r"[A-Za-z0-9_-]{1,100}")
ColumnName = Annotated[str, Field(min_length=1, max_length=200)]
Kind = Literal["loss", "stuck"]


class Quantity(Section):
    """A column of the log and what its numbers are: (scale times the number plus offset) in the unit."""

    column: ColumnName = Field(description="the column's name in the log", examples=["gyro_x"])
    unit: Literal[tuple(UNITS)] | None = Field(  # type: ignore[valid-type]
        default=None, description="unit of its numbers, SI where left out", examples=["deg/s"]
    )
    scale: Number = number(
        1.0, unit="1", says="what its numbers are multiplied by", range="not 0", examples=[0.01]
    )
    offset: Number = number(0.0, unit="as the column", says="added after that", range="any", examples=[-1.5])

    @model_validator(mode="after")
    def _holds_something(self) -> "Quantity":
        refuse(
            [(("scale",), "0 leaves nothing of the column, allowed: any other number")] * (self.scale == 0)
        )
        return self

    @model_serializer(mode="wrap")
    def _short(self, whole: Any) -> Any:
        """A name is enough where nothing else is said."""
        plain = self.unit is None and self.scale == 1.0 and self.offset == 0.0
        return self.column if plain else whole(self)

    @property
    def factor(self) -> float:
        """What the column's numbers are multiplied by to have them in SI."""
        return self.scale * (UNITS[self.unit][1] if self.unit else 1.0)

    def si(self, values: Any) -> Any:
        """The column's numbers in SI."""
        if self.factor == 1.0 and self.offset == 0.0:
            return values
        return values * self.factor + self.offset * self.factor / self.scale


def _named(given: Any) -> Any:
    return {"column": given} if isinstance(given, str) else given


Logged = Annotated[Quantity, BeforeValidator(_named)]


class Time(Section):
    """The column of a table that holds its time."""

    column: ColumnName = Field(description="the column's name", examples=["TimeUS"])
    unit: Literal[tuple(SECONDS)] = Field(  # type: ignore[valid-type]
        default="s", description="unit of its numbers", examples=["us"]
    )


class Rates(Section):
    """The columns of the three body rates, rad/s."""

    p: Logged = Field(description="column of the roll rate, rad/s", examples=["p_rad_s"])
    q: Logged = Field(description="column of the pitch rate, rad/s", examples=["q_rad_s"])
    r: Logged = Field(description="column of the yaw rate, rad/s", examples=["r_rad_s"])


class Attitude(Section):
    """Columns of the attitude: rates are checked against it; in turbulence an aircraft's model wants it."""

    roll: Logged = Field(description="column of the roll angle, rad", examples=["roll_rad"])
    pitch: Logged | None = Field(
        default=None, description="column of the pitch angle, rad", examples=["pitch_rad"]
    )
    yaw: Logged | None = Field(default=None, description="column of the yaw angle, rad", examples=["yaw_rad"])


class Energy(Section):
    """Columns by which it shows whether power is there."""

    altitude: Logged = Field(description="column of the altitude, m", examples=["altitude_m"])
    airspeed: Logged = Field(description="column of the airspeed, m/s", examples=["airspeed_m_s"])


class Vehicle(Section):
    """What the columns of a vehicle's logs are."""

    name: Name = Field(description="what the vehicle is called", examples=["flying-wing"])
    reader: Literal["table", "alfa", "ulog", "ardupilot"] | None = Field(
        default=None, description="how its logs are read, where a path does not show it"
    )
    time: Time | None = Field(default=None, description="the time of a table that has no `t_s`")
    rates: Rates
    commands: list[Logged] = Field(
        min_length=1,
        max_length=20,
        description="columns of the commands, upstream of what can fail",
        examples=[["roll_cmd", "pitch_cmd"]],
    )
    signals: list[Logged] = Field(
        default=[],
        max_length=12,
        description="further measured columns the rates depend on",
        examples=[["roll_rad", "pitch_rad"]],
    )
    surfaces: dict[str, dict[str, Number]] = Field(
        min_length=1,
        max_length=20,
        description="what each healthy surface makes of the commands: a share of each",
        json_schema_extra={"unit": "share of 1", "range": "any"},
        examples=[{"left": {"roll_cmd": 0.5, "pitch_cmd": 0.5}}],
    )
    labels: dict[str, Logged] = Field(
        default={},
        description="columns with each surface's true effectiveness: identification and scoring",
        examples=[{"left": "left_truth"}],
    )
    attitude: Attitude | None = Field(
        default=None, description="attitude, against which the rates are checked"
    )
    acceleration: Logged | None = Field(
        default=None,
        description="column of the acceleration along z, m/s2: 1 g on the mean",
        examples=["az_m_s2"],
    )
    airspeed: Logged | None = Field(
        default=None,
        description="column of the airspeed, m/s: a model holds where it was fitted",
        examples=["airspeed_m_s"],
    )
    energy: Energy | None = Field(
        default=None, description="altitude and airspeed: an engine failure is not named as a surface"
    )
    flow: dict[str, Logged] = Field(
        default={},
        description="columns of what else an aircraft's own model is given, by the aircraft's names",
        examples=[{"alpha_rad": "alpha", "beta_rad": "beta", "qdyn_pa": "qbar"}],
    )
    full_deflection_rad: dict[str, Number] = Field(
        default={},
        description="deflection of each surface at 1, rad, for an aircraft's own model; 1 where left out",
        json_schema_extra={"unit": "rad", "range": "any"},
        examples=[{"left": 0.4}],
    )
    reference_airspeed_mps: Number | None = Field(
        default=None,
        gt=0,
        description="surfaces work with the dynamic pressure: commands count (airspeed / this)^2 times; "
        "`identify` finds by itself whether that explains more",
        json_schema_extra={"unit": "m/s"},
        examples=[20.0],
    )
    airspeed_powers: dict[str, Number] = Field(
        default={},
        description="the power of the airspeed with which a surface's command counts; 2 where left out; "
        "`identify` finds it for `other_laws`",
        json_schema_extra={"unit": "1", "range": "any"},
        examples=[{"left": 1}],
    )
    outputs: dict[str, Logged] = Field(
        default={},
        description="columns of the servo outputs: read by the freeze rule of a benchmark alone",
        examples=[{"left": "left_pwm"}],
    )
    false_alarms_per_hour: Number | None = number(
        None,
        gt=0,
        le=MOST_PER_HOUR,
        unit="1/h",
        says="alarms in healthy flight that are accepted; 1 without labels",
        examples=[2],
    )
    faults: list[Kind] = Field(
        default=["loss"],
        min_length=1,
        description="what a surface may do: lose effectiveness, be stuck",
        examples=[["loss", "stuck"]],
    )
    other_laws: bool | None = Field(
        default=None,
        description="flights to be diagnosed may be flown by other laws than those of `identify`: an alarm "
        "and a name ask for more; assumed where left out and no labels show faults",
        examples=[True],
    )
    moving_air: bool | None = Field(
        default=None,
        description="flights meet gusts, which laws answer: every sample counts, and noise has the colour "
        "of the flight; assumed where left out and no labels show faults",
        examples=[True],
    )
    max_rate_hz: Number | None = number(
        None,
        gt=0,
        le=1000,
        unit="Hz",
        says="rate above which the log is averaged to this rate; 100, 20 where the air does not move",
        examples=[50],
    )

    @model_validator(mode="after")
    def _agree(self) -> "Vehicle":
        says = "a surface's name has letters, digits, - and _ only, allowed: one"  # it is part of a column's
        bad = [name for name in self.surfaces if not _NAME.fullmatch(name)]
        conflicts: list[Conflict] = [(("surfaces", name), f"{name!r}: {says}") for name in bad]
        for surface, row in self.surfaces.items():
            conflicts += _unknown(("surfaces", surface), row, "command", self.command_names)
        of_surfaces: dict[str, Collection[str]] = {
            "labels": self.labels,
            "outputs": self.outputs,
            "full_deflection_rad": self.full_deflection_rad,
            "airspeed_powers": self.airspeed_powers,
        }
        for key, table in of_surfaces.items():
            conflicts += _unknown((key,), table, "surface", self.surfaces)
        for place, kind, one in self.judged():
            if one.unit is not None and UNITS[one.unit][0] != kind:
                says = f"{one.unit!r} is no unit of it, allowed: {', '.join(units_of(kind))}"
                conflicts.append(((*place, "unit"), says))
        conflicts += self._twice()
        refuse(conflicts)
        return self

    def judged(self) -> list[tuple[Location, str, Quantity]]:
        """The quantities whose kind is known, those only looked at among them, and where they stand."""
        found: list[tuple[Location, str, Quantity]] = [
            (("rates", axis), RATE, getattr(self.rates, axis)) for axis in "pqr"
        ]
        if self.attitude is not None:
            found.append((("attitude", "roll"), ANGLE, self.attitude.roll))
            for angle in ("pitch", "yaw"):
                if (one := getattr(self.attitude, angle)) is not None:
                    found.append((("attitude", angle), ANGLE, one))
        if self.acceleration is not None:
            found.append((("acceleration",), ACCELERATION, self.acceleration))
        if self.airspeed is not None:
            found.append((("airspeed",), SPEED, self.airspeed))
        if self.energy is not None:
            found.append((("energy", "altitude"), LENGTH, self.energy.altitude))
            found.append((("energy", "airspeed"), SPEED, self.energy.airspeed))
        for name in ("alpha_rad", "beta_rad"):
            if name in self.flow:
                found.append((("flow", name), ANGLE, self.flow[name]))
        return found

    def _twice(self) -> list[Conflict]:
        """One column read in two ways."""
        seen: dict[str, Quantity] = {}
        for at, one in [*self.quantities(), *((at, one) for at, _, one in self.judged())]:
            if seen.setdefault(one.column, one) != one:
                return [(at, f"{one.column!r} is read in two ways, allowed: one unit, scale and offset")]
        return []

    def quantities(self) -> list[tuple[Location, Quantity]]:
        """Rates, commands and signals as they stand in the file."""
        found: list[tuple[Location, Quantity]] = [(("rates", x), getattr(self.rates, x)) for x in "pqr"]
        found += [(("commands", i), one) for i, one in enumerate(self.commands)]
        return found + [(("signals", i), one) for i, one in enumerate(self.signals)]

    @property
    def command_names(self) -> list[str]:
        """The commands' columns."""
        return [command.column for command in self.commands]

    @property
    def signal_names(self) -> list[str]:
        """The further signals' columns."""
        return [signal.column for signal in self.signals]

    @property
    def rate_hz(self) -> float:
        """The rate above which a log is averaged. Within an average a law may answer what the same average
        shows, and no fit tells that from what the surface does: of other laws every sample is wanted."""
        still = self.moving_air is False or (self.moving_air is None and self.labels)
        usual_hz = _USUAL_HZ if still else _LAW_HZ
        return float(self.max_rate_hz or usual_hz)

    def felt(self, history: int) -> int:
        """Past samples of the signals, of so many of the rates: noise that is coloured is whitened by
        filtering all that comes in alike."""
        return history if self.moving_air else 1

    @property
    def powers(self) -> list[float]:
        """The power of the airspeed with which each surface's command counts."""
        return [float(self.airspeed_powers.get(name, 2.0)) for name in self.surfaces]

    @property
    def past_names(self) -> list[str]:
        """What the rates depend on beside their own past: signals, and what they and the rates do by
        airspeed (`samples.with_pressure`)."""
        rates = [getattr(self.rates, axis).column for axis in "pqr"]
        more = rates + self.signal_names if self.reference_airspeed_mps is not None else []
        return self.signal_names + [f"{name} by airspeed" for name in more]

    def columns(self) -> list[str]:
        """Every column of a log that the vehicle may want, its time aside."""
        wanted = [one for _, one in self.quantities()] + [one for _, _, one in self.judged()]
        wanted += [*self.flow.values(), *self.labels.values(), *self.outputs.values()]
        return list(dict.fromkeys(one.column for one in wanted))


def _unknown(at: Location, names: Iterable[str], what: str, known: Collection[str]) -> list[Conflict]:
    """The conflicts of names below a location that are not known."""
    unknown = [name for name in names if name not in known]
    return [((*at, name), f"{name!r} is no {what}{suggestion(name, known)}") for name in unknown]


def further_keys(given: Collection[str]) -> str:
    """Comments for the end of a vehicle file: each key that it has not, with an example, and what it says."""
    lines = ["# Further keys:"]
    for name, field in Vehicle.model_fields.items():
        if name not in given:
            like = f"   for example {field.examples[0]}" if field.examples else ""
            lines.append(f"# {name}: {field.description}{like}")
    return "\n".join(lines) + "\n"


def load_vehicle(path_or_name: str | Path) -> Vehicle:
    """The vehicle in a file or of a built-in name. Raises ScenarioError with one line a mistake."""
    given, known = str(path_or_name), sorted(path.stem for path in _FOLDER.glob("*.yaml"))
    if looks_like_a_path(given):
        text = text_of(given, _MAX_BYTES)
    else:
        given = str(_FOLDER / f"{given}.yaml") if given in known else given
        unknown = f"no such file or built-in vehicle{suggestion(given, known)}"
        text = text_of(given, _MAX_BYTES, lambda: unknown)
    path = str(Path(given))
    return validate(Vehicle, parse_document(text, path), path)


def asking(vehicle: Vehicle, per_hour: float) -> Vehicle:
    """The vehicle with a rate of false alarms that is accepted. Raises BadInput for one that is none."""
    if not 0.0 < per_hour <= MOST_PER_HOUR:
        says = f"allowed: more than 0, up to {MOST_PER_HOUR:g} an hour"
        raise BadInput(f"identify: --false-alarms-per-hour {per_hour:g}: {says}")
    return vehicle.model_copy(update={"false_alarms_per_hour": per_hour})
