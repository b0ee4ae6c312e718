"""The surfaces of a PX4 log, by its parameters.

CA_SV_CSn_... are type and torques of surface n. PWM_MAIN_... and PWM_AUX_... are the function, range and
direction of each output.
"""

import re
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from beaver_ftc_logs.mixing_parts import (
    LEAST_WEIGHT,
    Axes,
    BadParameterError,
    CheckedParameters,
    MixingParts,
    Outputs,
    Surface,
    full_name,
    pulse_reading,
)
from beaver_ftc_logs.recording import last_value

# CA_SV_CSn_TYPE of a surface that moves the aircraft about an axis -> name of the surface.
_SURFACES = {
    1: "left_aileron", 2: "right_aileron", 3: "elevator", 4: "rudder", 5: "left_elevon", 6: "right_elevon",
    7: "left_vtail", 8: "right_vtail", 12: "custom", 13: "left_atail", 14: "right_atail", 15: "aileron",
}  # fmt: skip
# Name of the parameter with the function of an output; groups: driver, number.
_OUTPUT_PATTERN = r"(PWM_MAIN|PWM_AUX)_FUNC(\d{1,2})"
_MAX_TORQUE = 1000.0  # largest magnitude of CA_SV_CSn_TRQ_R, _P and _Y, in the unit of the log
_MAX_SURFACES = 8  # largest CA_SV_CS_COUNT
_FIRST_SERVO = 201  # function of an output that moves surface 0; that for surface n is larger by n
_FIXED_WING = 1  # CA_AIRFRAME of a fixed wing
_AXIS_COLUMNS = tuple(f"vehicle_torque_setpoint.xyz[{i}]" for i in range(3))


def px4_mixing(params: CheckedParameters, column_names: set[str]) -> MixingParts:
    """The surfaces by CA_SV_CSn_TYPE, with shares by their torques; the ways in which their outputs may be
    logged; the commands of the axes. The lines of params receive a remark on each part that is left out.

    drivers: number of the surface -> the parameters that give it an output, such as PWM_MAIN_FUNC3.
    """
    try:
        n = params.whole_number("CA_SV_CS_COUNT", 1, _MAX_SURFACES)
    except BadParameterError as problem:
        params.lines.append(str(problem))
        n = 0
    names = {i: f"CA_SV_CS{i}_TYPE" for i in range(n)}
    kinds = params.kinds(
        "surface", names, _SURFACES, unknown_text="moves the aircraft about no axis", unused=()
    )
    shares = _px4_axis_shares(params, kinds)
    drivers: dict[int, list[str]] = {}
    surfaces = []
    for i, kind in kinds.items():
        if shares[i] is not None and not shares[i].any():
            params.lines.append(f"surface {i} stays out: CA_SV_CS{i}_TRQ_R, _P and _Y are 0")
            continue
        servo = _FIRST_SERVO + i
        drivers[i] = [
            name
            for name, values in params.values_by_name.items()
            if values[-1] == servo and re.fullmatch(_OUTPUT_PATTERN, name)
        ]
        reason = f"CA_SV_CS{i}_TYPE {kind}{''.join(f', {name} {servo}' for name in drivers[i])}"
        full = full_name(_SURFACES[kind], i, kinds)
        surfaces.append(Surface(full, f"surface {i}", i, shares[i], reason))
    outputs = [[(f"actuator_servos.control[{i}]", (1.0, 0.0, "")) for i in drivers]]
    if "actuator_outputs_1.output[0]" not in column_names:  # with it, it is unknown which of the two is MAIN
        outputs += _px4_pulses(params, [*drivers.values()])
    # A vehicle that can hover has several torque setpoints, and it is unknown which one moves the surfaces.
    is_fixed_wing = last_value(params.values_by_name, "CA_AIRFRAME") == _FIXED_WING
    reason = "" if is_fixed_wing else "CA_AIRFRAME is not 1 (fixed wing)"
    return surfaces, outputs, Axes(_AXIS_COLUMNS, 1.0, reason)


def _px4_axis_shares(params: CheckedParameters, indices: Collection[int]) -> dict[int, Any]:
    """The shares (3,) of the torque commands in each surface: the rows of the pseudo-inverse of the torques
    of all surfaces [PX4, ControlAllocationPseudoInverse]. None for every surface if a torque is unknown.
    """
    try:
        torques = [
            [params.number(f"CA_SV_CS{i}_TRQ_{axis}", -_MAX_TORQUE, _MAX_TORQUE) for axis in "RPY"]
            for i in indices
        ]
    except BadParameterError as problem:
        params.lines.append(f"the mix of torques stays out: {problem}")
        return dict.fromkeys(indices)
    shares = np.linalg.pinv(np.reshape(torques, (-1, 3)).T)
    return dict(zip(indices, np.where(np.abs(shares) < LEAST_WEIGHT, 0.0, shares), strict=True))


def _px4_pulses(params: CheckedParameters, drivers: Sequence[list[str]]) -> list[Outputs]:
    """The pulse of the first output of each surface, as one way to log all outputs; no way if a surface has
    no output, or if the outputs have different drivers.

    drivers: for each surface the parameters that give it an output, such as PWM_MAIN_FUNC3.
    """
    matches = [re.fullmatch(_OUTPUT_PATTERN, names[0]) for names in drivers if names]
    outputs = [(match[1], int(match[2])) for match in matches if match]
    if len(outputs) < len(drivers) or len({driver for driver, _ in outputs}) != 1:
        return []
    readings = []
    for driver, n in outputs:
        names = {part: f"{driver}_{part}{n}" for part in ("MIN", "MAX")}
        reading = pulse_reading(
            params, f"{driver}_MIN{n}, middle, _MAX", names, reverse=f"{driver}_REV", bit=n - 1
        )
        readings.append((f"actuator_outputs.output[{n - 1}]", reading))
    return [readings]
