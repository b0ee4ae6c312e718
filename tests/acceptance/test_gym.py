"""The Gymnasium environment as the pages show it: typed anew, from the wheel, in an empty folder."""

import re

import pytest

from .documents import PAGES, python_blocks

pytest.importorskip("gymnasium")
MAKES = re.compile(r"gymnasium\.make(?:_vec)?\(")
BLOCKS = [block for page in PAGES for block in python_blocks(page) if MAKES.search(block)]
INLINE = sorted(
    {code for page in PAGES for code in re.findall(r"`(gymnasium\.make[^`\n]*)`", page.read_text("utf-8"))}
)


def test_the_pages_show_one_environment_and_many():
    shown = "\n".join(BLOCKS)
    assert "gymnasium.make(" in shown
    assert "gymnasium.make_vec(" in shown
    assert INLINE


@pytest.mark.parametrize("program", [*BLOCKS, *(f"import gymnasium\n{line}" for line in INLINE)])
def test_what_the_pages_show_runs_as_it_stands(program, installation, tmp_path):
    (tmp_path / "typed.py").write_text(program)
    done = installation.run(installation.python, "typed.py", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
