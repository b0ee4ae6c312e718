import pytest

from beaver_ftc.documents.dotted import parse_key, with_values
from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.scenario.airframe import checked_against
from beaver_ftc.scenario.builtin import builtin_sweeps
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sweeps import load_sweep
from beaver_ftc.studies.sweep.sampling import Plan


@pytest.mark.parametrize("name", builtin_sweeps())
def test_built_in_sweeps_load_and_say_what_they_show(name):
    sweep = load_sweep(name)
    assert sweep.name == name
    assert sweep.flights >= 100
    assert sweep.file.description


@pytest.mark.parametrize("name", builtin_sweeps())
def test_sections_read_once_make_the_scenario_that_reading_everything_makes(name):
    sweep = load_sweep(name)
    (assignment,) = Plan(sweep).assignments([7])
    places = {parse_key(key): value for key, value in assignment.values.items()}
    with checked_against(sweep.aircraft, sweep.base.get("aircraft")):
        expected = Scenario.model_validate(with_values(sweep.base, places))
    made = sweep.scenario(assignment.values)
    assert made == expected
    assert made.model_dump(mode="json", exclude_unset=True) == expected.model_dump(
        mode="json", exclude_unset=True
    )


def test_a_base_beside_the_file_brings_its_tables_along(tmp_path):
    (tmp_path / "rates.csv").write_text("t_s,rate_deg_s\n0,0\n1,2\n")
    (tmp_path / "base.yaml").write_text("name: own\nreference: {q: [{csv: {file: rates.csv}}]}\n")
    (tmp_path / "many.sweep.yaml").write_text("base: base.yaml\nruns: 2\n")
    sweep = load_sweep(tmp_path / "many.sweep.yaml")
    assert sweep.name == "many"
    for path in tmp_path.iterdir():
        path.unlink()
    assert sweep.scenario({}).reference.q[0].shape.values_deg_s == (0.0, 2.0)


@pytest.mark.parametrize(
    "base", ["../outside.yaml", "{outside}", "below/link.yaml", "below/../../outside.yaml"]
)
def test_a_base_stays_in_the_folder_of_its_sweep(tmp_path, base):
    outside, folder = tmp_path / "outside.yaml", tmp_path / "sweeps"
    (folder / "below").mkdir(parents=True)
    outside.write_text("name: outside\nduration_s: 5\n")
    (folder / "below" / "link.yaml").symlink_to(outside)
    (folder / "many.yaml").write_text(f"base: {base.format(outside=outside)}\nruns: 2\n")
    with pytest.raises(
        ScenarioError, match=r"many\.yaml:1: base: .* is outside, allowed: a file in the sweep"
    ):
        load_sweep(folder / "many.yaml")
