"""What all tests share: the helpers of tests/flying.py, and property tests that repeat themselves."""

import gc
import hashlib
import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

sys.path.insert(0, str(Path(__file__).parent / "diagnosis"))
sys.path.insert(0, str(Path(__file__).parent))

from tools.promises import is_at_night, is_spared, longest

import kept
import warm
from samples import samples
from tools import suite_cost

# No deadline: a first call compiles. Derandomised: a red build can be repeated.
settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=samples(100))
settings.load_profile("repeatable")


# Nearly all that a worker imports and collects stays to its end: to look through it often finds nothing.
RARELY = 50_000, 20, 50


def pytest_configure(config):
    gc.set_threshold(*RARELY)
    suite_cost.pytest_configure(config)
    worker = getattr(config, "workerinput", {"workerid": "gw0"})["workerid"]
    number = int(worker[2:])
    if config.args == ["tests"] and number:
        config.args = _from_elsewhere(number, config.getoption("ignore") or ())


def _from_elsewhere(number, ignored):
    """Workers collect forwards, backwards, and from the middle: whoever comes first to a file rewrites its
    assertions, and others read them.
    """
    here = Path(__file__).parent
    children = {each for each in here.iterdir() if each.is_dir() or each.match("test_*.py")}
    children -= {Path(each).resolve() for each in ignored}
    found = [str(each) for each in sorted(children, reverse=number % 2 == 1)]
    first = len(found) // 2 if number >= 2 else 0
    return found[first:] + found[:first]


def pytest_addoption(parser):
    parser.addoption("--keep", action="store_true", help="write anew what differs from tests/kept/")


# Files that take a worker longest: begun last, they would keep it while the other has nothing to do.
LONGEST = (
    "products/live/page/test_guests.py", "aircraft/derive/test_derive.py", "cli/test_command_line.py",
    "studies/sensitivity/test_mechanisms.py", "rivals/test_detectors.py", "compiled/test_cache.py",
    "detection/test_likelihood.py", "studies/reproduce/test_reproduce.py",
    "assurance/certificates/test_certificates.py", "loop/test_loop.py", "diagnosis/test_new_type.py",
    "tools/test_drawn.py", "aircraft/test_engines.py", "tests/test_notebooks.py", "logs/test_commands.py",
    "live/page/test_server.py", "logs/test_check.py", "control/test_power.py", "results/test_report.py",
    "tools/test_reference.py", "tests/test_interface.py", "live/challenge/test_cheats.py",
    "scenario/test_new_sensor.py", "live/page/test_page.py", "studies/sweep/test_campaign.py",
    "studies/test_new_study.py", "compiled/test_strangers.py", "studies/mismatch/test_command.py",
    "logs/test_long_logs.py", "evidence/test_evidence.py", "matrix/test_pitch_lost.py",
    "sitl/test_endpoint.py", "bench/test_memory.py", "studies/detectability/test_schemes.py",
    "compiled/test_sized_types.py", "recorded/test_benchmark.py", "loop/test_who_sees_the_truth.py",
    "studies/sweep/test_rare.py", "results/test_painters.py", "plugins/test_pytest_plugin.py",
    "diagnosis/test_statistical_flights.py", "tools/test_docs_names.py",
)  # fmt: skip


def _rank(file):
    """The place of a file among the longest, the longest first."""
    return next((k for k, longest in enumerate(LONGEST) if file.endswith(longest)), len(LONGEST))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """The longest files come first; what tests/nightly.yaml lists has the marks `nightly` or `acceptance`."""
    files = [item.nodeid.partition("::")[0] for item in items]
    ranks = {file: (_rank(file), file) for file in files}
    items.sort(key=lambda item: ranks[item.nodeid.partition("::")[0]])
    seen = set()
    for item in items:
        of = item.nodeid.partition("[")[0]
        if (of in seen and is_spared(item.nodeid)) or is_at_night(item.nodeid):
            item.add_marker("nightly")
        elif item.nodeid.startswith(longest()):
            item.add_marker("acceptance")
        seen.add(of)


def pytest_collection_finish():
    gc.collect()
    gc.freeze()


@pytest.fixture
def changed(request):
    """changed(document): how it differs from what an earlier revision made, kept below tests/kept/; see
    tests/kept.py. part: of several of a test.
    """
    file = Path(request.node.path).relative_to(Path(__file__).parent).with_suffix("")

    def differences(document, part="", **tolerance):
        name = request.node.name.replace("/", "-") + (f"-{part}" if part else "")
        return kept.differences(f"{file}/{name}", document, request.config.getoption("--keep"), **tolerance)

    return differences


@pytest.fixture(scope="module")
def figures_in_short():
    """A figure of a flight is a dot that bears what it would show: to draw one takes 0.3 s. tests/results/
    test_figures.py and test_files.py have them drawn.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("beaver_ftc.results.pictures.save", _save_in_short)
        yield


def _save_in_short(picture):
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    bears, shown = PngInfo(), [picture.view, picture.event_marks, picture.subtitle]
    columns = {name: values.tobytes() for name, values in picture.series.items()}
    bears.add_text("Software", "beaver-ftc")
    bears.add_text("Description", hashlib.sha256(repr([*shown, columns]).encode()).hexdigest())
    Image.new("L", (1, 1)).save(picture.path, pnginfo=bears)


@pytest.fixture(scope="session")
def trim_point():
    from beaver_ftc.plant.trim import trim

    return trim(45.0, 1828.8)


@pytest.fixture
def beaver(trim_point):
    """A Beaver at 100 Hz, trimmed at 45 m/s and 1828.8 m."""
    from beaver_ftc.plant.adapter import Plant

    plant = Plant(rate_hz=100)
    plant.start(trim_point)
    return plant


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session):
    """Compile what flights use before the first test: what is said meanwhile is a test by itself. A worker
    waits for the one that compiles, and for `tests/warm.py` if it has been started before: make does so.
    """
    plain = os.environ.get("NUMBA_DISABLE_JIT", "0") != "0"
    gives_them_to_workers = session.config.getoption("numprocesses", None)
    if not (plain or gives_them_to_workers or session.config.option.collectonly):
        warm.main()
