"""`beaver-ftc separate`: propose doublets that distinguish the remaining candidates."""

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
    """Propose a doublet that separates candidates.

    The command flies the scenario to its end. For each pair of remaining candidates it prints a doublet that
    is certain to distinguish the two, and the time that this takes. The doublet stays within the limits of
    travel, actuators, body rates and angle of attack. The command tries a few times up to 0.5 s. At the
    shortest time that has a doublet, it takes the smallest amplitude. If no time has one, it prints the
    reason. If the scenario contains `fdi.probing`, the command also flies the doublets and reports the
    remaining candidates. The folder flown/N/ then contains log and certificate of the flight with doublet N.

    The exit status is 1 if a doublet was flown and both candidates remain.

    Examples:
      beaver-ftc separate flap-stuck

    rate_deg_s: Largest allowed body rate, deg/s.
    out: Folder for the results.
    """
    from beaver_ftc.scenario import load_scenario
    from beaver_ftc_assurance import separation

    loaded = load_scenario(scenario)
    document = separation.separate(loaded, rate_deg_s)
    folder = str(separation.write(document, loaded, out))
    answer(format, document | {"folder": folder}, lambda: f"{separation.as_text(document)}\n{folder}")
    raise typer.Exit(0 if document["passed"] else 1)
