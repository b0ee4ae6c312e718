"""Write the actuators of the built-in aircraft from their one template.

python -m tools.actuators
"""

from pathlib import Path

from beaver_ftc.aircraft import builtin_names, load
from beaver_ftc.plant.instrumented import actuator_system


def files() -> dict[Path, str]:
    """Each system file of each built-in aircraft, and what should be in it."""
    return {
        aircraft.folder / "Systems" / f"{surface}.xml": actuator_system(
            surface, travel.min_rad, travel.max_rad
        )
        for aircraft in map(load, builtin_names())
        for surface, travel in aircraft.travel.items()
    }


def main() -> None:
    """Write them all."""
    for path, text in files().items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
