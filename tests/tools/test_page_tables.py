"""Tables of pages that group rows, or write what several rows share only once."""

import pytest
from tools.docs import tables
from tools.docs.cells import cells
from tools.docs.tables import mechanisms, reproduction

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.mechanisms.shown import CRITERIA
from beaver_ftc.studies.reproduce.claims import BORNE_OUT


def mechanism(name, **ends):
    """A row of the study; of each criterion, the interval of its net share."""
    found = {key: {"value": 0.0, "low": -0.1, "high": 0.1} for key in CRITERIA}
    for key, (low, high) in ends.items():
        found[key] = {"value": (low + high) / 2, "low": low, "high": high}
    counts = {"flights": 9, "same_verdict": 4, "same_tracking": 3}
    return {"mechanism": name, "system": "default", **counts, **found}


def test_mechanisms_stand_below_what_they_do():
    rows = [
        mechanism("a", late=(-0.3, -0.2)),
        mechanism("b", late=(0.2, 0.3)),
        mechanism("c", late=(0.2, 0.3), names=(-0.3, -0.2)),
        mechanism("d"),
        mechanism("e", names=(0.1, 0.4)),
    ]
    lines = [line for line in mechanisms._grouped({"mechanisms": rows}).splitlines() if line]
    assert [line[:3] if line.startswith("- ") else line for line in lines] == [
        "Mechanisms that help:", "- B", "- E",
        "Mechanisms that help by one criterion and cost by another:", "- C",
        "Mechanisms that cost:", "- A",
        "Mechanisms that change no criterion beyond chance:", "- D",
    ]  # fmt: skip


def test_settings_of_a_statement_are_named_as_the_page_names_them():
    missed = ["Kp halved, Ki to match", "s1"]
    claim = {
        "where": "I", "statement": "x.", "verdict": BORNE_OUT, "construction": False, "reason": "",
        "borne_out_in": 18, "elsewhere": 20,
    }  # fmt: skip
    sensitivity = [{"variant": name, "also_without": [], "missed": [{"statement": "x."}]} for name in missed]
    text = reproduction._not_everywhere({"claims": [claim], "sensitivity": sensitivity})
    assert text.splitlines()[2] == "| I | x | 18 of 20 | Kp halved and Ki matched; s1 |"


def test_a_table_within_a_text_moves_beside_the_page(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = "Before.\n\n*Table 4. Laws.*\n\n| law |\n|---|\n| a |\n\nAfter."
    link = "- [Laws](images/tables/laws.csv)"
    assert tables.moved(text, "*Table 4.", "laws", "Laws") == f"Before.\n\n{link}\n\nAfter."
    assert (tmp_path / "images/tables/laws.csv").read_text() == "law\na\n"
    with pytest.raises(BadInput, match="no table"):
        tables.moved(text, "*Table 5.", "laws", "Laws")


def test_a_table_beside_the_page_has_cells_without_marks(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    table = "| law | ratio |\n|---|---|\n| [`lqr`](laws.md) | **1.5** |\n| a, b | 2 |\n"
    assert tables.aside("laws", "Ratios", table) == "- [Ratios](images/tables/laws.csv)"
    assert (tmp_path / "images/tables/laws.csv").read_text() == 'law,ratio\nlqr,1.5\n"a, b",2\n'


PAGE = """\
*Table 1. Shares.*

|scheme|light: aileron, % (12)||
|---|---|---|
|`ours`|**75**|x|
|both, default|2.5|-|

Text.

*Table 2. Printed.*

<!-- printed: fly -->
||n|
|---|---|
|a|1|
<!-- /printed -->
"""


def test_prose_can_take_numbers_of_the_tables_of_a_page():
    found = cells(PAGE)
    assert found["1"][0] == {"scheme": "ours", "light_aileron": 75, "row": "x"}
    assert found["1"][1]["light_aileron"] == 2.5
    assert found["2"] == [{"row": "a", "n": 1}]


def test_prose_can_take_numbers_of_the_tables_beside_a_page(tmp_path):
    (tmp_path / "laws.csv").write_text('law,"error, deg/s"\nlqr,1.5\n')
    found = cells("- [Laws](laws.csv)\n", tmp_path)
    assert found == {"laws": [{"law": "lqr", "error": 1.5}]}
