"""A dumped scenario is complete, and is the scenario."""

import pytest

from beaver_ftc.scenario.dump import to_yaml
from beaver_ftc.scenario.schema import Scenario, load, load_scenario, load_text

from .drawn import COUNT, scenarios


@pytest.mark.parametrize("number", range(COUNT))
def test_a_dump_loads_as_the_same_scenario(number):
    scenario = Scenario.model_validate(scenarios()[number])
    text = to_yaml(scenario)
    assert load_text(text) == scenario
    assert to_yaml(load_text(text)) == text


@pytest.mark.parametrize("text", ["*\x85", "a\u2028b", "\u2029"])
def test_line_separators_of_unicode_come_back(text):
    scenario = load({"name": "a", "description": text})
    assert load_text(to_yaml(scenario)).description == text


def test_a_dump_flies_without_its_table_s_file(tmp_path):
    (tmp_path / "ref.csv").write_text("t_s,rate_deg_s\n0,0\n1,2\n")
    path = tmp_path / "s.yaml"
    path.write_text("name: x\nreference: {p: [{csv: {file: ref.csv}}]}\n")
    scenario = load_scenario(path)
    assert load_text(to_yaml(scenario)) == scenario


def test_the_largest_table_dumps_to_a_scenario_that_still_loads(tmp_path):
    rows = "".join(f"{i / 100},{0.1234567 * (i % 7)}\n" for i in range(20_000))
    (tmp_path / "ref.csv").write_text("t_s,rate_deg_s\n" + rows)
    path = tmp_path / "s.yaml"
    path.write_text("name: x\nreference: {p: [{csv: {file: ref.csv}}], q: [{csv: {file: ref.csv}}]}\n")
    scenario = load_scenario(path)
    assert load_text(to_yaml(scenario)) == scenario
