"""`beaver-ftc derive` and `beaver-ftc import`: aircraft of other people."""

from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli import Format, FormatOption, answer, complain
from beaver_ftc.commands import declare
from beaver_ftc.documents import BadInput

MOMENT_S = 0.1  # of flight


class Import:
    """Make aircraft of data that others publish."""


@declare(plugins=False)
def derive(
    aircraft: Annotated[str, typer.Argument(metavar="AIRCRAFT")],
    envelope: Path | None = None,
    out: Path | None = None,
    engines: bool = False,
    format: FormatOption = Format.text,
) -> None:
    """Derive an aircraft's design model from JSBSim.

    The command computes the accelerations of the aircraft in many states of its envelope, and fits a few
    terms to them. It then measures the largest error of the fitted model, in the states of the fit and in
    other states. The declared bound is 1.3 times this error. Afterwards a scenario can contain
    `aircraft: jsbsim:NAME`.

    Examples:
      beaver-ftc derive jsbsim:c172p

    aircraft: jsbsim:NAME of the jsbsim package, path of a JSBSim model, or folder of an aircraft.
    envelope: YAML file with ranges: airspeed_mps, alpha_deg, altitude_m and sideslip_deg; and with surfaces,
    the names of the model's surfaces, if they are not the usual ones.
    out: Folder of the aircraft folder. Default: the cache.
    engines: Give each engine a lever of its own, which the law moves. Requires --out.
    """
    from beaver_ftc_aircraft.derive.derivation import derive
    from beaver_ftc_aircraft.derive.derived import document_of, text_of

    if engines and out is None:
        raise BadInput("--engines: needs a folder of its own, allowed: with --out")
    made = derive(aircraft, out, envelope, lambda what: complain(f"deriving: {what}"), engines=engines)
    _compile_for(made.aircraft.folder, "deriving")
    document = document_of(made)
    answer(format, document, lambda: text_of(document))


@declare(plugins=False)
def gtm(
    database: Annotated[Path, typer.Argument(metavar="DATABASE.mat")],
    out: Path | None = None,
    format: FormatOption = Format.text,
) -> None:
    """Import NASA's Generic Transport Model.

    The command writes the aircraft folder `gtm`. The folder contains a JSBSim model of the wind-tunnel
    tables, with 17 surfaces, two jets and six cases of damage. It also contains an aircraft file with a
    derived design model, and scripts for JSBSim alone. Afterwards a scenario can contain `aircraft: gtm`.

    The database is not part of this package. It is the file gtm_design/config/T2_polynomial_aerodatabase.mat
    of github.com/nasa/GTM_DesignSim, under the NASA Open Source Agreement.

    Examples:
      beaver-ftc import gtm T2_polynomial_aerodatabase.mat

    database: Path of your copy of the database.
    out: Folder of the aircraft folder. Default: the cache.
    """
    from beaver_ftc_aircraft.gtm.conversion import convert, document_of, text_of

    made = convert(database, out, tell=lambda what: complain(f"importing: {what}"))
    _compile_for(made.folder, "importing")
    document = document_of(made)
    answer(format, document, lambda: text_of(document))


def _compile_for(folder: Path, doing: str) -> None:
    """Fly an aircraft for a moment: what it compiles, no first flight has to wait for.

    One that cannot be flown so is none the worse for it: its flights say why.
    """
    from beaver_ftc.documents import Document
    from beaver_ftc.loop import fly
    from beaver_ftc.scenario import validate_scenario

    complain(f"{doing}: compile")
    with suppress(Exception):
        beside = {"name": "first-flight", "aircraft": f"./{folder.name}", "duration_s": MOMENT_S}
        fly(validate_scenario(Document(beside), folder=folder.parent))
