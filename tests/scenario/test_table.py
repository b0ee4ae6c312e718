"""CSV references: what is read, what is refused, and nothing outside the scenario's folder."""

import os
import re

import pytest
from pydantic_core import PydanticCustomError

from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.scenario.schema import load_scenario
from beaver_ftc.scenario.signals import check_table

GOOD = "t_s,rate_deg_s\n0,0\n1,2\n"


def load(folder, file="ref.csv", more=""):
    path = folder / "scenario.yaml"
    path.write_text(f"name: x\nreference:\n  q:\n    - csv:\n        file: {file}\n        {more}\n")
    return load_scenario(path)


def refused(folder, **options) -> str:
    with pytest.raises(ScenarioError) as caught:
        load(folder, **options)
    (line,) = str(caught.value).split("\n")
    return line


def test_a_column_by_name(tmp_path):
    (tmp_path / "ref.csv").write_text("\ufefft_s,p,q\r\n0,1,2\r\n0.5,3,4\r\n", encoding="utf-8")
    table = load(tmp_path, more="column: q").reference.q[0].csv
    assert table.time_s == (0, 0.5)
    assert table.values_deg_s == (2, 4)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "the header has no column 't_s'"),
        ("0,0\n1,2\n", "the header has no column 't_s'"),
        ("t_s,q\n0,0\n", "the header has no column 'rate_deg_s'"),
        ("t_s,t_s,rate_deg_s\n0,0,0\n", "the header has no column 't_s'"),
        ("t_s,rate_deg_s\n", "line 2: there are no rows"),
        ("t_s,rate_deg_s\n0,0\n0,1\n", "times do not increase"),
        ("t_s,rate_deg_s\n1,0\n0,1\n", "times do not increase"),
        ("t_s,rate_deg_s\n-1,0\n0,1\n", "times do not increase from 0"),
        ("t_s,rate_deg_s\n0,0\n1,nan\n", "line 3: '1,nan' is not finite"),
        ("t_s,rate_deg_s\n0,0\nnan,1\n", "line 3: 'nan,1' is not finite"),
        ("t_s,rate_deg_s\n0,0\n1,inf\n", "line 3: '1,inf' is not finite"),
        ("t_s,rate_deg_s\n0,0\n1\n", "line 3: '1' is not a row of numbers"),
        ("t_s,rate_deg_s\n0,0\n1,two\n", "line 3: '1,two' is not a row of numbers"),
        ("t_s,rate_deg_s\n0,0\n1,2000\n", "rates out of range"),
        ("t_s;rate_deg_s\n0;0\n", "the header has no column 't_s'"),
        ("t_s,rate_deg_s\n" + "".join(f"{i},0\n" for i in range(20_001)), "too many rows (20001)"),
        ("t_s,rate_deg_s\n0," + "x" * 50, f"line 2: '0,{'x' * 38}' is not a row"),
        ("t_s,rate_deg_s\n0," + "9" * 400, f"line 2: '0,{'9' * 38}' is not finite"),
        ("t_s,rate_deg_s\n0,0\n".ljust(2_000_001), "is too large (2 MB), allowed: at most 2 MB"),
        ("t_s,rate_deg_s\n" + "0,0\n" * 600_000, "is too large"),
        ("t_s,rate_deg_s\n0,\0\n", "line 2: is a binary file"),
    ],
)
def test_what_is_no_table(tmp_path, content, says):
    (tmp_path / "ref.csv").write_text(content)
    line = refused(tmp_path)
    assert says in line
    assert re.search(r"scenario\.yaml:\d+: reference\.q\[0\]\.csv", line)


@pytest.mark.parametrize(
    "file", ["../ref.csv", "/etc/hostname", "a/../../ref.csv", "a/../ref.csv", "link.csv", "up/ref.csv"]
)
def test_nothing_outside_the_folder_is_read(tmp_path, file):
    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "ref.csv").write_text(GOOD)
    (inside / "ref.csv").write_text(GOOD)
    os.symlink(tmp_path / "ref.csv", inside / "link.csv")
    os.symlink(tmp_path, inside / "up")
    assert "is outside, allowed: a file in the scenario's own folder or below it" in refused(
        inside, file=file
    )


@pytest.mark.parametrize("time_s", [(-0.5, 0.5), (0.0, 0.0), (0.0, 1e9)])
def test_times_before_the_flight_or_twice_the_same_are_refused(time_s):
    with pytest.raises(PydanticCustomError, match="contradictory"):
        check_table(time_s, (1.0, 2.0))
