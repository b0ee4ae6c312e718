"""The design model: f, G, their sensitivities, and what the designer knows of air and actuators."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.design.air import standard_air
    from beaver_ftc.design.context import Context, Declared, DesignFunctions
    from beaver_ftc.design.model import AXES, N_Y, design_record, inertia_coefficients, inertial
else:
    __getattr__, __dir__ = lazily(__name__)
