"""The vehicle file: which columns of a log are rates and commands, and how each surface follows the commands.

The file names columns (`vehicle_columns`), and has no code. Unknown keys and every other mistake are refused
with one line each: `FILE:LINE: key: what is wrong, what is allowed`. The docstrings of the sections have a
line for each key, which becomes its description.
"""

import re
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents import (
    BadInput,
    Conflict,
    Document,
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
from beaver_ftc_logs.units import ACCELERATION, ANGLE, LENGTH, RATE, SI_UNITS, SPEED
from beaver_ftc_logs.vehicle_columns import (
    AttitudeColumns,
    ColumnSpec,
    EnergyColumns,
    QuantityColumn,
    RateColumns,
    TimeColumn,
    columns_below,
)

_MAX_FILE_BYTES = 1_000_000
MAX_ALARMS_PER_HOUR = 1000.0
# Largest sample rate of a log if the file leaves out max_rate_hz: in still air, and in moving air.
STILL_AIR_HZ = 20.0
_MOVING_AIR_HZ = 100.0
_BUILT_IN_FOLDER = Path(__file__).parent / "vehicles"

VehicleName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$", max_length=100)]
_SURFACE_NAME_PATTERN = re.compile(r"[A-Za-z0-9_-]{1,100}")
FaultKind = Literal["loss", "stuck"]
# Key -> kind of unit of the columns below it; empty: a unit of any kind.
_KINDS: dict[Location, str] = {
    ("rates",): RATE, ("commands",): "", ("signals",): "", ("attitude",): ANGLE,
    ("acceleration",): ACCELERATION, ("airspeed",): SPEED, ("energy", "altitude"): LENGTH,
    ("energy", "airspeed"): SPEED, ("flow", "alpha_rad"): ANGLE, ("flow", "beta_rad"): ANGLE,
}  # fmt: skip


class Vehicle(Section):
    """The vehicle, and the columns of its logs.

    name: name of the vehicle
    reader: format of the logs. `table`: CSV or Parquet. `ulog`: PX4. `alfa`: folder of the ALFA data set;
    left out: found from the path
    time: column with the time. Only a table without the column `t_s` needs this section
    rates: columns of the three body rates
    commands: columns of the commands to the servos, not of measured positions. Not required if the
    parameters of a PX4 or ArduPilot log state the surfaces
    signals: columns of other measured quantities that affect the body rates
    surfaces: mixer: the deflection of each healthy surface is a weighted sum of commands. Required as
    `commands`
    labels: columns with the true effectiveness of each surface, for `identify` and `diagnose --score`
    attitude: columns of the attitude angles. They show wrong units and signs of the body rates
    acceleration: column of the specific force along the z axis, about 1 g
    airspeed: column of the airspeed, to draw conclusions only in the range of the fit
    energy: columns that show an engine failure. While altitude and airspeed fall as after an engine
    failure, the diagnosis names no surface
    flow: columns of `alpha_rad`, `beta_rad`, `qdyn_pa` and signals, for `diagnose --aircraft`
    full_deflection_rad: deflection of each surface at a command of 1, for `diagnose --aircraft`; left
    out: 1
    reference_airspeed_mps: V0 of the factor (airspeed / V0)^n on each command; left out: `identify`
    chooses V0, if a factor improves the fit
    airspeed_powers: exponent n of each surface. With `other_laws: true`, `identify` estimates n; left
    out: 2
    outputs: columns of the servo outputs, for the freeze rule of `compare --flights`
    false_alarms_per_hour: accepted false alarms in each hour of healthy flight; left out: 1 for logs
    without labels, 1/h
    faults: fault types to test
    other_laws: true: the diagnosed flights can have another law, so more evidence is required; left out:
    false for logs with labels, otherwise true
    moving_air: true: gusts can move the aircraft, so the spectrum of the noise is estimated; left out:
    false for logs with labels, otherwise true
    max_rate_hz: sample rate to which a faster log is averaged; left out: 100 with `moving_air: true`,
    otherwise 20, Hz
    """

    name: VehicleName = Field(examples=["flying-wing"])
    reader: Literal["table", "alfa", "ulog", "ardupilot"] | None = None
    time: TimeColumn | None = None
    rates: RateColumns
    commands: list[ColumnSpec] = Field(min_length=1, max_length=20, examples=[["roll_cmd", "pitch_cmd"]])
    signals: list[ColumnSpec] = Field(default=[], max_length=12, examples=[["roll_rad", "pitch_rad"]])
    surfaces: dict[str, dict[str, Number]] = Field(
        min_length=1,
        max_length=20,
        json_schema_extra={"unit": "1", "range": "any"},
        examples=[{"left": {"roll_cmd": 0.5, "pitch_cmd": -0.5}}],
    )
    labels: dict[str, ColumnSpec] = Field(default={}, examples=[{"left": "left_truth"}])
    attitude: AttitudeColumns | None = None
    acceleration: ColumnSpec | None = Field(
        default=None, json_schema_extra={"unit": "m/s²"}, examples=["az_m_s2"]
    )
    airspeed: ColumnSpec | None = Field(
        default=None, json_schema_extra={"unit": "m/s"}, examples=["airspeed_m_s"]
    )
    energy: EnergyColumns | None = None
    flow: dict[str, ColumnSpec] = Field(
        default={}, examples=[{"alpha_rad": "alpha", "beta_rad": "beta", "qdyn_pa": "qbar"}]
    )
    full_deflection_rad: dict[str, Number] = Field(
        default={}, json_schema_extra={"unit": "rad", "range": "any"}, examples=[{"left": 0.4}]
    )
    reference_airspeed_mps: Number | None = Field(
        default=None, gt=0, json_schema_extra={"unit": "m/s"}, examples=[20.0]
    )
    airspeed_powers: dict[str, Number] = Field(
        default={}, json_schema_extra={"unit": "1", "range": "any"}, examples=[{"left": 1}]
    )
    outputs: dict[str, ColumnSpec] = Field(default={}, examples=[{"left": "left_pwm"}])
    false_alarms_per_hour: Number | None = number(
        None, gt=0, le=MAX_ALARMS_PER_HOUR, unit="1/h", examples=[2]
    )
    faults: list[FaultKind] = Field(default=["loss"], min_length=1, examples=[["loss", "stuck"]])
    other_laws: bool | None = Field(default=None, examples=[True])
    moving_air: bool | None = Field(default=None, examples=[True])
    max_rate_hz: Number | None = number(None, gt=0, le=1000, unit="Hz", examples=[50])

    @model_validator(mode="after")
    def _check_names(self) -> "Vehicle":
        """Refuse names of surfaces that no column may have, repeated commands and rates, surfaces that no
        command moves, names that the file does not define, and wrong units."""
        # The name of a surface becomes a part of names of columns in diagnosis.parquet.
        reason = "a surface's name has letters, digits, - and _ only, allowed: one"
        bad = [name for name in self.surfaces if not _SURFACE_NAME_PATTERN.fullmatch(name)]
        mistakes: list[Conflict] = [(("surfaces", name), f"{name!r}: {reason}") for name in bad]
        commands = self.command_columns
        of_key: list[tuple[str, Iterable[int | str], list[str]]] = [
            ("commands", range(len(commands)), commands),
            ("rates", AXES, self.rate_columns),
        ]
        for key, places, columns in of_key:
            mistakes += [
                ((key, place), f"{column!r} stands twice, allowed: each once")
                for i, (place, column) in enumerate(zip(places, columns, strict=True))
                if column in columns[:i]
            ]
        for surface, weights in self.surfaces.items():
            at = ("surfaces", surface)
            mistakes += _unknown_name_conflicts(at, weights, "command", commands)
            if not any(weights.values()):
                mistakes.append((at, "no command moves it, allowed: a weight that is not 0"))
        for key in ("labels", "outputs", "full_deflection_rad", "airspeed_powers"):
            mistakes += _unknown_name_conflicts((key,), getattr(self, key), "surface", self.surfaces)
        refuse([*mistakes, *self._unit_mistakes()])
        return self

    def _unit_mistakes(self) -> Iterator[Conflict]:
        """Units of another kind than that of their key; the first column that is read in two ways.

        first: for each column its first place in the file, with which later places must agree.
        """
        first: dict[str, QuantityColumn] = {}
        two_ways: list[Conflict] = []
        for location, kind, quantity in self.located_quantities():
            if kind and quantity.unit is not None and SI_UNITS[quantity.unit][0] != kind:
                units = [name for name, (its_kind, _) in SI_UNITS.items() if its_kind == kind]
                reason = f"{quantity.unit!r} is no unit of it, allowed: {', '.join(units)}"
                yield (*location, "unit"), reason
            if kind is not None and first.setdefault(quantity.column, quantity) != quantity:
                reason = f"{quantity.column!r} is read in two ways, allowed: one unit, scale and offset"
                two_ways.append((location, reason))
        yield from two_ways[:1]

    def located_quantities(self) -> list[tuple[Location, str | None, QuantityColumn]]:
        """Every column but those of labels and outputs: its place in the file, the kind of its unit, itself.

        The kind is empty where any unit may be right, and None of a flow that only the aircraft's model
        knows.
        """
        located = columns_below((), {key: value for key, value in self if key not in ("labels", "outputs")})
        return [(at, _KINDS.get(at, _KINDS.get(at[:1])), quantity) for at, quantity in located]

    @property
    def rate_columns(self) -> list[str]:
        """The columns of p, q and r."""
        return [self.rates.p.column, self.rates.q.column, self.rates.r.column]

    @property
    def command_columns(self) -> list[str]:
        """The commands' columns."""
        return [command.column for command in self.commands]

    @property
    def signal_columns(self) -> list[str]:
        """The further signals' columns."""
        return [signal.column for signal in self.signals]

    @property
    def sampled_columns(self) -> list[str]:
        """The columns of rates, commands and signals, each once."""
        return list(dict.fromkeys(self.rate_columns + self.command_columns + self.signal_columns))

    @property
    def max_sample_rate_hz(self) -> float:
        """The rate above which a log is averaged, Hz. In moving air it is higher: a law can react to a gust
        within the interval of an average, and a fit cannot distinguish this reaction from the effect of the
        surface."""
        still = self.moving_air is False or (self.moving_air is None and self.labels)
        default_hz = STILL_AIR_HZ if still else _MOVING_AIR_HZ
        return float(self.max_rate_hz or default_hz)

    def n_signal_lags(self, n_rate_lags: int) -> int:
        """Number of past samples of the signals, for this number of past samples of the rates: as many in
        moving air, otherwise one. Coloured noise is whitened by the same filter on rates, commands and
        signals, which gives all of them further lags."""
        return n_rate_lags if self.moving_air else 1

    @property
    def surface_airspeed_powers(self) -> list[float]:
        """Exponent n of (airspeed / V0)^n on the command of each surface, (S,)."""
        return [float(self.airspeed_powers.get(name, 2.0)) for name in self.surfaces]

    @property
    def regressor_columns(self) -> list[str]:
        """The further signals of a fit: those in the file and, with a reference airspeed, the products of
        rates and signals with the airspeed (`samples.scale_by_airspeed`)."""
        scaled = self.rate_columns + self.signal_columns if self.reference_airspeed_mps is not None else []
        return self.signal_columns + [f"{name} by airspeed" for name in scaled]

    def column_names(self) -> list[str]:
        """Every column of a log that the vehicle file names, except the time."""
        return list(dict.fromkeys(quantity.column for _, quantity in columns_below((), self)))


def _unknown_name_conflicts(
    location: Location, names: Iterable[str], name_kind: str, known: Collection[str]
) -> list[Conflict]:
    """One mistake for each unknown name below a location. name_kind: word for the kind of name in the
    text."""
    unknown = [name for name in names if name not in known]
    return [((*location, name), f"{name!r} is no {name_kind}{suggestion(name, known)}") for name in unknown]


def unused_keys_as_comments(used_keys: Collection[str]) -> str:
    """Comments for the end of a vehicle file: each unused key with its description and an example."""
    lines = ["# Further keys:"]
    for name, field in Vehicle.model_fields.items():
        if name not in used_keys:
            example = f"   for example {field.examples[0]}" if field.examples else ""
            lines.append(f"# {name}: {field.description}{example}")
    return "\n".join(lines) + "\n"


def load_vehicle(vehicle: str | Path) -> Vehicle:
    """The vehicle in a file or of a built-in name. Raises ScenarioError with one line a mistake."""
    document, path = read_vehicle_document(vehicle)
    return validate(Vehicle, document, path)


def read_vehicle_document(vehicle: str | Path) -> tuple[Document, str]:
    """The text of a vehicle file as data that is not checked yet, and its path. Raises ScenarioError."""
    place = str(vehicle)
    built_in = sorted(path.stem for path in _BUILT_IN_FOLDER.glob("*.yaml"))
    if looks_like_a_path(place):
        text = text_of(place, _MAX_FILE_BYTES)
    else:
        place = str(_BUILT_IN_FOLDER / f"{place}.yaml") if place in built_in else place
        unknown = f"no such file or built-in vehicle{suggestion(place, built_in)}"
        text = text_of(place, _MAX_FILE_BYTES, lambda: unknown)
    path = str(Path(place))
    return parse_document(text, path), path


def with_alarm_rate(vehicle: Vehicle, false_alarms_per_hour: float) -> Vehicle:
    """The vehicle with another accepted rate of false alarms, 1/h. Raises BadInput if it is out of range."""
    if not 0.0 < false_alarms_per_hour <= MAX_ALARMS_PER_HOUR:
        allowed = f"allowed: more than 0, up to {MAX_ALARMS_PER_HOUR:g} an hour"
        raise BadInput(f"identify: --false-alarms-per-hour {false_alarms_per_hour:g}: {allowed}")
    return vehicle.model_copy(update={"false_alarms_per_hour": false_alarms_per_hour})
