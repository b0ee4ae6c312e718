"""`beaver-ftc live`: fly, break and repair in a page of the browser."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beaver_ftc.cli.inputs import ScenarioArgument
from beaver_ftc.cli.output import emit

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario


def command(
    scenario: ScenarioArgument = "fault-free",
    aircraft: Annotated[
        str | None, typer.Option(metavar="AIRCRAFT", help="Fly this one, without the scenario's uncertainty.")
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port on the loopback; 0: any.")] = 0,
    out: Annotated[Path, typer.Option(help="Folder in which the page's Save writes.")] = Path("runs"),
    open_browser: Annotated[bool, typer.Option("--open", help="Also open the page in a browser.")] = False,
) -> None:
    """Fly in the browser: break it and watch the diagnosis.

    Prints an address of this machine that works once; Ctrl-C ends it.
    """
    from beaver_ftc.integrations.live.serve import serve

    serve(lambda: _scenario(scenario, aircraft), out, port, lambda address: _say(address, open_browser))


def _scenario(name: str, aircraft: str | None) -> "Scenario":
    from beaver_ftc.scenario.loader import load_scenario

    loaded = load_scenario(name)
    if aircraft is None or aircraft == loaded.aircraft:
        return loaded
    return loaded.with_({"aircraft": aircraft, "uncertainty": {}})  # it is of the aircraft that was meant


def _say(address: str, open_browser: bool) -> None:
    emit(f"live: {address}\nOpen it in a browser; Ctrl-C ends the flight.")
    if open_browser:
        import webbrowser

        webbrowser.open(address)
