"""What is to be derived: an aircraft of the jsbsim package, any JSBSim model, or a file already there."""

import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from beaver_ftc.aircraft.loading import FILE, builtin_names, derived_folder, load, read
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.plant import instrumented
from beaver_ftc.plant.model_file import copy_of, refuse_deeds

FROM_JSBSIM = "jsbsim:"
_PROBE = """import sys
from pathlib import Path
from beaver_ftc.plant.adapter import probe
probe(Path(sys.argv[1]), sys.argv[2:])"""
_LONGEST_S = 60.0
_MOST_ABSENT = 20
_ABSENT = re.compile(r"The property ([^ ]+) does not exist")
_ALLOWED = "jsbsim:NAME, a built-in name, a JSBSim model FILE.xml, or a folder with an aircraft.yaml"


@dataclass(frozen=True)
class Source:
    """An aircraft to derive. name: of the folder to be written. model: JSBSim's. folder: of an aircraft file
    whose moments are to be found anew, else None: the model is instrumented. target: where the result goes
    unless somebody says otherwise, None if somebody must."""

    name: str
    model: Path
    folder: Path | None = None
    target: Path | None = None

    @property
    def says(self) -> str:
        """What to call it."""
        return f"{FROM_JSBSIM}{self.name}" if self.target else self.name


def source_of(reference: str) -> Source:
    """What a reference means. Raises BadInput for what is no aircraft, or would act on the machine."""
    if reference.startswith(FROM_JSBSIM):
        name = reference.removeprefix(FROM_JSBSIM)
        target = derived_folder(name)
        return Source(name, instrumented.source_of(name), target=target)
    if reference in builtin_names():
        aircraft = load(reference)
        return Source(reference, aircraft.jsbsim, aircraft.folder)
    path = Path(reference)
    if (path / FILE).is_file():
        aircraft = read(path.resolve())
        return Source(aircraft.name, aircraft.jsbsim, aircraft.folder)
    if path.is_dir() and (path / f"{path.resolve().name}.xml").is_file():
        path = path / f"{path.resolve().name}.xml"
    if path.suffix == ".xml" and path.is_file():
        refuse_deeds(path)
        return Source(path.stem, path.resolve())
    raise BadInput(f"{reference[:80]!r} cannot be derived, allowed: {_ALLOWED}")


def try_out(source: Source) -> tuple[str, ...]:
    """Load and start the model in a process of its own: some models end the process that loads them.

    Returns the properties that its files read and nothing gives; most are FlightGear's. Raises
    SimulationFailed, with what JSBSim says, for a model that cannot be flown with these at 0 either.
    """
    absent: list[str] = []
    while (why := _failure(source, absent)) is not None:
        found = _ABSENT.search(why)
        if found is None or found[1] in absent or len(absent) == _MOST_ABSENT:
            raise SimulationFailed(f"{source.says}: {why}")
        absent.append(found[1])
    return tuple(absent)


def _failure(source: Source, absent: list[str]) -> str | None:
    """Why the model does not fly with these properties at 0; None if it does."""
    try:
        with tempfile.TemporaryDirectory(prefix="beaver-ftc-") as here:  # also of a process that is ended
            around = os.environ | {"TMPDIR": here}
            model = copy_of(source.model, Path(here) / source.name)
            command = [sys.executable, "-c", _PROBE, str(model), *absent]
            run = subprocess.run(
                command, capture_output=True, text=True, timeout=_LONGEST_S, check=False, env=around
            )
    except subprocess.TimeoutExpired:
        return f"JSBSim does not start it within {_LONGEST_S:g} s"
    if not run.returncode:
        return None
    said = [line.strip() for line in run.stderr.splitlines() if line.strip()]
    ours = [line for line in said if "SimulationFailed: " in line]  # JSBSim may end the process after it
    why = (ours or said or [f"ended by signal {-run.returncode}"])[-1]
    return why.rpartition("SimulationFailed: ")[2].removeprefix("what():").strip()
