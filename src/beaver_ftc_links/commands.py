"""`beaver-ftc sitl`: fly a scenario under ArduPilot or PX4."""

import sys
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli import (
    Format,
    FormatOption,
    JunitOption,
    NoReportOption,
    ResultsOption,
    ScenarioArgument,
    address,
    answer,
    complain,
    load_all,
    write_junit,
)
from beaver_ftc.documents import BadInput
from beaver_ftc_links.sitl import Protocol


@dataclass(frozen=True)
class Options:
    """The argument and the options of the command; `command` describes each."""

    scenario: ScenarioArgument
    protocol: Annotated[Protocol, typer.Option("--as")]
    host: str = "127.0.0.1"
    port: Annotated[int | None, typer.Option(min=0, max=65535)] = None
    rate: Annotated[float | None, typer.Option(metavar="HZ")] = None
    speed: Annotated[float | None, typer.Option(min=0, max=1000)] = None
    hold: Annotated[float, typer.Option(min=0, metavar="S")] = 0.0
    ground: Annotated[float | None, typer.Option(metavar="M")] = None
    mavlink: Annotated[str | None, typer.Option(metavar="HOST:PORT")] = None
    page: Annotated[int | None, typer.Option(min=0, max=65535, metavar="PORT")] = None
    out: ResultsOption = Path("runs")
    format: FormatOption = Format.text
    no_report: NoReportOption = False
    junit: JunitOption = None


def command(options: Options) -> None:
    """Fly a scenario under a software-in-the-loop autopilot.

    The autopilot commands the surfaces through the `channels` of the aircraft. The faults of the scenario act
    on the surfaces, and the diagnosis of the scenario runs. The flight ends after the scenario's duration, or
    with Ctrl-C.

    Examples:
      beaver-ftc sitl elevator-partial-loss --as ardupilot
      beaver-ftc sitl elevator-partial-loss --as px4 --mavlink 127.0.0.1:14550

    protocol: Interface of the autopilot: the JSON interface of ArduPilot, or the simulator interface of PX4.
    host: Address to listen on.
    port: Port for the autopilot. 0 selects any free port. Default: 9002 for ardupilot, 4560 for px4.
    rate: Frame rate of the autopilot, Hz. Default: the rate in the first packet of ardupilot, 250 for px4.
    speed: Multiple of real time. 0 is as fast as the autopilot answers. Default: 0 for ardupilot, 1 for
    px4.
    hold: Time at the start in which the law `nominal` flies, s.
    ground: Elevation of the ground above sea level for the autopilot, m. Default: 0.
    mavlink: Address of a ground station, which receives the results and can inject failures.
    page: Port of a live page that shows the flight and can inject faults. 0 selects any free port. Default:
    no page.
    """
    from beaver_ftc.results import Metrics, verdict_text
    from beaver_ftc_links.sitl.serve import Options as Served
    from beaver_ftc_links.sitl.serve import serve

    for name, value in (("--hold", options.hold), ("--ground", options.ground)):
        if value is not None and not isfinite(value):
            raise BadInput(f"{name} {value}: allowed: a finite number")
    (scenario,) = load_all([options.scenario])
    for warning in scenario.warnings():
        complain(f"{scenario.name}: warning: {warning}")
    ground = None if options.mavlink is None else address("--mavlink", options.mavlink)
    served = Served(
        options.protocol, options.host, options.port, options.rate, options.speed, options.hold,
        options.ground, ground, options.page,
    )  # fmt: skip
    flight = serve(scenario, served, lambda line: complain(f"{scenario.name}: {line}"))
    folder = flight.save(options.out, report=not options.no_report)
    found = Metrics.of(flight.metrics)
    document = flight.metrics | {"folder": str(folder)}
    answer(options.format, document, lambda: verdict_text(found, str(folder), sys.stdout.isatty()))
    write_junit([found.judged], options.junit)
    raise typer.Exit(0 if found.passed else 1)
