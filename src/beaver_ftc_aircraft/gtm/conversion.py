"""`beaver-ftc import gtm`: from the data base to an aircraft folder that flies, here and in plain JSBSim."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from beaver_ftc.aircraft import imported_folder
from beaver_ftc.documents import BadInput, put_folder
from beaver_ftc_aircraft.derive.derivation import derive
from beaver_ftc_aircraft.gtm.database import read
from beaver_ftc_aircraft.gtm.folder import (
    MOVES,
    NAME,
    NOTICE,
    regions,
    write_model,
    write_notice,
    write_outline,
    write_scripts,
    write_start,
)
from beaver_ftc_aircraft.gtm.parameters import cases
from beaver_ftc_aircraft.gtm.steady import Bench, Condition, Steady

Tell = Callable[[str], None]
START_ALPHA_DEG = 3.0


@dataclass(frozen=True)
class Imported:
    """What came of it: the folder, its surfaces, the steady flight of its scripts, how long it took."""

    folder: Path
    surfaces: tuple[str, ...]
    steady: Steady
    took_s: float


def convert(database: Path, out: Path | None = None, tell: Tell = lambda line: None) -> Imported:
    """Write the aircraft folder `gtm`, into `out` if given, else where `aircraft: gtm` looks for it.

    Raises BadInput, one line, for another file and where something else is in the way.
    """
    started_s = perf_counter()
    target = out / NAME if out else imported_folder(NAME)
    if target.exists() and not (target / NOTICE).is_file():
        raise BadInput(f"{target} is there already and was not imported, allowed: another folder")
    tell("read")
    base = read(database)
    with tempfile.TemporaryDirectory(prefix="beaver-ftc-") as scratch:
        bare = Path(scratch) / "bare" / NAME
        bare.mkdir(parents=True)
        tell("write the model")
        model = write_model(base, bare)
        write_outline(bare)
        tell("trim")
        steady = Bench(model).steady(Condition(alpha_deg=START_ALPHA_DEG))
        made = derive(str(bare), Path(scratch) / "derived", tell=tell, regions=regions(), moves=MOVES)
        folder = Path(scratch) / "derived" / NAME
        write_start(folder, steady)
        write_scripts(folder, steady)
        write_notice(folder, database)
        put_folder(folder, target)
    return Imported(target, made.aircraft.surfaces, steady, perf_counter() - started_s)


def document_of(made: Imported) -> dict[str, Any]:
    """What came of it, for JSON."""
    return {
        "aircraft": NAME,
        "folder": str(made.folder),
        "surfaces": list(made.surfaces),
        "damage": list(cases()),
        "trim": {name: float(number) for name, number in vars(made.steady).items()},
        "took_s": round(made.took_s, 2),
    }


def text_of(document: dict[str, Any]) -> str:
    """The document as text."""
    trim = document["trim"]
    return "\n".join(
        [
            f"gtm: {document['folder']}, written in {document['took_s']:.1f} s",
            f" surfaces   {', '.join(document['surfaces'])}",
            f" damage     {', '.join(document['damage'])}",
            f" trim       {trim['alpha_deg']:g} deg, {trim['eas_kt']:.1f} kt: "
            f"elevator {trim['elevator_deg']:.3f} deg, aileron {trim['aileron_deg']:.3f} deg, "
            f"throttle {trim['throttle_percent']:.2f} %",
            f" the licence of NASA's data is in {NOTICE} of the folder",
        ]
    )
