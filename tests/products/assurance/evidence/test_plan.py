"""Plans: what they may name, and every mistake in a line with its place."""

import shutil

import pytest

import beaver_ftc as bf
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.builtin import builtin_plans
from beaver_ftc_assurance.evidence.plan import load_plan
from given import given

GIVEN = given(__file__)

GOOD = """\
name: mine
flights:
  own: {duration_s: 2}
  many:
    base: elevator-stuck
    vary: {"faults[0].position_deg": {linspace: [-2, 2, 3]}}
requirements:
  - {id: A, over: [own, many, elevator-stuck], expect: {no_departure: true}}
  - {id: B, over: [many, deeper/also.yaml], formula: "always(abs(q_rad_s) <= 1)"}
  - {id: C, over: [own], bar: {type: margins}}
"""


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deeper").mkdir()
    (tmp_path / "deeper" / "also.yaml").write_text("name: also\\nduration_s: 3\\n".replace("\\n", "\n"))

    def written(text):
        (tmp_path / "plan.yaml").write_text(text)
        return "plan.yaml"

    return written


def test_a_plan_names_its_own_flights_built_in_ones_and_files_beside_it(write):
    plan = load_plan(write(GOOD))
    assert plan.over == {"A": ("own", "many", "elevator-stuck"), "B": ("many", "also"), "C": ("own",)}
    assert plan.cases == [
        ("own", 0),
        ("many", 0),
        ("many", 1),
        ("many", 2),
        ("elevator-stuck", 0),
        ("also", 0),
    ]
    assert [plan.sources["many"].flight(run) for run in range(3)] == ["many-0000", "many-0001", "many-0002"]
    assert plan.sources["many"].scenario(2).faults[0].position_deg == 2
    assert plan.sources["also"].scenario(0).duration_s == 3
    assert [each.id for each in plan.of("many")] == ["A", "B"]
    assert plan.formulas["B"].columns == {"q_rad_s"}
    assert plan.expect["A"].no_departure is True


MISTAKES = GIVEN["mistakes"]  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_a_line_with_its_place(mistake, write):
    before, after, line = MISTAKES[mistake]
    assert before in GOOD
    text = GOOD.replace(before, after)
    if mistake == "unused":
        text = text.replace("[many, deeper", "[deeper")
    with pytest.raises(BadInput) as error:
        load_plan(write(text))
    assert f"plan.yaml:{line}" in str(error.value)


def test_a_mistake_in_a_file_that_is_named_is_in_that_file(write, tmp_path):
    (tmp_path / "deeper" / "also.yaml").write_text("name: also\nduration: 3\n")
    with pytest.raises(BadInput, match=r"^.*deeper/also.yaml:2: duration: unknown key"):
        load_plan(write(GOOD))


@pytest.mark.parametrize(
    "text", ["", "[]", "name: x", "requirements: []", "requirements: [{}]", "a: !!python/name:os.system"]
)
def test_no_plan_is_a_line(text, write):
    with pytest.raises(BadInput) as error:
        load_plan(write(text))
    assert all(line.startswith("plan.yaml:") for line in str(error.value).splitlines())


def test_the_plans_that_come_with_the_project_are_right():
    for name in builtin_plans():
        plan = load_plan(name)
        assert plan.file.name == name
        assert all(each.text and each.clause for each in plan.file.requirements)


def test_a_change_in_the_files_of_an_own_aircraft_changes_the_hash(write, tmp_path):
    model = shutil.copytree(bf.aircraft("beaver").folder, tmp_path / "mine") / "beaver.xml"
    swept = "{base: {aircraft: ./mine}, vary: {initial.airspeed_mps: {linspace: [44, 46, 2]}}}"
    own = f"{{own: {{aircraft: ./mine}}, swept: {swept}}}"
    text = f"flights: {own}\nrequirements: [{{id: A, over: [own, swept], expect: {{no_departure: true}}}}]"
    sources = load_plan(write(text)).sources.values()
    before = [source.sha256 for source in sources]
    model.write_text(model.read_text() + "\n")
    assert all(source.sha256 != then for source, then in zip(sources, before, strict=True))
