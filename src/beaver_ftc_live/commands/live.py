"""`beaver-ftc live`: fly a scenario in the browser, with a class if you like."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beaver_ftc.cli import ScenarioArgument, emit

if TYPE_CHECKING:
    from beaver_ftc.scenario import Scenario

GUESTS = 10  # on another address than the loopback
OTHERS = (
    "live: {} is no loopback: anyone who has a link and reaches this machine gets in, "
    "and anyone who can listen on the network reads flight and links (http).\n"
)


def command(
    scenario: ScenarioArgument = "fault-free",
    aircraft: Annotated[str | None, typer.Option(metavar="AIRCRAFT")] = None,
    port: Annotated[int, typer.Option(min=0, max=65535)] = 0,
    host: Annotated[str, typer.Option(metavar="ADDRESS")] = "127.0.0.1",
    guests: Annotated[int | None, typer.Option(min=0, max=100)] = None,
    out: Path = Path("runs"),
    open_browser: Annotated[bool, typer.Option("--open")] = False,
) -> None:
    """Fly in the browser: inject faults and watch the diagnosis.

    The command prints the address of a page on this machine. The address works once. Ctrl-C ends the flight.

    Examples:
      beaver-ftc live rudder-stuck
      beaver-ftc live --host 0.0.0.0 --guests 30

    aircraft: Fly this aircraft instead of the scenario's, without `uncertainty`.
    port: Port of the page. 0 selects any free port.
    host: Network address of the page. With 0.0.0.0 other machines can open it.
    guests: Number of links for guests, who can inject faults if you allow it. Default: 10 if other
    machines can open the page, otherwise 0.
    out: Folder for the results.
    open_browser: Also open the page in a browser.
    """
    from beaver_ftc_live.page.serve import Place, is_loopback, serve

    others = not is_loopback(host)
    place = Place(port, host, (GUESTS if others else 0) if guests is None else guests)

    def say(address: str, links: list[str]) -> None:
        _point_to(address, links, OTHERS.format(host) if others else "")
        if open_browser:
            import webbrowser

            webbrowser.open(address)

    serve(lambda: _with(aircraft, scenario), out, place, say)


def _with(aircraft: str | None, name: str) -> "Scenario":
    from beaver_ftc.scenario import load_scenario

    loaded = load_scenario(name)
    if aircraft is None or aircraft == loaded.aircraft:
        return loaded
    return loaded.with_({"aircraft": aircraft, "uncertainty": {}})  # it is of the aircraft that was meant


def _point_to(address: str, links: list[str], others: str) -> None:
    guests = "".join(f"guest {number}: {link}\n" for number, link in enumerate(links, 1))
    yours = "Open the first in a browser, give a guest one of the others" if links else "Open it in a browser"
    emit(f"live: {address}\n{guests}{others}{yours}; Ctrl-C ends the flight.")
