"""The public interface: the documented text runs as it stands, quickly, and says what is wrong by its key."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.aircraft import Aircraft
from beaver_ftc.plant.linear import LinearModel
from flying import loss, scenario

ROOT = Path(__file__).parents[1]


def test_the_exclusion_by_hand_is_that_of_the_diagnosis(capsys):
    """The last Python text of the section on the diagnosis alone, as it stands."""
    text = (ROOT / "docs/reference/python.md").read_text(encoding="utf-8")
    section = text.partition("## The diagnosis alone")[2]
    shown = {}
    exec(re.search(r"```python\n(.*?)```", section, re.DOTALL).group(1), shown)
    log = shown["log"]
    row = int(log["detected"].to_numpy().argmax())
    assert shown["diagnosis"].t_s == pytest.approx(log["t_s"][row])
    flags = {name: bool(log[f"fie_{name}_excluded"][row]) for name in ("aileron", "elevator", "rudder")}
    assert {name: shown["excluded"][name] for name in flags} == flags
    assert flags == {"aileron": True, "elevator": False, "rudder": True}
    assert "'elevator': False" in capsys.readouterr().out


def test_every_public_name_is_there():
    assert set(bf.__all__) <= set(dir(bf))
    for name in bf.__all__:
        assert getattr(bf, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'flyy'"):
        _ = bf.flyy


class TestAircraft:
    def test_is_the_function_whatever_has_been_imported(self):
        import beaver_ftc.aircraft

        assert beaver_ftc.aircraft("beaver") is bf.aircraft("beaver")
        assert isinstance(bf.aircraft("beaver"), Aircraft)

    def test_another_name_is_refused(self):
        with pytest.raises(bf.BadInput, match="'beavr' is not known, did you mean beaver"):
            bf.aircraft("beavr")


class TestTrimAndLinearise:
    def test_a_trim_is_where_the_flight_starts(self):
        point = bf.trim("elevator-partial-loss")
        start = bf.fly("elevator-partial-loss").log.iloc[0]
        assert start["elevator_cmd_rad"] == point.elevator_rad
        assert start["alpha_rad"] == pytest.approx(point.alpha_rad, abs=1e-12)
        assert max(map(abs, point.residual)) < 1e-8

    def test_another_condition_by_keyword(self):
        assert bf.trim(airspeed_mps=38.0).airspeed_mps == 38.0
        with pytest.raises(bf.BadInput, match=r"^initial\.airspeed_kt: unknown key, did you mean"):
            bf.trim(airspeed_kt=90)

    def test_the_linear_model_predicts_a_small_step(self):
        """Half a second after a nudge of the elevator, against the truth itself."""
        model = bf.linearise()
        assert isinstance(model, LinearModel)
        still = {"name": "still", "duration_s": 1.0, "rate_hz": 500}
        sims = [bf.Simulation(still), bf.Simulation(still)]
        for sim, nudge in zip(sims, (0.0, 1e-3), strict=True):
            sim.step(sim.trim_rad + np.array([0.0, nudge, 0.0, 0.0]), frames=251)
        moved = sims[1]["velocities/q-rad_sec"] - sims[0]["velocities/q-rad_sec"]
        x = np.zeros(10)
        for _ in range(250):
            x += (model.A @ x + model.B[:, 1] * 1e-3) / 500
        np.testing.assert_allclose(x[model.states.index("q")], moved, rtol=0.02)

    def test_as_python_control_has_it(self):
        control = pytest.importorskip("control")
        model = bf.linearise(airspeed_mps=45.0)
        system = model.state_space()
        assert isinstance(system, control.StateSpace)
        np.testing.assert_array_equal(system.A, model.A)
        assert system.input_labels == ["aileron_rad", "elevator_rad", "rudder_rad", "flap_rad"]
        assert system.state_labels[:3] == ["airspeed_mps", "alpha_rad", "beta_rad"]


VARY = {"faults[0].magnitude": {"uniform": [0.2, 1.0]}, "initial.airspeed_mps": {"choice": [40, 45]}}


@pytest.fixture(scope="module")
def base():
    return scenario(duration_s=2.0, faults=[loss(at_s=1.0)])


@pytest.fixture(scope="module")
def table(base):
    return bf.sweep(base, vary=VARY, runs=6)


class TestSweep:
    def test_knows_its_units_and_what_varied(self, table):
        assert table.attrs["units"]["tracking.post_fault_rms_deg_s.q"] == "deg/s"
        assert table.attrs["units"]["detection.delay_s"] == "s"
        assert table.attrs["vary"]["faults[0].magnitude"] == {"uniform": [0.2, 1.0]}

    @pytest.mark.parametrize(
        ("keys", "says"),
        [
            ({"vary": {"faults[0].magnitud": {"uniform": [0.2, 1.0]}}, "runs": 2}, "magnitud"),
            ({"vary": {"faults[0].magnitude": {"uniform": [0.2, 3.0]}}, "runs": 2}, "is out of range"),
            ({"vary": {"faults[0].magnitude": {"unifrom": [0.2, 1.0]}}, "runs": 2}, "did you mean uniform"),
            ({"vary": {"faults[0].magnitude": {"uniform": [0.2, 1.0]}}}, "runs: required key is missing"),
            ({"vary": {}, "runs": 0}, "runs: 0 is out of range"),
        ],
    )
    def test_a_mistake_is_named_by_its_key(self, base, keys, says):
        with pytest.raises(bf.BadInput, match=re.escape(says)):
            bf.sweep(base, **keys)

    def test_workers_do_not_run_an_unguarded_script_again(self, tmp_path):
        script = tmp_path / "study.py"
        script.write_text(
            "import beaver_ftc as bf\n"
            "print('started')\n"
            "base = bf.load('elevator-partial-loss').with_({'duration_s': 13.0})\n"
            "vary = {'faults[0].magnitude': {'uniform': [0.2, 1.0]}}\n"
            "print(len(bf.sweep(base, vary=vary, runs=3, workers=2)), 'study' in __file__)\n"
        )
        done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
        assert done.stdout.split() == ["started", "3", "True"], done.stderr


@pytest.mark.parametrize(
    "mistaken",
    [
        lambda: bf.load("fault-free").with_(None),
        lambda: bf.load("fault-free").with_([1]),
        lambda: bf.aircraft(None),
        lambda: bf.open_run(None),
        lambda: bf.sweep("fault-free", {"initial.airspeed_mps": {"uniform": [40, 50]}}, 2, workers=0),
        lambda: bf.sweep("fault-free", {"initial.airspeed_mps": {"uniform": [40, 50]}}, 2, workers="a"),
    ],
)
def test_what_is_of_another_type_is_bad_input(mistaken):
    with pytest.raises(bf.BadInput, match="allowed: "):
        mistaken()
