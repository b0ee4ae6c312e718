"""The sections of a vehicle file that name columns of a log, with unit, scale and offset of each column.

The docstrings of the sections have a line for each key, which becomes its description.
"""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_serializer, model_validator

from beaver_ftc.documents import Location, Number, Section, number, refuse
from beaver_ftc_logs.units import SI_UNITS, TIME_UNITS

ColumnName = Annotated[str, Field(min_length=1, max_length=200)]


class QuantityColumn(Section):
    """A column of the log: the value in `unit` is `scale` times its number, plus `offset`. For SI units, the
    name of the column is enough.

    column: name of the column in the log
    unit: unit of the numbers; left out: the SI unit
    scale: factor on the numbers in the log, 1
    offset: constant that is added, as the column
    """

    column: ColumnName = Field(examples=["gyro_x"])
    unit: Literal[tuple(SI_UNITS)] | None = Field(default=None, examples=["deg/s"])  # type: ignore[valid-type]
    scale: Number = number(1.0, unit="1", range="not 0", examples=[0.01])
    offset: Number = number(0.0, unit="as the column", range="any", examples=[-1.5])

    @model_validator(mode="after")
    def _check_scale_not_zero(self) -> "QuantityColumn":
        """Refuse a scale that makes every number the same."""
        if self.scale == 0:
            refuse([(("scale",), "0 leaves nothing of the column, allowed: any other number")])
        return self

    @model_serializer(mode="wrap")
    def _serialize_plain(self, serialize: Any) -> Any:
        """The name of the column alone, if unit, scale and offset are the defaults."""
        is_plain = self.unit is None and self.scale == 1.0 and self.offset == 0.0
        return self.column if is_plain else serialize(self)

    def to_si(self, values: Any) -> Any:
        """The column's numbers in SI: (scale values + offset) times the size of the unit in SI."""
        factor = self.scale * (SI_UNITS[self.unit][1] if self.unit else 1.0)
        return values * factor + self.offset * factor / self.scale


ColumnSpec = Annotated[
    QuantityColumn, BeforeValidator(lambda value: {"column": value} if isinstance(value, str) else value)
]


class TimeColumn(Section):
    """The column of the time, if the log is a table.

    column: name of the column
    unit: unit of the numbers
    """

    column: ColumnName = Field(examples=["TimeUS"])
    unit: Literal[tuple(TIME_UNITS)] = Field(default="s", examples=["us"])  # type: ignore[valid-type]


class RateColumns(Section):
    """The columns of the body rates.

    p: column of the roll rate, rad/s
    q: column of the pitch rate, rad/s
    r: column of the yaw rate, rad/s
    """

    p: ColumnSpec = Field(examples=["p_rad_s"])
    q: ColumnSpec = Field(examples=["q_rad_s"])
    r: ColumnSpec = Field(examples=["r_rad_s"])


class AttitudeColumns(Section):
    """Columns of the attitude angles, which show wrong units and signs of the rates. `diagnose --aircraft`
    requires them if turbulence is declared.

    roll: column of the roll angle, rad
    pitch: column of the pitch angle, rad
    yaw: column of the yaw angle, rad
    """

    roll: ColumnSpec = Field(examples=["roll_rad"])
    pitch: ColumnSpec | None = Field(default=None, examples=["pitch_rad"])
    yaw: ColumnSpec | None = Field(default=None, examples=["yaw_rad"])


class EnergyColumns(Section):
    """Columns that show an engine failure: altitude and airspeed fall together.

    altitude: column of the altitude, m
    airspeed: column of the airspeed, m/s
    """

    altitude: ColumnSpec = Field(examples=["altitude_m"])
    airspeed: ColumnSpec = Field(examples=["airspeed_m_s"])


def columns_below(location: Location, value: Any) -> Iterator[tuple[Location, QuantityColumn]]:
    """Every column in a value of the file, and its place; location: place of the value."""
    if isinstance(value, QuantityColumn):
        yield location, value
    elif isinstance(value, list):
        for i, item in enumerate(value):
            yield from columns_below((*location, i), item)
    elif isinstance(value, Section | dict):
        for key, item in dict(value).items():
            yield from columns_below((*location, key), item)
