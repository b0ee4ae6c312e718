"""The surfaces of an ArduPilot log, by its parameters.

Output n has SERVOn_FUNCTION, _MIN, _MAX, _TRIM and _REVERSED. The mixers of elevons and V-tails have
MIXING_GAIN and MIXING_OFFSET.
"""

import re
from collections.abc import Collection, Mapping

import numpy as np

from beaver_ftc_logs.mixing_parts import (
    PULSE_RANGE_US,
    Axes,
    BadParameterError,
    CheckedParameters,
    MixingParts,
    Surface,
    full_name,
    pulse_reading,
)
from beaver_ftc_logs.recording import Floats

# SERVOn_FUNCTION of a surface -> its name; its shares of aileron, elevator and rudder, None if the mixer of
# the autopilot is not linear; whether MIXING_GAIN and MIXING_OFFSET change the shares.
_SURFACES: Mapping[int, tuple[str, tuple[float, float, float] | None, bool]] = {
    4: ("aileron", (1.0, 0.0, 0.0), False),
    16: ("left_spoiler_outer", None, False),
    17: ("right_spoiler_outer", None, False),
    19: ("elevator", (0.0, 1.0, 0.0), False),
    21: ("rudder", (0.0, 0.0, 1.0), False),
    24: ("left_flaperon", (1.0, 0.0, 0.0), False),
    25: ("right_flaperon", (1.0, 0.0, 0.0), False),
    77: ("left_elevon", (-1.0, 1.0, 0.0), True),
    78: ("right_elevon", (1.0, 1.0, 0.0), True),
    79: ("left_vtail", (0.0, 1.0, 1.0), True),
    80: ("right_vtail", (0.0, 1.0, -1.0), True),
    86: ("left_spoiler_inner", None, False),
    87: ("right_spoiler_inner", None, False),
}
# The commands of aileron, elevator and rudder, from -4500 to 4500.
_AXIS_COLUMNS = ("AETR.Ail", "AETR.Elev", "AETR.Rudd")
_FULL_COMMAND = 4500.0
# Largest number of an output -> message with the pulses of the outputs up to this number.
_MESSAGES = {14: "RCOU", 18: "RCO2", 32: "RCO3"}
# Allowed values of MIXING_GAIN, and largest magnitude of MIXING_OFFSET, %.
_MIN_MIXING_GAIN = 0.05
_MAX_MIXING_GAIN = 5.0
_MAX_MIXING_OFFSET = 1000.0


def ardupilot_mixing(params: CheckedParameters) -> MixingParts:
    """The surfaces by SERVOn_FUNCTION, the pulse of the output of each, and the commands of the axes. The
    lines of params receive a remark on each part that is left out.
    """
    matches = (re.fullmatch(r"SERVO(\d{1,2})_FUNCTION", name) for name in params.values_by_name)
    names = {int(match[1]): match[0] for match in matches if match}
    if not names:
        params.lines.append("SERVOn_FUNCTION is not in the log")
    kinds = params.kinds(
        "channel", dict(sorted(names.items())), _SURFACES, unknown_text="is no surface", unused=(-1, 0)
    )
    factors, mixer_reason = _ardupilot_mixers(params, kinds.values())
    surfaces = []
    outputs = []
    for channel, kind in kinds.items():
        name, shares, is_mixed = _SURFACES[kind]
        mixer_factors = factors if is_mixed else 1.0
        axis_shares = None if shares is None or mixer_factors is None else np.array(shares) * mixer_factors
        full = full_name(name, channel, kinds)
        reason = f"SERVO{channel}_FUNCTION {kind}"
        mixer = mixer_reason if is_mixed else ""
        surfaces.append(Surface(full, f"channel {channel}", kind, axis_shares, reason, mixer))
        message = next((text for last, text in _MESSAGES.items() if channel <= last), "RCO?")
        pulses = {part: f"SERVO{channel}_{part}" for part in PULSE_RANGE_US}
        reading = pulse_reading(
            params, f"SERVO{channel}_MIN, _TRIM, _MAX", pulses, reverse=f"SERVO{channel}_REVERSED"
        )
        outputs.append((f"{message}.C{channel}", reading))
    return surfaces, [outputs], Axes(_AXIS_COLUMNS, 1.0 / _FULL_COMMAND)


def _ardupilot_mixers(params: CheckedParameters, kinds: Collection[int]) -> tuple[Floats | None, str]:
    """The factors (3,) of the mixers on aileron, elevator and rudder, and a text with the parameters
    [ArduPlane, servos.cpp: channel_function_mixer]:

        gain (1 + max(offset, 0) / 100, 1 - min(offset, 0) / 100, 1 + max(offset, 0) / 100)

    gain: MIXING_GAIN; offset: MIXING_OFFSET, %. None and no text if they are unknown, or if no kind has a
    mixer.
    """
    if not any(_SURFACES[kind][2] for kind in kinds):
        return None, ""
    try:
        gain = params.number("MIXING_GAIN", _MIN_MIXING_GAIN, _MAX_MIXING_GAIN)
        offset = params.number("MIXING_OFFSET", -_MAX_MIXING_OFFSET, _MAX_MIXING_OFFSET)
    except BadParameterError as problem:
        params.lines.append(f"the mixer of elevons and V-tail stays out: {problem}")
        return None, ""
    turning = 1.0 + max(offset, 0.0) / 100.0
    pitching = 1.0 - min(offset, 0.0) / 100.0
    factors = gain * np.array([turning, pitching, turning])
    return factors, f", MIXING_GAIN {gain:g}, MIXING_OFFSET {offset:g}"
