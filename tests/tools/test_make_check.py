"""Which tests `make check` takes for a change."""

import pytest
from tools.mutants.reach import Reach

from tools import check

DIFF = """diff --git a/src/beaver_ftc/a.py b/src/beaver_ftc/a.py
--- a/src/beaver_ftc/a.py
+++ b/src/beaver_ftc/a.py
@@ -3 +3,2 @@ def f():
-    return 1
+    x = 2
+    return x
@@ -8,0 +10 @@ def g():
+    y = 3
@@ -11,2 +13,0 @@
-    a
-    b
diff --git a/tests/test_a.py b/tests/test_a.py
--- a/tests/test_a.py
+++ b/tests/test_a.py
@@ -1 +1 @@
-1
+2
"""


def test_changed_lines_are_numbered_as_before_the_change():
    assert list(check.changed(DIFF)) == [("src/beaver_ftc/a.py", [3, 8, 11, 12]), ("tests/test_a.py", [1])]
    assert list(check.changed("")) == []


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
