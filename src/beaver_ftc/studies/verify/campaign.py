"""Many flights on all cores: what is still to be flown, who flies it, and where the rows are kept.

Rows are kept a chunk of flights at a time, each file written whole or not at all and never touched again: a
campaign that was stopped goes on where it was, and a longer one builds on a shorter one. What a flight is
depends on the seed and its number alone, so neither the workers nor the interruptions show in the result.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil
from pathlib import Path
from typing import Any

from beaver_ftc import __version__
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.studies.engine.campaign import Batch, Batches
from beaver_ftc.studies.engine.crew import Work
from beaver_ftc.studies.engine.files import write_whole
from beaver_ftc.studies.engine.identity import fingerprint
from beaver_ftc.studies.engine.study import conduct as fly_missing
from beaver_ftc.studies.verify.draw import HEALTHY_S, Draw
from beaver_ftc.studies.verify.fly import SCHEMES, STEPS, Row, fly_draw

KINDS = ("healthy", "faulty")
CHUNK = 50
Progress = Callable[[float], None]
Schemes = dict[str, dict[str, Any]]


@dataclass(frozen=True)
class Campaign:
    """Flight hours without a fault, flights with one, and whether each step of sharpening flies these too."""

    hours: float
    faults: int
    seed: int
    steps: bool = False

    @property
    def schemes(self) -> Schemes:
        """The diagnoses each faulty flight is flown with."""
        return STEPS if self.steps else SCHEMES

    def wanted(self, kind: str) -> int:
        """Number of flights of a kind."""
        return ceil(self.hours * 3600.0 / HEALTHY_S) if kind == "healthy" else self.faults


def conduct(
    campaign: Campaign, folder: Path, workers: int, progress: Progress | None = None
) -> dict[str, list[Row]]:
    """Fly what `folder` does not hold yet; return the rows of every flight wanted, in order, by kind.

    Raises BadInput if the folder holds another seed's flights, or another version's.
    """
    _open(folder, campaign)
    rows = {kind: _kept(folder, kind) for kind in KINDS}
    chunks = [chunk for kind in KINDS for chunk in _missing(campaign, kind, rows[kind])]
    done, total = sum(map(len, rows.values())), sum(campaign.wanted(kind) for kind in KINDS)

    def land(batch: Batch, flown: list[Row]) -> None:
        nonlocal done
        kind = batch.cases[0].kind
        _keep(folder, batch.cases, flown)
        rows[kind].update((row["index"], row) for row in flown)
        done += len(flown)
        if progress is not None:
            progress(done / total)

    batches = [Batch(number, tuple(chunk)) for number, chunk in enumerate(chunks)]
    source = Batches(batches, total - done, land)
    fly_missing(source, Work(partial(_fly_draw, campaign.schemes)), workers, _crashed)
    return {kind: [rows[kind][i] for i in range(campaign.wanted(kind))] for kind in KINDS}


def _identity(campaign: Campaign) -> dict[str, Any]:
    """What must be the same for rows to belong together: the seed, the version and the code that flies."""
    return {
        "seed": campaign.seed,
        "schemes": list(campaign.schemes),
        "version": __version__,
        "code": fingerprint(),
    }


def _open(folder: Path, campaign: Campaign) -> None:
    manifest, mine = folder / "campaign.json", _identity(campaign)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not manifest.exists():
            write_whole(manifest, json.dumps(mine).encode())
        theirs = json.loads(manifest.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise SimulationFailed(f"{folder}: cannot be used for a campaign: {error}") from error
    if theirs != mine:
        differs = ", ".join(key for key in mine if theirs.get(key) != mine[key])
        raise BadInput(f"--out {folder}: holds flights of another {differs}, allowed: a new folder")


def _kept(folder: Path, kind: str) -> dict[int, Row]:
    rows: dict[int, Row] = {}
    for file in sorted(folder.glob(f"{kind}-*.json")):
        rows.update((row["index"], row) for row in json.loads(file.read_text(encoding="utf-8")))
    return rows


def _missing(campaign: Campaign, kind: str, kept: dict[int, Row]) -> Iterator[list[Draw]]:
    indices = [i for i in range(campaign.wanted(kind)) if i not in kept]
    for start in range(0, len(indices), CHUNK):
        yield [Draw(campaign.seed, kind, i) for i in indices[start : start + CHUNK]]


def _keep(folder: Path, chunk: Sequence[Draw], rows: list[Row]) -> None:
    name = f"{chunk[0].kind}-{chunk[0].index:07d}-{chunk[-1].index:07d}.json"
    try:
        write_whole(folder / name, json.dumps(rows).encode())
    except OSError as error:
        raise SimulationFailed(f"{folder / name}: {error.strerror}") from error


def _fly_draw(schemes: Schemes, draw: Draw) -> Row:
    return fly_draw(draw, schemes)


def _crashed(draw: Draw, why: str) -> Row:
    raise SimulationFailed(f"{draw.kind} flight {draw.index} of seed {draw.seed}: {why}")
