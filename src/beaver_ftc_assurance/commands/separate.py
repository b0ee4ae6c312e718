"""`beaver-ftc separate`: what would tell the candidates left apart."""

from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli import Format, FormatOption, ScenarioArgument, answer
from beaver_ftc.commands import declare


@declare("separation.json", "flown")
def command(
    scenario: ScenarioArgument,
    rate_deg_s: Annotated[float, typer.Option(min=0.1, max=360)] = 20.0,
    out: Path = Path("runs"),
    format: FormatOption = Format.text,
) -> None:
    """Propose the smallest doublet that separates candidates.

    Flies the scenario to its end. For each two candidates left: which surfaces go how far, there and back,
    after what time they are told apart for certain, or why no doublet within travel, actuators, rates and
    angle of attack does it. With `fdi.probing` the doublets are flown, what is left is said, and
    flown/N/ has log and certificate of the flight with doublet N.

    Exit status 1 if one that was flown left both.

    rate_deg_s: Body rates stay below it, deg/s.
    out: Folder for separation.json.
    """
    from beaver_ftc.scenario import load_scenario
    from beaver_ftc_assurance import separation

    loaded = load_scenario(scenario)
    document = separation.separate(loaded, rate_deg_s)
    folder = str(separation.write(document, loaded, out))
    answer(format, document | {"folder": folder}, lambda: f"{separation.as_text(document)}\n{folder}")
    raise typer.Exit(0 if document["passed"] else 1)
