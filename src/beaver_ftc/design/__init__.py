"""The design model: f, G, their sensitivities, and what the designer knows of air and actuators."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.aircraft import AXES
    from beaver_ftc.design.atmosphere import standard_air
    from beaver_ftc.design.context import Context, DeclaredErrors
    from beaver_ftc.design.model import DesignFunctions, design_record, inertia_coefficients
    from beaver_ftc.design.plain_model import inertial
    from beaver_ftc.design.table import N_Y
else:
    __getattr__, __dir__ = lazily(__name__)
