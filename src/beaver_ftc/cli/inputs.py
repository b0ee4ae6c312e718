"""What a command is given: scenarios by file or name, all of them checked before the first one flies."""

from typing import TYPE_CHECKING

from beaver_ftc.errors import BadInput

if TYPE_CHECKING:
    from beaver_ftc.plant.adapter import Plant
    from beaver_ftc.plant.trim import TrimPoint
    from beaver_ftc.scenario.schema import Scenario


def load_all(names: list[str]) -> list["Scenario"]:
    """The scenarios of these files or built-in names. Raises BadInput with every mistake in all of them."""
    from beaver_ftc.scenario.loader import load_scenario

    loaded: list[Scenario] = []
    mistakes: list[str] = []
    for name in names:
        try:
            loaded.append(load_scenario(name))
            check_flyable(loaded[-1], name)
        except BadInput as error:
            mistakes.append(str(error))
    mistakes += _repeated([scenario.name for scenario in loaded])
    if mistakes:
        raise BadInput("\n".join(mistakes))
    return loaded


def check_flyable(scenario: "Scenario", name: str) -> None:
    """Raise BadInput, in the form of any other mistake in a file, if the flight cannot be trimmed."""
    from beaver_ftc.plant.configure import trim_of

    plant = _configured(scenario)
    try:
        trim_of(scenario, plant)
    except BadInput as error:
        raise BadInput(f"{_place_of_initial(name)}: initial: {error}") from None


def trim_point(scenario: "Scenario") -> "TrimPoint":
    """The steady flight a scenario starts from; BadInput if there is none."""
    from beaver_ftc.plant.configure import trim_of

    return trim_of(scenario, _configured(scenario))


def _configured(scenario: "Scenario") -> "Plant":
    from beaver_ftc.plant.adapter import Plant
    from beaver_ftc.plant.configure import configure

    plant = Plant(scenario.rate_hz, scenario.substeps)
    configure(plant, scenario)
    return plant


def _repeated(names: list[str]) -> list[str]:
    twice = dict.fromkeys(name for name in names if names.count(name) > 1)
    return [f"two scenarios are named {name}: one result would replace the other" for name in twice]


def _place_of_initial(name: str) -> str:
    """FILE:LINE of the flight condition, the file's first line where it is left to the defaults."""
    from beaver_ftc.scenario.builtin import resolve
    from beaver_ftc.scenario.loader import parse_document, read_file

    path = resolve(name)
    return f"{path}:{parse_document(read_file(path, name), str(path)).line(('initial',))}"
