import pytest
from pydantic import ValidationError

from beaver_ftc.documents.validation import ScenarioError, parse_key, with_values
from beaver_ftc.scenario.airframe import checked_against
from beaver_ftc.scenario.builtin import builtin_sweeps
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sweeps import SweepFile, load_sweep, load_sweep_text
from beaver_ftc.studies.sweep.sampling import Plan

HEAD = "base: elevator-partial-loss\nruns: 3\nvary:\n  "
SPEED = "vary.initial.airspeed_mps"


@pytest.mark.parametrize(
    ("text", "line", "key", "says"),
    [
        (HEAD + "faults[0].magnitude: {uniform: [0.1, 1.5]}", 4, "vary.faults[0].magnitude", "1.5 is out"),
        (HEAD + "faults[1].magnitude: {uniform: [0.1, 1]}", 4, "vary.faults[1].magnitude", "no faults[1]"),
        (HEAD + "initial.airspeed: {uniform: [40, 50]}", 4, "vary.initial.airspeed", "airspeed_mps?"),
        (HEAD + "initial.airspeed_mps: {uniform: [50, 40]}", 4, SPEED + ".uniform", "out of order"),
        (HEAD + "initial.airspeed_mps: {}", 4, SPEED, "exactly one of"),
        (HEAD + "initial.airspeed_mps: {loguniform: [0, 4]}", 4, SPEED + ".loguniform", "over 0"),
        (HEAD + "seed: {choice: [1, 2]}", 4, "vary.seed", "follows from the sweep's seed"),
        (HEAD + "faults[0].at_s: {normal: [40, 1]}", 4, "vary.faults[0].at_s", "after the end"),
        (HEAD + "actuators.bandwidth_rad_s: {choice: [-1]}", 4, "vary.actuators.bandwidth_rad_s", "out of"),
        (HEAD + "..: {choice: [1]}", 4, "vary...", "is no dotted key"),
        (
            HEAD + "faults[0].at_s: {choice: [1]}\n  faults: {choice: [[]]}",
            5, "vary.faults", "varied twice",
        ),
        ("base: elevator\nruns: 1", 1, "base", "no such file or built-in scenario"),
        ("base: nothing/here.yaml\nruns: 1", 1, "base", "no such file"),
        ("base:\n  duration_s: -1\nruns: 1", 2, "base.duration_s", "-1 is out of range"),
        ("base: fault-free\nset: {duration: 3}\nruns: 1", 2, "set.duration", "did you mean duration_s?"),
        ("base: fault-free", 1, "runs", "required key is missing"),
        ("base: fault-free\nruns: 2\nexpect: {detection_rate: {}}", 3, "expect.detection_rate", "bounds"),
        ("base: fault-free\nruns: 2\nsamplings: lhs", 3, "samplings", "did you mean sampling?"),
        (
            "base: fault-free\nsampling: grid\nvary: {initial.airspeed_mps: {uniform: [40, 50]}}",
            3, SPEED, "cannot be counted",
        ),
    ],
)  # fmt: skip
def test_a_mistake_is_named_with_its_line(text, line, key, says):
    with pytest.raises(ScenarioError) as caught:
        load_sweep_text(text, "sweep.yaml")
    messages = [str(entry) for entry in caught.value.lines]
    assert any(entry.startswith(f"sweep.yaml:{line}: {key}") and says in entry for entry in messages), (
        messages
    )
    assert caught.value.exit_code == 2


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


@pytest.mark.parametrize(
    ("given", "flights"),
    [
        ({"vary": {"a": {"linspace": (1, 2, 5)}, "b": {"uniform": (1, 2)}}}, 5),
        ({"vary": {"a": {"linspace": (1, 2, 5)}, "b": {"choice": (1, 2)}}}, 5),
        ({"sampling": "grid", "vary": {"a": {"linspace": (1, 2, 5)}, "b": {"choice": (1, 2)}}}, 10),
        ({"runs": 7, "sampling": "grid", "vary": {"a": {"linspace": (1, 2, 5)}}}, 7),
    ],
)
def test_a_grid_gives_the_number_of_flights_unless_it_is_said(given, flights):
    assert SweepFile.model_validate({"name": "grid", "base": "fault-free", **given}).flights == flights


def test_without_a_grid_the_number_of_flights_is_asked_for_and_a_huge_one_is_refused():
    huge = {"a": {"linspace": (1, 2, 1_000_000)}, "b": {"linspace": (1, 2, 11)}}
    for vary in ({"a": {"uniform": (1, 2)}}, huge):
        with pytest.raises(ValidationError, match="contradictory"):
            SweepFile.model_validate({"name": "grid", "base": "fault-free", "vary": vary})
