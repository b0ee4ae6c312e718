"""What a plug-in is given: before the flight (`context_of`), and in each frame (`measured_of`)."""

from collections.abc import Mapping

import numpy as np

from beaver_ftc.design.context import Context
from beaver_ftc.design.model import DesignFunctions
from beaver_ftc.diagnosis import Measured
from beaver_ftc.diagnosis.deviations import plugin_errors
from beaver_ftc.loop.assembly import Trim
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario


def context_of(frames: np.ndarray, scenario: Scenario, trim: Trim, options: Mapping[str, float]) -> Context:
    """What a plug-in is given before the flight; trim: what is known of it."""
    frame, aircraft = frames[0], scenario.airframe
    layout, bound, design = frame["control"]["layout"], frame["fdi"]["bound"], frames["prediction"]["design"]
    constant = bound["const"].copy()
    if bound["error_map"]["n_boxes"]:
        constant += aircraft.model_error_rad_s2  # the most that the aircraft's terms leave in it
    return Context(
        dt_s=float(frame["dt"]),
        substeps=scenario.substeps,
        model=DesignFunctions(design.copy()),
        trim_x=trim.x.copy(),
        trim_y=trim.y.copy(),
        trim_rad=trim.command.copy(),
        travel_rad=np.array([layout["low"], layout["high"]]),
        constant_rad_s2=constant,
        inertia_coupling=bound["coupling_share"].copy(),
        surfaces=aircraft.surfaces,
        leading=(int(layout["main"][0]), int(layout["main"][1]), int(layout["main"][2])),
        options=dict(options),
        declared=plugin_errors(Declared.of(scenario), design, trim.y, trim.u),
    )


def measured_of(frame: np.void) -> Measured:
    """What is known at the frame just flown."""
    return Measured(
        float(frame["t"]),
        frame["measured"]["x"].copy(),
        frame["measured"]["y"][: 4 + int(frame["truth"]["declared"])].copy(),
        frame["prediction"]["means"]["F"].copy(),
        frame["prediction"]["means"]["Gu"].copy(),
        frame["fdi"]["bound"]["eta_bar"].copy(),
        frame["measured"]["attitude"].copy(),
        frame["measured"]["force"].copy(),
        float(frame["measured"]["altitude"]),
    )
