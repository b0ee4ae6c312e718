"""The gallery of built-in scenarios: a thumbnail of each, its outcome and its description."""

import hashlib
import re
from collections.abc import Iterator

import numpy as np
import pandas as pd

import beaver_ftc as bf
from beaver_ftc.results.flight import Flight
from beaver_ftc.results.style import BLACK, GREY, LOOKS, VERMILION
from beaver_ftc.studies.present.tables import markdown_table
from tools.docs.tables import picture

_WIDTH, _HEIGHT = 260, 150  # of a thumbnail, px
_LEFT, _RIGHT = 30, 254  # x of the panels: from, to
_UPPER, _LOWER = (18, 62), (84, 128)  # y of the two panels: from, to
_SENSORS = {"p": "roll gyro", "V": "airspeed sensor", "alpha": "angle-of-attack vane"}  # of the gallery
_BINS = 110  # points of a curve: two pixels each
_HIGHEST = 2.0  # residual over threshold that is drawn
_GROUPS = {  # heading: what the names begin with
    "Elevator": ("elevator",),
    "Aileron": ("aileron",),
    "Rudder": ("rudder",),
    "Flap": ("flap",),
    "Sensors": ("sensor",),
    "Missions under the autopilot": ("mission",),
    "No fault, and faults outside the class": ("",),
}


def gallery() -> str:
    """Every built-in scenario, flown now."""
    return "\n\n".join(_sections())


def gallery_probe() -> str:
    """What the gallery is made of: changes with a scenario, not with the code that flies it."""
    scenarios = (bf.load(name).model_dump_json() for name in bf.scenarios())
    return hashlib.sha256("".join(scenarios).encode()).hexdigest()[:12]


def _sections() -> Iterator[str]:
    left = list(bf.scenarios())
    for number, (heading, beginnings) in enumerate(_GROUPS.items(), 1):
        names = [name for name in left if name.startswith(beginnings)]
        left = [name for name in left if name not in names]
        rows = [_row(name) for name in names]
        caption = f"*Table {number}. {heading}.*"
        yield f"## {heading}\n\n{caption}\n\n{markdown_table(('flight', 'scenario', 'outcome'), rows)}"


def _row(name: str) -> tuple[str, str, str]:
    flight = bf.fly(name)
    description = re.split(r"(?<=[.!?]) (?=[A-Z])", " ".join(bf.load(name).description.split()))[0]
    shown = picture(f"gallery/{name}.svg", name, _thumbnail(flight).encode())
    return shown, f"`{name}`<br>{description}", _outcome(flight)


def _outcome(flight: Flight) -> str:
    """What the diagnosis found in a flight."""
    detection, isolation = flight.detection, flight.isolation
    if not flight.fault:
        return "no alarm" if not detection.detected else f"alarm at {detection.time_s:.2f} s"
    if not detection.detected:
        return "not detected"
    found = f"detected after {detection.delay_s:.2f} s" if detection.delay_s is not None else "false alarm"
    fault = isolation.fault or ""
    named = f"named {_SENSORS.get(fault.removeprefix('sensor '), fault)}" if fault else "not named"
    return f"{found}, {named}" + (", aircraft lost" if flight.departure else "")


def _thumbnail(flight: Flight) -> str:
    """Deflection of the broken surface, and below it the largest residual over its threshold."""
    log = flight.log
    surface = _surface(log, flight)
    aircraft = bf.aircraft(flight.scenario.aircraft)
    look = LOOKS[f"surface {list(aircraft.surfaces).index(surface)}"]
    deflection = np.degrees(_binned(log[f"{surface}_effective_rad"].to_numpy(), np.mean))
    share = np.clip(_binned(_share(log), np.max), 0.0, _HIGHEST)
    middle = (_LOWER[0] + _LOWER[1]) / 2  # of the lower panel: its threshold
    parts = [
        *_axes(f"{surface.replace('_', ' ')}, deg", _UPPER, _span(deflection), look.colour),
        *_axes("largest residual / threshold, cut at 2", _LOWER, (0.0, _HIGHEST), "#333333"),
        _text(_LEFT - 4, middle + 3, "1", "end"),
        _line(_scaled(deflection, _UPPER, _span(deflection)), look.colour),
        _line(np.full(2, middle), GREY, ' stroke-dasharray="4 3"'),
        _line(_scaled(share, _LOWER, (0.0, _HIGHEST)), "#333333"),
        *(_upright(at, log, VERMILION, _UPPER[0]) for at in _faults(flight)),
        *([_upright(flight.detection.time_s, log, BLACK, _LOWER[0])] if flight.detection.detected else []),
        _text(_LEFT, _HEIGHT - 8, "0", "middle"),
        _text(_RIGHT, _HEIGHT - 8, f"{float(log['t_s'].iloc[-1]):.0f} s", "end"),
    ]
    size = f'width="{_WIDTH}" height="{_HEIGHT}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} fill="none" stroke-width="1.2">'
        f"<title>{surface} deflection above, residual over threshold below</title>"
        f'<rect {size} fill="#fff" stroke="#ccc"/>{"".join(parts)}</svg>\n'
    )


def _share(log: pd.DataFrame) -> np.ndarray:
    """The largest residual over its threshold, of the axes, or of instruments that are compared."""
    shares = [log[f"{axis}_alarm_residual_rad_s"] / log[f"{axis}_alarm_threshold_rad_s"] for axis in "pqr"]
    shares += [log["watch_share"]] if "watch_share" in log else []
    return np.max(np.nan_to_num(np.abs(shares)), axis=0)


def _faults(flight: Flight) -> list[float]:
    return [fault.at_s for fault in flight.scenario.faults]


def _surface(log: pd.DataFrame, flight: Flight) -> str:
    broken = (getattr(fault, "actuator", None) for fault in flight.scenario.faults)
    return next((name for name in broken if f"{name}_effective_rad" in log), "elevator")


def _binned(values: np.ndarray, of) -> np.ndarray:
    return np.array([of(part) for part in np.array_split(np.nan_to_num(values), _BINS)])


def _span(values: np.ndarray) -> tuple[float, float]:
    """Whole degrees below and above all values."""
    low = float(np.floor(values.min()))
    return low, max(float(np.ceil(values.max())), low + 1.0) + 0.0  # no zero with a sign


def _axes(title: str, panel: tuple[int, int], span: tuple[float, float], colour: str) -> list[str]:
    """Frame, title and the two ends of the scale of a panel."""
    top, bottom = panel
    width, height = _RIGHT - _LEFT, bottom - top
    return [
        f'<rect x="{_LEFT}" y="{top}" width="{width}" height="{height}" stroke="#ddd" stroke-width="1"/>',
        _text(_LEFT, top - 5, title, "start", colour),
        *(_text(_LEFT - 4, y + 3, f"{end:g}", "end") for y, end in zip((bottom, top), span, strict=True)),
    ]


def _text(x: float, y: float, says: str, anchor: str, colour: str = "#444") -> str:
    look = f'font-family="Arial, sans-serif" font-size="9" stroke="none" fill="{colour}"'
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}" {look}>{says}</text>'


def _scaled(values: np.ndarray, panel: tuple[int, int], span: tuple[float, float]) -> np.ndarray:
    low, high = span
    top, bottom = panel
    return bottom - (bottom - top) * (values - low) / (high - low)


def _line(y: np.ndarray, colour: str, how: str = "") -> str:
    x = np.linspace(_LEFT, _RIGHT, len(y))
    points = " ".join(f"{a:.0f},{b:.1f}" for a, b in zip(x, y, strict=True))
    return f'<polyline points="{points}" stroke="{colour}"{how}/>'


def _upright(at_s: float, log: pd.DataFrame, colour: str, top: int) -> str:
    x = _LEFT + (_RIGHT - _LEFT) * at_s / float(log["t_s"].iloc[-1])
    return f'<path d="M{x:.1f} {top}V{_LOWER[1]}" stroke="{colour}"/>'
