"""Which tests `make check` takes for a change."""

import pytest
from tools.mutants.reach import Reach

from tools import check


@pytest.mark.parametrize(
    ("budget_s", "taken"), [(10.0, ["quick", "slow"]), (4.9, ["quick"]), (0.5, [])], ids=str
)
def test_the_quickest_that_execute_a_changed_line_as_far_as_the_budget_goes(budget_s, taken):
    source = "src/beaver_ftc/cli/run.py"
    reach = Reach([
        {"seconds": {"slow": 4.0, "quick": 1.0, "other": 0.1}, "left_out": [],
         "lines": {source: {"60": ["slow"], "61": ["quick"], "70": ["other"]}}},
    ])  # fmt: skip
    reach.of = lambda name, lines: reach._lines[name].get(lines[0], set())
    assert check.chosen(reach, [(source, [60, 61, 62])], budget_s) == taken
