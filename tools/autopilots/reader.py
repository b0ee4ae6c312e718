"""An answer read as ArduPilot reads it: by the first occurrence of a key as text, and what stands behind it.

No JSON is parsed: `strstr` for the section, `strstr` for the key behind it, two characters on (the quote and
the colon) a number or `[a,b,c]`. reader.c is the same in C, with the C library's own functions.
"""

import re

# Section ("" the whole), key, how many numbers, whether it must be there.
KEYS = (
    ("", "timestamp", 1, True),
    ("imu", "gyro", 3, True),
    ("imu", "accel_body", 3, True),
    ("", "position", 3, True),
    ("", "attitude", 3, False),
    ("", "quaternion", 4, False),
    ("", "velocity", 3, True),
    *(("", f"rng_{i}", 1, False) for i in range(1, 7)),
    ("windvane", "direction", 1, False),
    ("windvane", "speed", 1, False),
    ("", "airspeed", 1, False),
    ("", "no_time_sync", 1, False),
    ("battery", "voltage", 1, False),
    ("rc", "rc_1", 1, False),
    ("", "velocity_wind", 3, False),
)
_NUMBER = rb"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
_VECTORS = {n: re.compile(rb"\[" + rb",".join([_NUMBER] * n) + rb"\]") for n in (3, 4)}
_SCALAR = re.compile(_NUMBER)


class Unreadable(Exception):
    """What ArduPilot would stop at."""


def line_of(received: bytes) -> bytes:
    """What stands between the last two newlines of what has been received."""
    end = received.rfind(b"\n")
    start = received.rfind(b"\n", 0, end)
    if end <= 0 or start < 0:
        raise Unreadable("no line between two newlines")
    return received[start + 1 : end]


def read(received: bytes) -> dict[str, tuple[float, ...]]:
    """The numbers of every key found, by `section/key`. Raises Unreadable."""
    line = line_of(received)
    found: dict[str, tuple[float, ...]] = {}
    for section, key, count, required in KEYS:
        at = line.find(section.encode())
        at = at if at < 0 else line.find(key.encode(), at + len(section) + 1 if section else 1)
        if at < 0:
            if required:
                raise Unreadable(f"{section}/{key} is missing")
            continue
        pattern = _SCALAR if count == 1 else _VECTORS[count]
        match = pattern.match(line, at + len(key) + 2)
        if match is None:
            raise Unreadable(f"{section}/{key}: {line[at : at + 60]!r}")
        found[f"{section}/{key}".lstrip("/")] = tuple(map(float, match.groups()))
    if "attitude" not in found and "quaternion" not in found:
        raise Unreadable("neither attitude nor quaternion")
    return found
