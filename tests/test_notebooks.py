"""The notebooks run from top to bottom, show what they say they show, and are kept without their output."""

import subprocess
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")

FOLDER = Path(__file__).parents[1] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
# What must be among the texts shown, by notebook; and how many pictures.
SHOWN = {
    "first-fault": (["elevator-partial-loss: PASSED", "faults[0].magnitude: 40 is out of range"], 3),
    "how-small-a-fault": (["smallest aileron loss seen"], 1),
    "my-own-detector": (["adaptive-estimators", "named_rightly"], 1),
    "sweep-and-statistics": (["(0, 0)", "flown, nothing was expected"], 2),
}


def test_what_the_web_site_is_made_into_leaves_the_clone_clean():
    root = FOLDER.parents[1]
    for made in ("site", ".cache/mkdocs-jupyter"):  # mkdocs, and its plug-in that keeps what it has run
        ignored = subprocess.run(["git", "check-ignore", "-q", f"{made}/x"], cwd=root, check=False)
        kept = subprocess.run(["git", "ls-files", made], cwd=root, capture_output=True, check=False)
        if kept.returncode == 128:
            pytest.skip("no clone")
        assert (ignored.returncode, kept.stdout) == (0, b""), made


def test_there_are_four():
    assert {path.stem for path in NOTEBOOKS} == set(SHOWN)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs_and_shows(path, tmp_path):
    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in notebook.cells)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": tmp_path}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    texts = "\n".join(one.get("text") or one.get("data", {}).get("text/plain", "") for one in outputs)
    wanted, pictures = SHOWN[path.stem]
    assert not [text for text in wanted if text not in texts]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == pictures
