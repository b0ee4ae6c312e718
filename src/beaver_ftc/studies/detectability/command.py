"""The command `detectability`: losses that are certain to be found, that most flights find, and that schemes
find."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.commands import (
    SCENARIO,
    AirspeedsOption,
    AltitudesOption,
    Reporter,
    SeedOption,
    StudyCommand,
    TurbulenceName,
    WorkersOption,
    listed,
)
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.schema import Scenario, load_scenario
from beaver_ftc.studies.detectability import (
    in_trim,
    places,
    places_shown,
    probabilities,
    schemes,
    schemes_shown,
    sizes_shown,
)
from beaver_ftc.studies.detectability.grid import GRIDS, Grid
from beaver_ftc.studies.detectability.schemes import Watched
from beaver_ftc.studies.detectability.shown import NAME
from beaver_ftc.studies.detectability.sizes import Request, sizes_study
from beaver_ftc.studies.engine.study import Study, run_into
from beaver_ftc.studies.present.page import as_text

GridName = StrEnum("GridName", ["quick", "full"])
SensorsName = StrEnum("SensorsName", {"ideal": "ideal", "tactical_grade": "tactical-grade"})


def schemes_study(grid: Grid, names: Sequence[str]) -> Study:
    """The study of these schemes in the flights of a grid."""
    names = tuple(names)
    healthy = grid.healthy()
    cases = [*((block, False) for block in healthy), *((block, True) for block in grid.faulted())]
    return Study(
        NAME, cases, partial(schemes.fly_block, grid=grid, schemes=names),
        lambda watched: probabilities.document_of(grid, watched[: len(healthy)], watched[len(healthy) :]),
        schemes_shown.FILES, row=Watched, follows_from=(grid, names), lost=schemes.lost,
    )  # fmt: skip


@dataclass(frozen=True)
class Detectability(StudyCommand):
    """Find how small a loss is detected, how often and how soon.

    The command has three methods. Each prints one table, and sentences that begin with the answer. If a
    method is interrupted, the same command resumes it.

    SCENARIO: compute from the declared bounds the smallest loss that is certain to be detected within 0.5 s
    and isolated within 1 s, at several airspeeds and altitudes, and with references scaled by factors from
    0.25 to 2. "Half of onsets": half of the possible start times of the loss. With --surface the command
    prints one sentence for each place. For each pair of surfaces it prints the smallest loss for which they
    are distinguished, the delay, and a doublet that distinguishes them.

    SCENARIO --surface --within: fly losses with random seeds and start times. The command prints the smallest
    loss that is certain to be detected within this time, and the smallest that is detected in 90 % of the
    flights, with its 95 % interval. It adds flights until the interval is narrow, up to 480. Then it repeats
    the flights with one change at a time, to find what makes these losses so large: without turbulence,
    without sensor errors, without servos, without model uncertainty, with references of twice the amplitude,
    and with references of twice the frequency.

    --grid: fly losses of several sizes and surfaces, with several references, sensors and severities of
    turbulence, and let all schemes diagnose the same flights. The alarm level of each scheme is chosen on
    healthy flights, so that all schemes have the same rate of false alarms.

    Examples:
      beaver-ftc detectability elevator-partial-loss --surface elevator --airspeed 45 --altitude 1000
      beaver-ftc detectability elevator-partial-loss --surface elevator --within 0.5
      beaver-ftc detectability --grid quick --sensors tactical-grade --turbulence none

    surface: Only losses of this surface.
    within: Longest time from the loss to the alarm, s.
    grid: Number of variations: `quick` takes about 1 min of processor time, `full` about 10 min.
    airspeed: Airspeed, m/s. Default: 36, 40, 44, 48 and 52 for the Beaver, otherwise 0.9, 1 and 1.1
    times the airspeed at the start. With --grid: at most one.
    altitude: Altitude above sea level, m. Default: the altitude at the start in the aircraft file,
    otherwise 0, 1000, 2000 and 3000. With --grid: at most one.
    aircraft: Aircraft instead of the scenario's: built-in name, jsbsim:NAME, or ./FOLDER.
    schemes: With --grid: names of schemes, separated by commas. Default: all registered schemes.
    sensors: With --grid: fly only these sensors. Default: all sensors of the grid.
    turbulence: With --grid: fly only this severity of turbulence. Default: all severities of the grid.
    seed: With --within: seed of all random draws.
    out: Folder for the results.
    """

    scenario: Annotated[str | None, SCENARIO] = None
    surface: str | None = None
    within: Annotated[float | None, typer.Option(min=0.01, max=60)] = None
    grid: GridName | None = None
    airspeed: AirspeedsOption = None
    altitude: AltitudesOption = None
    aircraft: str | None = None
    schemes: str | None = None
    sensors: SensorsName | None = None
    turbulence: TurbulenceName | None = None
    seed: SeedOption = 1
    workers: WorkersOption = None
    out: Path = Path("runs")

    FILES = tuple(places_shown.FILES)

    def run(self, reporter: Reporter) -> Document:
        """Run the chosen method."""
        self._refuse_contradictions()
        if self.grid is not None:
            return self._of_schemes(self.grid, reporter)
        scenario = load_scenario(str(self.scenario))
        if self.aircraft is not None:
            scenario = places.with_aircraft(scenario, self.aircraft)
        if self.within is not None:
            request = Request(str(self.surface), self.within, self.seed)
            return run_into(sizes_study(scenario, request, reporter.say), self.out, self.processes)
        return self._of_places(scenario, reporter)

    def _refuse_contradictions(self) -> None:
        """Raise BadInput for options that exclude each other."""
        conditions = (self.airspeed or (), self.altitude or ())
        for wrong, allowed in (
            ((self.scenario is None) is (self.grid is None), "exactly one of SCENARIO and --grid"),
            (self.within is not None and self.grid is not None, "--within only with SCENARIO"),
            (self.within is not None and self.surface is None, "--within only with --surface"),
            (self.within is None and self.seed != Detectability.seed, "--seed only with --within"),
            (self.within is not None and any(conditions), "--airspeed and --altitude only without --within"),
            (self.grid is None and bool(self.schemes or self.sensors or self.turbulence),
             "--schemes, --sensors and --turbulence only with --grid"),
            (self.grid is not None and max(map(len, conditions)) > 1,
             "with --grid at most one --airspeed and one --altitude"),
        ):  # fmt: skip
            if wrong:
                raise BadInput(f"detectability: allowed: {allowed}")

    def _of_places(self, scenario: Scenario, reporter: Reporter) -> Document:
        """The certain losses at each place; for one surface also sentences."""
        known = scenario.airframe.class_of_losses
        if self.surface is not None and self.surface not in known:
            raise BadInput(f"--surface {self.surface!r:.60}: allowed: {', '.join(known)}")
        study = places.places_study(scenario, self.airspeed or (), self.altitude or ())
        document = run_into(study, self.out, self.processes, reporter.progress)
        folder = document.pop("folder")  # set again as the last key but the engines
        if self.surface is not None:
            document |= {
                part: [row for row in document[part] if row["fault"] == self.surface] for part in places.PARTS
            }
            answers = [places_shown.answer(scenario, row) for row in document["points"]]
            return document | {"answers": answers, "folder": folder}
        failures = in_trim.engine_failures(scenario)
        document |= {"alike": in_trim.alike(scenario), "folder": folder}
        return document | ({"engines": failures} if failures else {})

    def _of_schemes(self, grid: GridName, reporter: Reporter) -> Document:
        """The share of losses that each scheme finds in the flights of a grid."""
        chosen = schemes.contenders(None if self.schemes is None else listed(self.schemes))
        airspeed_mps, altitude_m = (
            values[0] if values else None for values in (self.airspeed, self.altitude)
        )
        flown = GRIDS[grid].only(self.sensors, self.turbulence)
        flown = flown.elsewhere(self.aircraft, airspeed_mps, altitude_m, self.surface)
        return run_into(schemes_study(flown, chosen), self.out, self.processes, reporter.progress)

    def as_text(self, document: Document, colour: bool) -> str:
        """The sentences, or else the page as text; and the folder of the files."""
        shown = schemes_shown if self.grid else places_shown if self.within is None else sizes_shown
        lines = document.get("answers") or [
            as_text(shown.page_of(document)[1]), *in_trim.alike_in_words(document.get("alike", ())),
            *in_trim.failures_in_words(document.get("engines", ())),
        ]  # fmt: skip
        return "\n".join([*lines, "", f"results: {document['folder']}"])
