"""What a scenario may name: schemes and laws with their options, presets."""

from collections.abc import Iterator, Mapping
from typing import Any

from beaver_ftc.plugins import DETECTORS, LAWS, options_of, registered
from beaver_ftc.scenario import actuators, sensors
from beaver_ftc.studies.present.tables import markdown_table
from tools.docs.reference.value import in_a_line


def options_and_presets() -> Iterator[str]:
    """What a scenario may name: schemes and laws with their options, presets."""
    for group, what, where in ((DETECTORS, "scheme", "fdi"), (LAWS, "law", "control")):
        yield f"## {what.capitalize()}s, and their `{where}.options`"
        entries = [entry for entry in registered(group).values() if entry.package == "beaver-ftc"]
        yield markdown_table((what, "meaning"), [(f"`{one.name}`", one.description()) for one in entries])
        rows = [
            (f"`{one.name}`", f"`{name}`", of["says"], _option_range(of), f"`{of['default']:g}`")
            for one in entries
            for name, of in options_of(group, one.name).items()
        ]
        yield markdown_table((what, "option", "meaning", "value", "default"), rows)
    for what, presets in (("sensors", sensors.PRESETS), ("actuators", actuators.PRESETS)):
        yield f"## Presets of `{what}`"
        rows = [(f"`{name}`", *each) for name, of in presets.items() for each in _preset(of)]
        yield markdown_table(("preset", what, "values"), rows)


def _option_range(of: Mapping[str, Any]) -> str:
    kind = "whole number, " if of.get("whole") else ""
    return f"{kind}{of.get('low', 0):g} to {of['high']:g}"


def _preset(of: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """(instruments or surfaces, their values) of a preset."""
    if not all(isinstance(values, Mapping) for values in of.values()):
        of = {"all": of}
    alike: dict[str, list[str]] = {}
    for name, values in of.items():
        alike.setdefault(f"`{in_a_line(values)}`", []).append(f"`{name}`")
    yield from (
        ((", ".join(names), text) for text, names in alike.items()) if alike else (("all", "no error"),)
    )
