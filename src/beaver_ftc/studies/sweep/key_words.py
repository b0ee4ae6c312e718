"""A varied key of a sweep in words, with its unit, for the figures."""

import re

_UNITS = {
    "per_h": "1/h", "per_s": "1/s", "per_s2": "1/s2", "rad_s2": "rad/s2", "rad_s": "rad/s", "deg_s": "deg/s",
    "deg_h": "deg/h", "mps2": "m/s2", "mps": "m/s", "inhg_s": "inHg/s", "inhg": "inHg", "deg": "deg",
    "rad": "rad", "hz": "Hz", "rpm": "rpm", "pa": "Pa", "db": "dB", "m": "m", "s": "s",
}  # fmt: skip
"""The unit of a key, by the ending of its name or of its section."""
_ENDING = re.compile(rf"_({'|'.join(_UNITS)})(?=\.|$)")


def in_words(key: str) -> str:
    """A varied key in words: `fault 1: at (s)` of `faults[0].at_s`."""
    text = re.sub(r"faults\[(\d+)\]", lambda match: f"fault {int(match[1]) + 1}", key)
    unit = _ENDING.search(text)
    name = _ENDING.sub("", text).replace(".", ": ").replace("_", " ")
    return f"{name} ({_UNITS[unit[1]]})" if unit else name
