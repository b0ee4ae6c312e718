"""What is known of an aircraft beside its JSBSim model: one file of data, read here and nowhere else."""

from beaver_ftc.aircraft.aircraft import AXES, Aircraft, MassProperties, Term, Travel
from beaver_ftc.aircraft.loading import DEFAULT, UnknownAircraft, builtin_names, load

__all__ = [
    "AXES", "DEFAULT", "Aircraft", "MassProperties", "Term", "Travel", "UnknownAircraft", "builtin_names",
    "load",
]  # fmt: skip
