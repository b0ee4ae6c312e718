"""What a scenario may say to change in flight (`changes:`): law, diagnosis and sensors, from a time on."""

from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from beaver_ftc.documents.base import Number, Section, number, refuse
from beaver_ftc.scenario.control import known_law
from beaver_ftc.scenario.diagnosis import can_be_bounded, known_scheme
from beaver_ftc.scenario.sensors import Sensors


class Change(Section):
    """From a time on another law, another diagnosis, other sensors; what is left out stays as it is."""

    at_s: Number = number(unit="s", says="from when on", gt=0, le=360_000)
    law: Annotated[str, AfterValidator(known_law)] | None = Field(
        default=None, description="as control.law; surfaces and reference go on from where they are"
    )
    scheme: Annotated[str, AfterValidator(known_scheme)] | None = Field(
        default=None, description="as fdi.scheme; the diagnosis begins anew"
    )
    sensors: Sensors | None = Field(default=None, description="as sensors: a preset, or errors by signal")
    declared_sensors: Annotated[Sensors, AfterValidator(can_be_bounded)] | None = Field(
        default=None, description="as fdi.bounds.sensors; the diagnosis begins anew"
    )

    @model_validator(mode="after")
    def _changes_something(self) -> Self:
        said = (value for key, value in self if key != "at_s")
        if all(value is None for value in said):
            refuse([((), "says no change, allowed: law, scheme, sensors or declared_sensors")])
        return self
