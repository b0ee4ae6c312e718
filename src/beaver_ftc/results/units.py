"""The unit of a column or key, which its name ends with."""

from collections.abc import Iterable

_UNIT_OF_NAME_ENDING = (  # ending of a column's name, unit; `_rad_s` before `_s`, which it ends with
    ("_rad_s2", "rad/s2"), ("_deg2_s", "deg2/s"), ("_deg_s", "deg/s"), ("_rad_s", "rad/s"),
    ("_per_s", "1/s"), ("_rad", "rad"), ("_deg", "deg"), ("_mps", "m/s"), ("_inhg", "inHg"), ("_pa", "Pa"),
    ("_hz", "Hz"), ("_m", "m"), ("_s", "s"),
)  # fmt: skip


def units(columns: Iterable[str]) -> dict[str, str]:
    """The unit of each column."""
    return {column: unit_of(column) for column in columns}


def unit_of(column: str) -> str:
    """The unit of a column, from the ending of its name, or else of the section in front of it; "1" for a
    pure number. `tracking.surface_travel_deg.aileron` has the unit deg.
    """
    parts = reversed(column.split("."))
    return next(
        (unit for part in parts for ending, unit in _UNIT_OF_NAME_ENDING if part.endswith(ending)), "1"
    )
