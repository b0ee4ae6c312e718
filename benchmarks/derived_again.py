"""The table written by hand and the one derived from the same model: every built-in scenario, judged by both.

    python benchmarks/derived_again.py [SCENARIO ...]

The built-in aircraft is derived into a temporary folder. A line a scenario: when it was detected, what was
named, what is left possible, where it departed; twice where the two differ. Exit status 1 if any does.
"""

import sys
import tempfile
from pathlib import Path
from typing import Any

from beaver_ftc.aircraft.aircraft import DEFAULT
from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.builtin import builtin_names, resolve
from beaver_ftc.scenario.schema import load_text
from beaver_ftc_aircraft.derive.derivation import derive
from beaver_ftc_aircraft.derive.derived import differences


def verdict(aircraft: str, scenario: str, folder: Path) -> tuple[Any, ...]:
    """What the diagnosis says of a built-in scenario flown with an aircraft."""
    text = resolve(scenario).read_text(encoding="utf-8")
    flight = fly(load_text(f"aircraft: {aircraft}\n{text}", folder=folder))
    at_s = flight.detection_time_s
    named = flight.isolated, flight.isolation_type
    return at_s and round(at_s, 2), *named, flight.candidates, flight.departure and flight.departure[1]


def main() -> int:
    """Derive, fly, print."""
    differing = 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        made = derive(DEFAULT, folder)
        assert made.as_filed is not None
        terms = differences(made.as_filed, made.aircraft)
        worst = max(terms, key=lambda of: abs(of["found"] / of["own"] - 1.0))
        share = abs(worst["found"] / worst["own"] - 1.0)
        print(f"{len(terms)} coefficients, the furthest off {worst['term']}: {share:.1e} of its value")
        scenarios = sys.argv[1:] or builtin_names()
        for name in scenarios:
            by_hand, derived = (verdict(of, name, folder) for of in (DEFAULT, f"./{DEFAULT}"))
            differing += by_hand != derived
            print(f"{name}: {by_hand}" + (f" by hand, {derived} derived" if by_hand != derived else ""))
    print(f"{len(scenarios)} scenarios, {differing} judged differently")
    return int(differing > 0)


if __name__ == "__main__":
    sys.exit(main())
