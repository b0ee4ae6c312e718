"""The Python that the pages show: typed anew, from the wheel, in an empty folder."""

import pytest

from .documents import PAGES, files_of_pages, python_blocks
from .exceptions import instead

OVERVIEW = "## At a glance"  # its texts belong together: tests/test_interface.py runs them
# A tutorial's Python needs the files before it (test_tutorials.py).
ALONE = [page for page in PAGES if page.parent.name != "tutorials"]
# A script that needs the command before it runs with that command (test_documents.py).
NOT_ALONE = {text for name, text in files_of_pages().items() if instead(f"python {name}") is None}
BLOCKS = [
    block for page in ALONE for block in python_blocks(page, without=OVERVIEW) if block not in NOT_ALONE
]


@pytest.mark.parametrize("program", BLOCKS)
def test_what_the_pages_show_runs_as_it_stands(program, installation, tmp_path):
    if "gymnasium" in program:
        pytest.importorskip("gymnasium")
    (tmp_path / "typed.py").write_text(program)
    done = installation.run(installation.python, "typed.py", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
