"""A model is loaded, started and run for some frames in a process of its own before it is loaded here.

JSBSim reads whatever a model says: some models end the process that loads them, or take all its memory or
time. The process of the trial has limits for both (POSIX; elsewhere for time alone).
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import process_time

from beaver_ftc.documents.errors import BeaverFtcError, SimulationFailed

MOST_BYTES = 1 << 30  # of its address space
MOST_CPU_S = 2  # of processor, imports included: 0.5 s; JSBSim's own largest aircraft take 0.1 s more
LONGEST_S = 30.0  # on the clock, should it wait for something or the processor be taken
MOST_LOAD_S = 0.7  # of processor: a command loads a new aircraft four times; JSBSim's own take 0.1 s at most
FRAMES = 60
MOST_FRAME_S = 0.002  # of processor, on average; JSBSim's own largest aircraft take 0.0001 s
_COMMAND = "import sys; from beaver_ftc.plant.trial import _alone; _alone(*sys.argv[1:])"
_REFUSED = 2


def failure(model: Path) -> str | None:
    """Why a model cannot be loaded and flown, in words; None if it can."""
    return _tried(model)[0]


def lacking(model: Path) -> list[str]:
    """The properties that a model reads and nothing gives: with these at 0 it can be loaded and flown.

    Raises SimulationFailed, with what JSBSim says, for one that cannot be.
    """
    why, said = _tried(model, "giving")
    if why is not None:
        raise SimulationFailed(why)
    return said.split()


def _tried(model: Path, *how: str) -> tuple[str | None, str]:
    """Why a model does not pass its trial, None if it does; and what the process of the trial has written."""
    above = str(Path(__file__).parents[2])  # the package itself, never what lies in the working directory
    paths = [above, *filter(None, [os.environ.get("PYTHONPATH")])]
    command = [sys.executable, "-P", "-c", _COMMAND, str(model), *how]
    with tempfile.TemporaryDirectory(prefix="beaver-ftc-") as here:  # also of a process that is ended
        around = os.environ | {
            "TMPDIR": here, "PYTHONPATH": os.pathsep.join(paths), "OPENBLAS_NUM_THREADS": "1"
        }  # fmt: skip
        try:
            run = subprocess.run(
                command, capture_output=True, timeout=LONGEST_S, check=False, env=around,
                stdin=subprocess.DEVNULL,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return f"JSBSim does not start it within {LONGEST_S:g} s", ""
    said = run.stdout.decode(errors="replace").strip()
    if run.returncode == 0:
        return None, said
    if run.returncode == _REFUSED:
        return said, said
    return _how_it_ended(run.returncode, run.stderr.decode(errors="replace")), said


def _how_it_ended(status: int, said: str) -> str:
    import signal

    if status in (-signal.SIGKILL, -getattr(signal, "SIGXCPU", 0)):
        return f"JSBSim does not start it within {MOST_CPU_S} s of processor"
    if "bad_alloc" in said or "MemoryError" in said or "length_error" in said:
        return f"JSBSim needs more than {MOST_BYTES / 2**30:g} GB of memory for it"
    last = next((line.strip() for line in reversed(said.splitlines()) if line.strip()), "")
    how = f"it ends JSBSim by signal {-status}" if status < 0 else f"JSBSim ends with status {status}"
    return f"{how}: {' '.join(last.removeprefix('what():').split())[:200]}" if last else how


def _alone(model: str, *how: str) -> None:
    """What the process of the trial does. It ends at once: what JSBSim has loaded may not be freed safely."""
    _limit()
    absent: list[str] | None = [] if how else None
    try:
        probe(Path(model), absent)
    except BeaverFtcError as error:
        _end(_REFUSED, " ".join(str(error).split()))
    except MemoryError:
        _end(_REFUSED, f"JSBSim needs more than {MOST_BYTES / 2**30:g} GB of memory for it")
    _end(0, "\n".join(absent or ()))


def probe(model: Path, absent: list[str] | None = None) -> None:
    """Load a model, start it and let it run for some frames, in this process.

    Raises SimulationFailed if it does not, or if loading or a frame takes long. absent: properties that
    nothing gives, at 0; what else nothing gives is added, if a list is given.
    """
    from beaver_ftc.plant.adapter import bare, giving, translated

    began_s = process_time()
    fdm = bare(model, absent)
    loaded_s = process_time()
    if loaded_s - began_s > MOST_LOAD_S:
        took = f"JSBSim takes {loaded_s - began_s:.2g} s of processor to load it"
        raise SimulationFailed(f"{took}, more than {MOST_LOAD_S:g} s")
    with translated(model):
        for _ in range(FRAMES):
            giving(fdm, fdm.run, absent)
    frame_s = (process_time() - loaded_s) / FRAMES
    if frame_s > MOST_FRAME_S:
        took = f"a frame of JSBSim takes {1e3 * frame_s:.2g} ms of processor"
        raise SimulationFailed(f"{took}, more than {1e3 * MOST_FRAME_S:g} ms")


def _end(status: int, says: str = "") -> None:
    sys.stdout.buffer.write(says.encode(errors="replace"))
    sys.stdout.buffer.flush()
    os._exit(status)


def _limit() -> None:
    """Bound memory, processor time and what is left behind, where the system can."""
    try:
        import resource
    except ImportError:
        return
    limits = {"AS": (MOST_BYTES,) * 2, "CPU": (MOST_CPU_S, MOST_CPU_S + 1), "CORE": (0, 0)}
    for name, wanted in limits.items():
        try:
            resource.setrlimit(getattr(resource, f"RLIMIT_{name}"), wanted)
        except (OSError, ValueError, AttributeError):
            continue
