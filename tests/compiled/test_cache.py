"""Where compiled code is kept: it must be found again by the next process, wherever the package lies."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import beaver_ftc
from beaver_ftc import compiled
from beaver_ftc.compiled import cache
from beaver_ftc.documents import files
from beaver_ftc.documents.files import data_root

REPOSITORY = data_root()
CACHES = ("XDG_CACHE_HOME", "NUMBA_CACHE_DIR")


@pytest.fixture
def nowhere(monkeypatch, tmp_path):
    """An environment with no folder for a cache: in /dev/null not even root can write one."""
    for name in CACHES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", os.devnull)
    monkeypatch.setattr(files.tempfile, "gettempdir", lambda: os.devnull)
    monkeypatch.setenv("BEAVER_FTC_REFUSED", "")
    compiled.cache_folder.cache_clear()
    yield monkeypatch
    compiled.cache_folder.cache_clear()


def test_with_nowhere_to_write_nothing_is_kept(nowhere):
    assert compiled.cache_folder() is None


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders have no owner here")
def test_a_folder_somebody_else_owns_is_not_trusted(nowhere, tmp_path, capsys):
    nowhere.setenv("XDG_CACHE_HOME", str(tmp_path))
    nowhere.setattr(files, "_user", lambda: os.getuid() + 1)
    assert compiled.cache_folder() is None
    assert (
        f"{tmp_path / 'beaver-ftc'}: it belongs to user {os.getuid()}, allowed: " in capsys.readouterr().err
    )


@pytest.fixture
def where(nowhere, capsys):
    """Which folder for compiled code a process takes, and what it says."""

    def look(**environment):
        for name, value in {"BEAVER_FTC_REFUSED": "", **environment}.items():
            nowhere.setenv(name, value)
        compiled.cache_folder.cache_clear()
        return compiled.cache_folder(), capsys.readouterr().err

    return look


@pytest.mark.skipif(os.name != "posix", reason="folders have no mode here")
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702])
@pytest.mark.parametrize("which", ["base", "version"])
def test_no_code_is_run_from_a_folder_that_others_may_write(where, tmp_path, mode, which):
    given = {"NUMBA_CACHE_DIR": str(tmp_path / "numba"), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    first, said = where(**given)
    assert (first.parent, said) == (tmp_path / "numba", "")
    bad = first if which == "version" else first.parent
    bad.chmod(mode)
    second, said = where(**given)
    assert second.parent == tmp_path / "cache" / "beaver-ftc"
    assert said == (
        f"beaver-ftc: no compiled code is run from {bad}: its mode is {mode:04o}, "
        "allowed: a folder of your own that neither group nor others can write (chmod go-w)\n"
    )


PROGRAM = """
import sys
from beaver_ftc.loop.stepping import fly_on
from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.schema import load_scenario
import beaver_ftc
flight = fly(load_scenario("elevator-partial-loss"))
assert flight.isolated == "elevator"
heavy = [name for name in ("scipy.linalg", "pandas", "matplotlib", "plotly") if name in sys.modules]
print(beaver_ftc.__file__, "compiled" if fly_on.overloads else "loaded", *heavy)
"""

SMALL_ONE = """
import beaver_ftc
from beaver_ftc.diagnosis.sets import explain
explain(0.1, 0.01, 1.0, -1.0, 0.0)
print(beaver_ftc.__file__, "loaded" if explain.stats.cache_hits else "compiled")
"""


def run(folder, program=PROGRAM, **environment):
    """Run a program in a process of its own, from `folder`; what it says."""
    kept = {name: value for name, value in os.environ.items() if name not in CACHES}
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=folder,
        env=kept | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.split()


def listing(folder: Path) -> dict[str, float]:
    return {str(path): path.stat().st_mtime_ns for path in folder.rglob("*")}


def test_the_next_process_compiles_nothing_wherever_it_is_started(tmp_path):
    # The tests' own first flight was another process's, in the cache of the tests: tests/conftest.py.
    cache_of_tests = {name: os.environ[name] for name in CACHES if name in os.environ}
    _, how, *heavy = run(tmp_path, **cache_of_tests)
    assert (how, heavy) == ("loaded", [])


def test_an_installation_nobody_can_write_to_compiles_once_into_the_temporary_folder(tmp_path):
    package, temporary = tmp_path / "site" / "beaver_ftc", tmp_path / "temporary"
    shutil.copytree(Path(beaver_ftc.__file__).parent, package, ignore=shutil.ignore_patterns("data"))
    for name in ("aircraft", "scenarios"):
        shutil.copytree(REPOSITORY / name, package / "data" / name)
    temporary.mkdir()
    for path in package.rglob("*"):
        path.chmod(0o555 if path.is_dir() else 0o444)
    before = listing(package)
    environment = {
        "PYTHONPATH": str(package.parent), "HOME": os.devnull, "TMPDIR": str(temporary),
        "PYTHONDONTWRITEBYTECODE": "1",
    }  # fmt: skip
    first, second = (run(tmp_path, SMALL_ONE, **environment) for _ in range(2))
    assert first == [str(package / "__init__.py"), "compiled"]
    assert second == [str(package / "__init__.py"), "loaded"]
    assert listing(package) == before
    for path in package.rglob("*"):
        path.chmod(0o755)


SMALL = """
import sys
from pathlib import Path
from beaver_ftc.compiled import compile_into
def inner(x):
    return 2.0 * x
def outer(x):
    return compiled_inner(x) + 1.0
folder = Path(sys.argv[1])
compiled_inner = compile_into(folder, inner)
compiled = compile_into(folder, outer)
assert compiled(3.0) == 7.0
print("loaded" if compiled.stats.cache_hits else "compiled")
"""


def doubled(x):
    return 2 * x


def how(folder):
    """How a small kernel comes to be that is kept in this folder."""
    kernel = compiled.compile_into(folder, doubled)
    assert kernel(3) == 6
    return "loaded" if kernel.stats.cache_hits else "compiled"


@pytest.mark.parametrize(
    ("harm", "says"),
    [
        (lambda file: file.write_bytes(b""), "it is damaged"),
        (lambda file: file.write_bytes(file.read_bytes()[:100]), "it is damaged"),
        (lambda file: file.write_bytes(_with_another_bit(file.read_bytes())), "it is damaged"),
        (lambda file: file.chmod(0o666), "its mode is 0666"),
    ],
    ids=["empty", "cut short", "one bit", "writable"],
)
def test_damaged_code_is_compiled_anew_and_it_is_said_once(tmp_path, capsys, harm, says):
    assert [how(tmp_path), how(tmp_path)] == ["compiled", "loaded"]
    (file,) = tmp_path.glob("doubled-*")
    harm(file)
    capsys.readouterr()
    assert how(tmp_path) == "compiled"
    (line,) = capsys.readouterr().err.splitlines()
    assert f"is not run: {says}; it is compiled again" in line
    assert file.stat().st_mode & 0o022 == 0
    assert how(tmp_path) == "loaded"


def _with_another_bit(content):
    content = bytearray(content)
    content[len(content) // 2] ^= 1
    return content


@pytest.mark.skipif(os.name != "posix", reason="files have no owner here")
@pytest.mark.parametrize("what", ["belongs to another", "is a link"])
def test_content_of_a_file_that_is_not_ours_is_not_even_unpickled(tmp_path, monkeypatch, what):
    folder = tmp_path / "cache"
    assert compiled.compile_into(folder, doubled)(3) == 6
    (file,) = folder.glob("*-*")
    if what == "is a link":
        file.rename(tmp_path / "elsewhere")
        file.symlink_to(tmp_path / "elsewhere")
    else:
        monkeypatch.setattr(files, "_user", lambda: os.getuid() + 1)
    monkeypatch.setattr(cache.pickle, "loads", None)
    again = compiled.compile_into(folder, doubled)
    assert again(3) == 6
    assert not again.stats.cache_hits


def test_several_processes_compile_once(tmp_path):
    (tmp_path / "small.py").write_text(
        SMALL.replace("2.0 * x", "2.0 * x" + "".join(f" * {i}.0 / {i}.0" for i in range(2, 60)))
    )
    command = [sys.executable, tmp_path / "small.py", tmp_path / "cache"]
    several = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    assert sorted(one.communicate()[0].strip() for one in several) == ["compiled", "loaded"]
