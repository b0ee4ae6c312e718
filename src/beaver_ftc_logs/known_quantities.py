"""Which columns of a log are measured quantities or the time, by their names.

The quantities are the rates, the roll and pitch angles, the acceleration along z and the airspeed. Names are
compared in *plain form*, i.e. in lower case with underscores (`plain_form`). The names of commands are in
`known_commands`.
"""

import re
from collections.abc import Iterable, Sequence

from beaver_ftc_logs.known_commands import is_command_name


def _rate_pattern(rate_name: str, angle: str, axis: str, vector_index: int) -> str:
    """Pattern of the names of a body rate, in plain form; each part with an example.

    rate_name: p, q or r; angle: roll, pitch or yaw; axis: x, y or z; vector_index: 0, 1 or 2.
    """
    return "|".join((
        rate_name,  # p
        rf"(.*_)?{rate_name}_(rad|deg)_?s(ec)?",  # P (deg/s); ____P,rad/s (X-Plane)
        rf"(.*\.)?{angle}_?(rate|speed)\w*",  # roll rate [rad/s]; attitude.rollspeed
        rf".*gyr(o|_)?_?{axis}\w*",  # Gyro x [rad/s]; IMU.GyrX (ArduPilot)
        rf".*gyro_?(rad|adc)\[{vector_index}\](_deg_s)?",  # s.gyro_rad[0] (PX4); gyroADC[0] (blackbox)
        rf"(.*[._])?ang(ular)?_?vel(ocity)?_?({axis}|{rate_name})(_\w+)?",  # ang_vel_x
        f"w{axis}",  # wx
        f"omega_?{axis}",  # omega_x
        rf"rate\.{angle[0]}",  # RATE.R (ArduPilot)
        rf".*velocity\.({axis}|xyz\[{vector_index}\])",  # vehicle_angular_velocity.xyz[0] (PX4)
    ))  # fmt: skip


# Quantity -> pattern of the names of its column, in plain form; each with examples.
NAME_PATTERNS = {
    "p": _rate_pattern("p", "roll", "x", 0),
    "q": _rate_pattern("q", "pitch", "y", 1),
    "r": _rate_pattern("r", "yaw", "z", 2),
    # Phi (deg); _roll,__deg (X-Plane); ATT.Roll (ArduPilot)
    "roll": r"(.*\.)?(roll|phi|bank)(_?(rad|deg|angle))?(_\w+)?",
    "pitch": r"(.*\.)?(pitch|theta)(_?(rad|deg|angle))?(_\w+)?",
    # IMU.AccZ (ArduPilot); sensor_combined.accelerometer_m_s2[2] (PX4)
    "az": r"(.*[._])?(az|acc_?z|accel_?z|acc_?down|linear_acceleration\.z|accelerometer_m_s2\[2\])(_\w+)?",
    # airspeed.true_airspeed_m_s (PX4); TAS; KIAS
    "airspeed": r"(.*\.)?(true_)?(airspeed|[kect]?[tice]as)(_\w+)?",
}
# Pattern of the names of a column of time, in plain form; each part with an example.
TIME_PATTERN = (
    r"(real|totl|total|sim|simulation|utc|gps|log|date|sys|system)_?time|"  # _real,_time (X-Plane)
    r"date|datetime|clock|utc|"  # UTC
    r"%?time\w*|"  # Time [ms]; timestamp; time_boot_ms
    r"%?t(_?([mun]?s(ec)?|stamp))?|"  # t; t_s; t [ms]
    r"(milli|micro|nano)?s(ec(ond)?s?)?|millis|micros"  # Seconds
)
# A column with one of these in its name is a setpoint, an error, a flag or the like, and not the quantity.
_DERIVED_NAME = (
    r"innov|test_ratio|varian|timestamp|flag|valid|status|count|setpoint|_sp$|desired|demand|target|bias|"
    r"integ|error|_err$|_offset|cov(ariance)?\b|temp|noise|(_|^)(cmd|command)"
)
# A column with one of these in its name is a rate or an acceleration of an angle, and not the angle.
_ANGLE_RATE_NAME = r"rate|speed|accel|veloc|dot|_(deg|rad)_?s(ec)?$"


def find_quantities(names: list[str]) -> dict[str, str]:
    """Quantity -> the column that looks like it, for each quantity with such a column."""
    angles = [name for name in names if not re.search(_ANGLE_RATE_NAME, plain_form(name))]
    return {
        quantity: name
        for quantity, pattern in NAME_PATTERNS.items()
        if (name := _shortest_match(pattern, angles if quantity in ("roll", "pitch") else names))
    }


def likely_columns(names: Iterable[str]) -> list[str]:
    """The columns that may be the time, quantities or commands."""
    pattern = "|".join([TIME_PATTERN, *NAME_PATTERNS.values()])
    return [name for name in names if re.fullmatch(pattern, plain_form(name)) or is_command_name(name)]


def plain_form(name: str) -> str:
    """The name of a column in plain form: `Roll rate [deg/s]` is `roll_rate_deg_s`."""
    text = re.sub(r"\s*[\[(]\s*([^\d\])][^\])]*?)\s*[\])]\s*$", r"_\1", name.strip().lower())
    return re.sub(r"(?<=\w)_{2,}(?=\w)|[\s/,-]+_*", "_", text).strip("_")


def _shortest_match(pattern: str, names: Sequence[str]) -> str | None:
    """The shortest name that fits a pattern, the first in the alphabet of several; None if none fits."""
    matches = [
        name
        for name in names
        if re.fullmatch(pattern, plain_form(name)) and not re.search(_DERIVED_NAME, plain_form(name))
    ]
    return min(matches, key=lambda name: (len(name), name), default=None)
