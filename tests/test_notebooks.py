"""The notebooks show what today's code shows: run again, their texts are the stored ones."""

import re
import subprocess
from math import isclose
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
from tools.docs import notebooks  # noqa: E402

FOLDER = Path(__file__).parents[1] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
MOST_BYTES = 150_000
# What must be among the texts shown, by notebook; and how many pictures.
SHOWN = {
    "first-fault": (["elevator-partial-loss: PASSED", "faults[0].magnitude: 40 is out of range"], 3),
    "how-small-a-fault": (["smallest aileron loss seen"], 1),
    "my-own-detector": (["adaptive-estimators", "named_rightly"], 1),
    "sweep-and-statistics": (["(0, 0)", "flown, nothing was expected"], 2),
}
_NUMBER = re.compile(r"(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?)")


def test_what_the_web_site_is_made_into_leaves_the_clone_clean():
    root = FOLDER.parents[1]
    for made in ("site", ".cache/mkdocs-jupyter"):  # mkdocs, and its plug-in that keeps what it has run
        ignored = subprocess.run(["git", "check-ignore", "-q", f"{made}/x"], cwd=root, check=False)
        kept = subprocess.run(["git", "ls-files", made], cwd=root, capture_output=True, check=False)
        if kept.returncode == 128:
            pytest.skip("no clone")
        assert (ignored.returncode, kept.stdout) == (0, b""), made


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_is_stored_is_whole_and_small(path):
    stored = nbformat.read(path, as_version=4)
    nbformat.validate(stored)
    code = [cell for cell in stored.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1)), (
        "python -m tools.docs.notebooks"
    )
    assert not [
        o for cell in code for o in cell.outputs if o.output_type == "error" or o.get("name") == "stderr"
    ]
    wanted, pictures = SHOWN[path.stem]
    assert not [text for text in wanted if text not in "\n".join(notebooks.texts(stored))]
    assert notebooks.pictures(stored) == pictures
    assert path.stat().st_size < MOST_BYTES


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_shows_what_is_stored(path):
    stored = nbformat.read(path, as_version=4)
    again = notebooks.slim(notebooks.run(path))
    assert differences(notebooks.texts(stored), notebooks.texts(again)) == [], (
        "python -m tools.docs.notebooks"
    )
    assert notebooks.pictures(again) == notebooks.pictures(stored)


def differences(stored, shown):
    """Outputs that differ in a word, or in a number by more than another processor rounds."""
    assert len(stored) == len(shown)
    return [pair for pair in zip(stored, shown, strict=True) if not _same(*pair)]


def _same(one, other):
    parts = [_NUMBER.split(text) for text in (one, other)]
    if len(parts[0]) != len(parts[1]):
        return False
    pairs = list(zip(*parts, strict=True))
    words, numbers = pairs[::2], pairs[1::2]
    near = all(isclose(float(a), float(b), rel_tol=1e-6, abs_tol=1e-9) for a, b in numbers)
    return near and all(a == b for a, b in words)
