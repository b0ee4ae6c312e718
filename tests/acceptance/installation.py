"""The wheel of this checkout in an environment of its own, outside the checkout.

The environment is named after what is in the wheel: another wheel gets another environment, the same wheel
finds its own again, and with it the kernels compiled for it (Numba keeps them by the path of their source).
The dependencies are those of the environment that runs the tests; `beaver_ftc` comes from the wheel alone.
"""

import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import venv
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from filelock import FileLock
from tools.served import ONE_CORE, POSSIBLE, Served

from samples import AT_NIGHT

ROOT = Path(__file__).resolve().parents[2]
KEPT = 3  # environments of earlier wheels
PIP = (sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check")
# Console scripts of dependencies that the documents call by name, and what each of them starts.
SCRIPTS = {"pytest": "import pytest, sys; sys.exit(pytest.console_main())", "jsbsim": None}


@dataclass(frozen=True)
class Installation:
    """An environment that has the wheel. before: a folder whose commands are found before its own."""

    folder: Path
    before: Path | None = None

    @property
    def bin(self) -> Path:
        """Its executables."""
        return self.folder / "bin"

    @property
    def python(self) -> Path:
        """Its interpreter."""
        return self.bin / "python"

    def environment(self, **more: str) -> dict[str, str]:
        """The environment variables of a user who has activated it; nothing of the checkout is on a path.

        By day a command that is forked starts no workers, which would import the package again.
        """
        inherited = {name: value for name, value in os.environ.items() if not _is_ours(name)}
        places = filter(None, (self.before, self.bin, os.environ.get("PATH", os.defpath)))
        return {
            **inherited,
            "PATH": os.pathsep.join(map(str, places)),
            "VIRTUAL_ENV": str(self.folder),
            "COLUMNS": "80",
            **({} if AT_NIGHT else {ONE_CORE: "1"}),
            **more,
        }

    def run(
        self, *command: object, cwd: Path, timeout_s: float = 300, **more: str
    ) -> subprocess.CompletedProcess:
        """Run a program in a folder; nothing on standard input, both outputs as text."""
        return subprocess.run(
            [str(word) for word in command],
            cwd=cwd,
            env=self.environment(**more),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=timeout_s,
            check=False,
        )

    def beaver(self, *arguments: object, cwd: Path, **more: str) -> subprocess.CompletedProcess:
        """Run `beaver-ftc` with these arguments in a folder."""
        return self.run((self.before or self.bin) / "beaver-ftc", *arguments, cwd=cwd, **more)

    @contextmanager
    def served(self) -> Iterator["Installation"]:
        """The same with commands forked from one process that has imported the package (tools/served.py)."""
        if not POSSIBLE:
            yield self
            return
        with tempfile.TemporaryDirectory() as folder:
            served = Served(self.python, self.bin, self.environment())
            try:
                served.scripts(Path(folder))
                yield replace(self, before=Path(folder))
            finally:
                served.end()


def _is_ours(name: str) -> bool:
    """Whether a variable is of the test run and would make the command behave as no user sees it."""
    return name.startswith(("PYTHON", "PYTEST", "COV_", "COVERAGE", "BEAVER_FTC"))


def installed() -> Installation:
    """Build the wheel, and install it where its like is not installed yet. One process does, others wait."""
    base = _base()
    base.mkdir(parents=True, exist_ok=True)
    with FileLock(base / "lock"):
        home = _of_this_run(base) or _made(base)
        os.utime(home)
        _forget_old(base)
    return Installation(home)


def _of_this_run(base: Path) -> Path | None:
    """What another worker of the same pytest-xdist run has just made."""
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID")
    said = [home for home in base.iterdir() if run and (home / f"run-{run}").exists()]
    return said[0] if said else None


def _made(base: Path) -> Path:
    with tempfile.TemporaryDirectory() as folder:
        wheel = _build(Path(folder))
        home = base / _digest(wheel)
        if not (home / "ready").exists():
            _install(wheel, home)
    for earlier in home.glob("run-*"):
        earlier.unlink()
    (home / f"run-{os.environ.get('PYTEST_XDIST_TESTRUNUID')}").touch()
    return home


def _base() -> Path:
    """Where environments are kept: beside the user's other caches, where the checkout is not."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "beaver-ftc-acceptance"


def _build(folder: Path) -> Path:
    command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", folder]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    return wheel


def _digest(wheel: Path) -> str:
    """Of what is in the wheel and of the interpreter, not of when it was built."""
    digest = hashlib.sha256(f"{sys.version}{sysconfig.get_path('purelib')}".encode())
    with zipfile.ZipFile(wheel) as archive:
        for name in sorted(archive.namelist()):
            digest.update(name.encode() + archive.read(name))
    return digest.hexdigest()[:16]


def _install(wheel: Path, home: Path) -> None:
    """A new environment with the wheel in it, the dependencies beside it, and its kernels compiled."""
    shutil.rmtree(home, ignore_errors=True)
    venv.create(home, with_pip=False, symlinks=True)
    made = Installation(home)
    site = _site_packages(made)
    command = [*PIP, "--python", str(made.python), "install", "--no-deps", "--no-index", str(wheel)]
    subprocess.run(command, check=True, capture_output=True)
    # A folder named in a path file has its own path files left alone: what is editable there stays out.
    (site / "dependencies.pth").write_text(f"{sysconfig.get_path('purelib')}\n")
    for name, code in SCRIPTS.items():
        _give(made, name, code)
    _warm(made)
    (home / "ready").touch()


def _site_packages(made: Installation) -> Path:
    (site,) = made.folder.glob("lib/python*/site-packages")
    return site


def _give(made: Installation, name: str, code: str | None) -> None:
    """A console script of a dependency, started by the new environment's interpreter."""
    if code is None:
        source = Path(sysconfig.get_path("scripts")) / name
        text = source.read_text().partition("\n")[2]
    else:
        text = code + "\n"
    script = made.bin / name
    script.write_text(f"#!{made.python}\n{text}")
    script.chmod(0o755)


def _warm(made: Installation) -> None:
    """Fly once, so that the kernels are compiled by one process and not by all of them at once."""
    with tempfile.TemporaryDirectory() as folder:
        done = made.beaver("run", "elevator-partial-loss", "--no-report", cwd=Path(folder))
    if done.returncode:
        raise RuntimeError(f"the installed package does not fly:\n{done.stderr}")


def _forget_old(base: Path) -> None:
    homes = sorted((path for path in base.iterdir() if path.is_dir()), key=lambda path: path.stat().st_mtime)
    for home in homes[:-KEPT]:
        shutil.rmtree(home, ignore_errors=True)
