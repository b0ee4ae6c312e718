"""Which columns of a log carry the command of a surface, by the names of known messages and columns.

A word such as `actuator` or `cmd` in a name is not enough: flags, stamps, counters and mission items have
such names too. Another column is a command only if the vehicle file names it.
"""

import re
from collections.abc import Collection, Sequence

from beaver_ftc_logs.recording import Parameters, last_value

_SURFACE_WORD = (
    r"ailerons?|ail|ailrn|elevators?|elev|elv|rudders?|rud|rudd|elevons?|flaperons?|ruddervators?|v_?tail"
)
_SIDE_WORD = r"left|right|l|r|lh|rh|port|starboard|upper|lower|inner|outer|inboard|outboard|\d"
_PLAIN_WORD = r"cmd|cmds|command|commands|commanded"
_COMMAND_WORD = rf"{_PLAIN_WORD}|setpoint|sp|demand|servo|pwm"
_SHARE_UNIT = r"norm|pct|percent|%|1"
_UNIT = rf"(_({_SHARE_UNIT}|rad|deg|us))?"
_SURFACE = rf"(({_SIDE_WORD})_?)*({_SURFACE_WORD})(_?({_SIDE_WORD}))*"
_AXIS = r"(roll|pitch|yaw)"

# Patterns of the names of commands in plain tables: words in lower case with `_` between them; each with
# examples.
_PLAIN_COMMANDS = (
    rf"(delta_|d_)?{_SURFACE}(_({_COMMAND_WORD}))*{_UNIT}",  # elevator, left_aileron_command_norm
    rf"({_COMMAND_WORD})_{_SURFACE}{_UNIT}",  # cmd_elevon_left
    rf"({_AXIS}_?({_PLAIN_WORD})|({_PLAIN_WORD})_?{_AXIS})(_({_SHARE_UNIT}))?",  # roll_cmd, cmd_roll
    rf"servo_?\d+(_({_PLAIN_WORD}|pwm))?(_us)?",  # servo3
    r"d(elta)?_?[aer](_(cmd|rad|deg|norm))?",  # da
)

# Pattern of a whole name, in lower case, of a column with the command of a surface -> example for messages.
# Names in plain tables are compared word by word instead (`_is_plain_command_name`).
KNOWN_COMMANDS = {
    # PX4 message actuator_controls: control 0 to 2 of groups 0 and 1 are roll, pitch, yaw
    r"actuator_controls_[01]\.control\[[0-2]\]": "actuator_controls_0.control[0] (PX4)",
    # PX4 message vehicle_torque_setpoint: torque about the body axes
    r"vehicle_torque_setpoint(_\d)?\.xyz\[[0-2]\]": "vehicle_torque_setpoint.xyz[0] (PX4)",
    # PX4 message actuator_servos: output of the control allocation to each servo
    r"actuator_servos\.control\[[0-7]\]": "actuator_servos.control[0] (PX4)",
    # ArduPilot log message AETR: normalised control outputs before the mixers
    r"aetr\.(ail|elev|rudd)": "AETR.Ail (ArduPilot)",
    # JSBSim reference manual: properties of the flight control system
    rf"(.*/)?fcs/((left|right)-)?({_SURFACE_WORD})-cmd(-norm|-rad|-deg)?": "fcs/elevator-cmd-norm (JSBSim)",
    # X-Plane manual, data set 8: joystick aileron, elevator, rudder
    r"_*(elev|ailrn|ruddr),_*yoke1?": "elev,yoke1 (X-Plane)",
    # Betaflight and INAV blackbox fields: output to each servo
    r"servo\[\d\](_us)?": "servo[0] (blackbox)",
}


def is_command_name(column_name: str) -> bool:
    """Whether a column is known to carry the command of a surface."""
    name = re.sub(r"\s*[(]\s*us\s*[)]\s*$", "_us", column_name.strip().lower())
    return any(re.fullmatch(pattern, name) for pattern in KNOWN_COMMANDS) or _is_plain_command_name(name)


def _is_plain_command_name(name: str) -> bool:
    """Whether all words of a name in a plain table are words of a surface's command, as in `Left aileron
    command (norm)`. A name with another word, as `elevator_position`, or with a message before a dot, as
    `CMD.Lat`, is another quantity.
    """
    if "." in name or "/" in re.sub(r"[\[(].*", "", name):
        return False
    words = "_".join(re.findall(r"[a-z0-9%]+", name))
    return any(re.fullmatch(pattern, words) for pattern in _PLAIN_COMMANDS)


# MAV_TYPE of aircraft that take off vertically and fly on a wing [MAVLink, common.xml: MAV_TYPE].
_PX4_VTOL_TYPES = range(19, 26)


def is_vtol(params: Parameters) -> bool:
    """Whether a log of PX4 is of an aircraft that takes off vertically and flies on a wing."""
    return last_value(params, "MAV_TYPE") in _PX4_VTOL_TYPES


def command_names(names: Sequence[str], params: Parameters) -> list[str]:
    """The columns with commands of surfaces. Several messages have the commands of the same surfaces, so only
    the columns of the first message count. For a VTOL, messages that command the hover are left out.
    """
    commands = [name for name in names if is_command_name(name)]
    if is_vtol(params):
        hovering = r"(actuator_controls_0|vehicle_torque_setpoint)\."
        commands = [name for name in commands if not re.match(hovering, name)]
    message = next((name.partition(".")[0] for name in commands if "." in name), None)
    if message is None:
        return commands
    return [name for name in commands if name.partition(".")[0] == message]


_OUTPUT_PATTERN = r"RCO[2-4U]\.C|actuator_outputs(_\d)?\.output\[|SERVO_OUTPUT_RAW\."


def missing_commands_text(names: Collection[str]) -> str:
    """Text on a log without known commands: examples of known ones, and how a vehicle file names others."""
    examples = ", ".join(KNOWN_COMMANDS.values())
    outputs = [name for name in names if re.match(_OUTPUT_PATTERN, name)]
    outputs_text = ""
    if outputs:
        reason = "outputs to servos and to motors, and the log does not state which moves a surface"
        outputs_text = f"; {outputs[0]} and its like are {reason}"
    return (
        f"no column is known to carry the command of a surface{outputs_text}, allowed: {examples}, words "
        "such as elevator_cmd, or a vehicle file that names it: commands: [COLUMN], "
        "surfaces: {elevator: {COLUMN: 1}}"
    )
