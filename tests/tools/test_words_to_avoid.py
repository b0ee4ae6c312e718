"""The linter of words: where it finds a term, and where it does not; `make lint` runs it."""

import pytest

from tools import words

TABLE = """
## Avoided terms

| avoid | use | why |
|---|---|---|
| foretell*, foretold | predict | archaic |
| told apart | distinguished | idiom |

## Avoided in a folder

| avoid | where | use |
|---|---|---|
| beside, doubt* | src/detectors/* | with |

## Exceptions

| term | where | reason |
|---|---|---|
| foretold | src/contract/* | a key |
"""


@pytest.mark.parametrize(
    ("name", "text", "lines"),
    [
        ("src/a.py", "def foretell_rate(x):\n    return x\n", [1]),
        ("src/a.py", "class Foretelling:\n    pass\n", [1]),
        ("src/a.py", "x = 1  # is foretold\n", [1]),
        ("src/a.py", '"""One.\n\nFaults are told apart."""\n', [3]),
        ("src/a.py", 'print(f"{1} was Foretold")\n', [1]),
        ("src/a.py", "x = 1  # is predicted\nforest = unforetold = 2\n", []),
        ("src/contract/a.py", 'key = "foretold"\nforetell = 1\n', [2]),
        ("docs/a.md", "One.\nIt is told apart.\n", [2]),
        ("src/detectors/a.py", "doubtful = 1\nx = 2  # beside\n", [1, 2]),
        ("src/laws/a.py", "x = 2  # beside\n", []),
    ],
)
def test_where_a_term_is_found(name, text, lines):
    assert [int(one.split(":")[1]) for one in words.findings(name, text, TABLE)] == lines
