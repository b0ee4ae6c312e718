"""`beaver-ftc import`: aircraft that others publish, from the user's copy of their data."""

from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli.output import Format, FormatOption, answer, complain


def gtm(
    database: Annotated[Path, typer.Argument(metavar="DATABASE.mat")],
    out: Path | None = None,
    format: FormatOption = Format.text,
) -> None:
    """Import NASA's Generic Transport Model.

    Writes an aircraft folder `gtm`: a JSBSim model of its wind-tunnel tables, with 17 surfaces, two jets and
    six cases of damage, our own file with a derived design model, and scripts that plain JSBSim flies.
    Afterwards `aircraft: gtm` flies.

    The data base is not part of this package: gtm_design/config/T2_polynomial_aerodatabase.mat of
    github.com/nasa/GTM_DesignSim, under the NASA Open Source Agreement.

    database: Your copy of the data base.
    out: Folder to write the aircraft's folder into, if not the cache.
    """
    from beaver_ftc.studies.gtm.conversion import convert, document_of, text_of

    document = document_of(convert(database, out, tell=lambda what: complain(f"importing: {what}")))
    answer(format, document, lambda: text_of(document))
