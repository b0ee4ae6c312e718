"""Which logs are of vehicles that rotors move: multicopters, and VTOL aircraft that hover throughout."""

import re
from collections.abc import Collection

from beaver_ftc_logs.known_commands import is_command_name, is_vtol
from beaver_ftc_logs.recording import Columns, Parameters, last_value

# MAV_TYPE of vehicles that rotors alone move [MAVLink, common.xml: MAV_TYPE].
_PX4_ROTARY_WINGS = {2: "quadrotor", 3: "coaxial helicopter", 4: "helicopter", 13: "hexarotor",
                          14: "octorotor", 15: "tricopter", 29: "dodecarotor"}  # fmt: skip
# SYS_AUTOSTART of multicopters [PX4, airframes reference].
_PX4_COPTERS = range(4000, 13000)
# Parameters that ArduCopter has in some release, and one that ArduPlane has and ArduCopter has not.
_COPTER_PARAMETERS = ("MOT_SPIN_ARM", "MOT_SPIN_ARMED", "MOT_SPIN_MIN", "MOT_THST_EXPO")
_PLANE_PARAMETER = "Q_ENABLE"
VTOL_MODE = "vehicle_status.vehicle_type"
_ON_ITS_WING = 2.0  # value of VTOL_MODE
_MIN_ROTORS = 3  # number of columns of motors that show a multicopter, if no column is a command of a surface


def multicopter_reason(params: Parameters, names: Collection[str]) -> str | None:
    """The parameter or the columns by which rotors alone move the vehicle; None if there are none."""
    mav_type = last_value(params, "MAV_TYPE")
    if mav_type in _PX4_ROTARY_WINGS:
        return f"MAV_TYPE {mav_type:g}, {_PX4_ROTARY_WINGS[int(mav_type)]}"
    if last_value(params, "CA_AIRFRAME") == 0:
        return "CA_AIRFRAME 0, multirotor"
    start = last_value(params, "SYS_AUTOSTART")
    if mav_type is None and start in _PX4_COPTERS:
        return f"SYS_AUTOSTART {start:g}, multicopter"
    copter = next((name for name in _COPTER_PARAMETERS if name in params), None)
    if copter is not None and _PLANE_PARAMETER not in params:
        return f"the parameter {copter} of ArduCopter"
    stripped = [re.sub(r"\s*\(.*\)$", "", name.strip()).lower() for name in names]
    rotors = [name for name in stripped if re.fullmatch(r"e?motor\[?_?\d\]?", name)]
    if len(set(rotors)) >= _MIN_ROTORS and not any(map(is_command_name, names)):
        return f"{rotors[0]} to {rotors[-1]}, and no output of a servo"
    return None


def hovers_throughout(params: Parameters, columns: Columns) -> bool:
    """Whether the log is of a VTOL that never flies on its wing [PX4, vehicle_status.msg: vehicle_type 2]."""
    return VTOL_MODE in columns and is_vtol(params) and _ON_ITS_WING not in columns[VTOL_MODE].values
