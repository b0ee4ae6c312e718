"""Which columns of a log are measured quantities (rates, angles, airspeed, time), by their names.

Names are compared in *plain form*, i.e. in lower case with underscores (`plain_form`). The names of commands
are in `known_commands`.
"""

import re
from collections.abc import Iterable, Sequence

from beaver_ftc_logs.known_commands import is_command_name


def _rate_pattern(rate_name: str, angle: str, axis: str, vector_index: int) -> str:
    """Pattern of the names of a body rate, in plain form.

    rate_name: p, q or r; angle: roll, pitch or yaw; axis: x, y or z; vector_index: 0, 1 or 2.
    """
    return "|".join((
        rf"(.*_)?{rate_name}_(rad|deg)_?s(ec)?", rate_name, rf"(.*\.)?{angle}_?(rate|speed)\w*",
        rf".*gyr(o|_)?_?{axis}\w*", rf".*gyro_?(rad|adc)\[{vector_index}\](_deg_s)?",
        rf"(.*[._])?ang(ular)?_?vel(ocity)?_?({axis}|{rate_name})(_\w+)?", f"w{axis}",
        f"omega_?{axis}", rf"rate\.{angle[0]}",
        rf".*velocity\.({axis}|xyz\[{vector_index}\])",
    ))  # fmt: skip


# Quantity -> pattern of the names of its column, in plain form.
NAME_PATTERNS = {
    "p": _rate_pattern("p", "roll", "x", 0),
    "q": _rate_pattern("q", "pitch", "y", 1),
    "r": _rate_pattern("r", "yaw", "z", 2),
    "roll": r"(.*\.)?(roll|phi|bank)(_?(rad|deg|angle))?(_\w+)?",
    "pitch": r"(.*\.)?(pitch|theta)(_?(rad|deg|angle))?(_\w+)?",
    "az": r"(.*[._])?(az|acc_?z|accel_?z|acc_?down|linear_acceleration\.z|accelerometer_m_s2\[2\])(_\w+)?",
    "airspeed": r"(.*\.)?(true_)?(airspeed|[kect]?[tice]as)(_\w+)?",
    "time": r"(real|totl|total|sim|simulation|utc|gps|log|date|sys|system)_?time|date|datetime|clock|utc|"
    r"%?t(ime)?(_?(s|ms|us|ns|usec|stamp|boot))?\w*|(milli|micro|nano)?s(ec(ond)?s?)?|millis|micros",
}
# A column with one of these in its name is a setpoint, an error, a flag or the like, and not the quantity.
_DERIVED_NAME = (
    r"innov|test_ratio|varian|timestamp|flag|valid|status|count|setpoint|_sp$|desired|demand|target|bias|"
    r"integ|error|_err$|_offset|cov(ariance)?\b|temp|noise|(_|^)(cmd|command)"
)
# A column with one of these in its name is a rate or an acceleration of an angle, and not the angle.
_ANGLE_RATE_NAME = r"rate|speed|accel|veloc|dot|_(deg|rad)_?s(ec)?$"


def find_quantities(names: list[str]) -> dict[str, str]:
    """Quantity -> the column that looks like it."""
    angles = [name for name in names if not re.search(_ANGLE_RATE_NAME, plain_form(name))]
    return {
        quantity: name
        for quantity, pattern in NAME_PATTERNS.items()
        if (name := _shortest_match(pattern, angles if quantity in ("roll", "pitch") else names))
    }


def likely_columns(names: Iterable[str]) -> list[str]:
    """The columns that may be quantities or commands."""
    pattern = "|".join(f"({part})" for part in NAME_PATTERNS.values())
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
