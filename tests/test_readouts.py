"""Records are read through readouts: outside the folders that own them, nobody names a field of one.

A record is what `.frames`, `.record` and `.records` of a flight hold; mypy's strict annotations leave few of
those that go by another name.
"""

import re
from pathlib import Path

import beaver_ftc

SRC = Path(beaver_ftc.__file__).parents[1]
OWNERS = tuple(
    SRC / "beaver_ftc" / name for name in ("design", "diagnosis", "control", "loop", "plant", "compiled")
)
NO_RECORDS = (SRC.parent / "tools/fdc_check.py",)  # rows of FDC's own tables
FIELD = re.compile(r"""\.(?:_?frames?|records?)(?:\[[^\]"']*\])*\[["']\w|np\.void""")


def test_no_field_of_a_record_is_read_and_no_record_handed_about_outside_its_stage():
    files = (file for root in (SRC, SRC.parent / "tools") for file in sorted(root.rglob("*.py")))
    others = [
        file for file in files if not any(file.is_relative_to(owner) for owner in (*OWNERS, *NO_RECORDS))
    ]
    assert [str(file) for file in others if FIELD.search(file.read_text(encoding="utf-8"))] == []
    owned = (file.read_text(encoding="utf-8") for owner in OWNERS for file in owner.rglob("*.py"))
    assert sum(map(len, map(FIELD.findall, owned))) > 20
