"""A flight by steps of all lengths across small chunks of its log, and what is said of it on the way."""

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.loop import loop, simulation
from flying import loss, same_log, scenario

SECOND = {"duration_s": 1.0, "faults": [loss(at_s=0.305)]}
# Frames of each step, the stick's pitch rate meanwhile (rad/s), and what is done after it.
SCRIPT = [
    (1, 0.02, None), (5, None, None), (9, 0.01, None), (1, 0.01, "land"), (20, -0.01, "jam"),
    (16, None, "log"), (4, 0.03, "mend"), (28, 0.03, None), (3, None, "land"), (50, 0.005, None),
]  # fmt: skip


def _flown(sim):
    """The flight by the script; the rows of each step."""
    pieces = []
    for frames, rate, then in SCRIPT:
        sim.step(frames=np.int64(frames), stick=None if rate is None else (0.0, rate, 0.0))
        pieces.append(sim.rows.copy())
        assert np.array_equal(sim.values, pieces[-1][-1], equal_nan=True)
        if then == "jam":
            sim.inject({"type": "stuck", "actuator": "rudder"})
        elif then == "mend":
            sim.repair("rudder")
        elif then:
            getattr(sim, then) if then == "log" else sim.land()
    return pieces


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(simulation, "CHUNK_ROWS", 16)
    monkeypatch.setattr(loop, "CHUNK_ROWS", 16)


def test_steps_across_chunks(small, monkeypatch, tmp_path):
    """The same with chunks of 16 rows and of 8192, and flown again, from its file too; each step's rows are
    those of the log; the stick adds."""
    sim = bf.Simulation(scenario(**SECOND))
    pieces = _flown(sim)
    assert sim.done
    assert not sim.departed
    assert sim.frames == 100
    assert sim.t_s == pytest.approx(0.99)
    assert [len(piece) for piece in pieces] == [2, 5, 9, 1, 20, 16, 4, 28, 3, 12]
    log = sim.log
    assert np.array_equal(np.concatenate(pieces), log, equal_nan=True)
    plain = bf.fly(scenario(**SECOND)).log
    added = np.concatenate([[0.0], *(np.full(n, rate or 0.0) for n, rate, _ in SCRIPT)])[:100]
    found = log["q_reference_rad_s"] - plain["q_reference_rad_s"]
    assert found.to_numpy() == pytest.approx(added, abs=1e-15)
    again = bf.fly(sim.scenario_flown())
    assert same_log(again.log, log)
    assert again.metrics == sim.land().metrics
    folder = sim.save(tmp_path, report=False)
    assert same_log(bf.fly(folder / "scenario.yaml").log, bf.open_run(folder).log)
    monkeypatch.undo()
    other = bf.Simulation(scenario(**SECOND))
    _flown(other)
    assert same_log(other.log, log)
    assert other.land().metrics == sim.land().metrics
