"""Scenarios and their changes from Python: as from a file, and mistakes named by their keys."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

import beaver_ftc as bf
from beaver_ftc.scenario.builtin import builtin_names, builtin_path
from beaver_ftc.scenario.dump import to_yaml


class TestLoad:
    @pytest.mark.parametrize("name", ["elevator-partial-loss", "unanticipated"])
    def test_a_name_a_path_and_a_mapping_are_the_same(self, name):
        if name not in builtin_names():
            pytest.skip(f"there is no {name}")
        path = builtin_path(name)
        mapping = yaml.safe_load(path.read_text(encoding="utf-8"))
        assert bf.load(name) == bf.load(path) == bf.load(str(path)) == bf.load(mapping)

    def test_a_table_is_beside_whoever_calls(self, tmp_path, monkeypatch):
        (tmp_path / "rates.csv").write_text("t_s,rate_deg_s\n0,0\n1,2\n", encoding="utf-8")
        monkeypatch.chdir(tmp_path)
        scenario = bf.load({"reference": {"p": [{"csv": {"file": "rates.csv"}}]}})
        assert scenario.reference.p[0].csv.values_deg_s == (0.0, 2.0)

    @pytest.mark.parametrize(
        ("given", "says"),
        [
            ("elevator-partial-los", "did you mean elevator-partial-loss"),
            (Path("nowhere.yaml"), "nowhere.yaml: no such file"),
            ({"durations_s": 3}, "^durations_s: unknown key, did you mean duration_s"),
            (
                {"initial": {"airspeed_kt": 90}},
                "^initial.airspeed_kt: unknown key, did you mean airspeed_mps",
            ),
            ({"initial": {"airspeed_mps": "45"}}, "^initial.airspeed_mps: '45' is text"),
            (7, "^7 is no scenario"),
        ],
    )
    def test_a_mistake_is_one_line_with_the_key(self, given, says):
        with pytest.raises(bf.BadInput, match=says) as raised:
            bf.load(given)
        assert len(str(raised.value).splitlines()) == 1


class TestWith:
    @pytest.mark.parametrize("name", builtin_names())
    def test_nothing_changed_is_the_same(self, name):
        scenario = bf.load(name)
        assert scenario.with_({}) == scenario
        assert to_yaml(scenario.with_({})) == to_yaml(scenario)

    def test_new_values_at_dotted_keys(self):
        scenario = bf.load("elevator-partial-loss")
        other = scenario.with_(
            {
                "faults[0].magnitude": np.float32(0.25),
                "sensors.p.noise_std_deg_s": 0.001,
                "fdi.bounds.inertia": 0.1,
                "faults[0]": {"type": "stuck", "actuator": "flap", "at_s": 2},
            }
        )
        assert (other.faults[0].type, other.fdi.bounds.inertia) == ("stuck", 0.1)
        assert other.sensors.p.noise_std_deg_s == 0.001
        assert scenario.faults[0].magnitude == 0.4

    @pytest.mark.parametrize(
        ("changes", "says"),
        [
            ({"faults[0].magnitud": 0.2}, r"^faults\[0\].magnitud: unknown key, did you mean magnitude"),
            ({"faults[0].magnitude": 20}, r"^faults\[0\].magnitude: 20 is out of range, allowed: .* 0 to 1"),
            ({"faults[0].magnitude": "0.2"}, r"^faults\[0\].magnitude: '0.2' is text"),
            ({"faults[3].magnitude": 0.2}, r"^faults\[3\].magnitude: .* allowed: \[0\] to \[0\]"),
            ({"initial.airspeed_kt": 90}, "^initial.airspeed_kt: unknown key, did you mean airspeed_mps"),
            ({"duration_s": 5}, r"^faults\[0\].at_s: 12 is after the end"),
            ({"..": 1}, r"^\.\.: is no dotted key"),
            ({3: 1}, "^3: is no dotted key"),
        ],
    )
    def test_a_mistake_names_the_key(self, changes, says):
        with pytest.raises(bf.BadInput, match=says):
            bf.load("elevator-partial-loss").with_(changes)


class TestAnAircraftBesideTheScenario:
    @pytest.fixture
    def written(self, tmp_path):
        shutil.copytree(bf.aircraft("beaver").folder, tmp_path / "my-uav")
        data = {"name": "mine", "aircraft": "./my-uav", "duration_s": 1.0}
        (tmp_path / "mine.yaml").write_text(yaml.dump(data), encoding="utf-8")
        return bf.load(tmp_path / "mine.yaml")

    def test_is_found_again_by_the_scenario_flown(self, written, tmp_path):
        sim = bf.Simulation(written)
        sim.step(frames=20)
        sim.inject({"type": "stuck", "actuator": "rudder"})
        sim.step(frames=20)
        assert sim.scenario_flown().airframe.folder == tmp_path / "my-uav"
        assert bf.fly(sim.scenario_flown()).log.equals(sim.log)
