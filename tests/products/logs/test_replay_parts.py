"""What a replay says of verdicts, and of what stands beside the log: by verdicts made by hand."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.diagnosis import Verdict
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.schema import Sensors
from beaver_ftc_logs import replay as of
from beaver_ftc_logs import stepped
from products.logs import synthetic

SURFACES = ["aileron", "elevator", "rudder", "flap"]
SAID = [
    Verdict(),
    Verdict(True),
    Verdict(True, isolated="elevator", type="loss_of_effectiveness", estimate=-0.4),
    Verdict(True, isolated="rudder", estimate=-0.25),
    Verdict(True, isolated="rudder", type="jam", estimate=-0.25),
    Verdict(True, isolated="aileron", type="loss_of_effectiveness"),
    Verdict(True, isolated="unanticipated"),
]
T_S = np.arange(len(SAID)) * 0.5

# With what candidates and estimates beyond the bounds say; bounds of single faults that differ in each row.
SAYS = [
    *SAID,
    Verdict(True, candidates=("flap", "elevator")),
    Verdict(True, candidates=("elevator", "unanticipated")),
    Verdict(True, isolated="elevator", type="loss_of_effectiveness", estimate=-0.9),
    Verdict(True, isolated="elevator", type="loss_of_effectiveness", estimate=-0.1),
    Verdict(True, candidates=tuple(SURFACES)),
]
ROW = np.arange(len(SAYS))
ALONE = (
    np.array([0.9, 0.5, 0.7, 0.4]) - 0.01 * ROW[:, None],
    np.array([0.97, 0.7, 0.8, 0.95]) + 0.001 * ROW[:, None],
)
BOUNDS = {  # low and high of each row
    "aileron": ([0.9, 0, 1, 1, 1, 0.85, 0, 1, 0, 1, 1, 0.79], [1, 1, 1, 1, 1, 0.975, *[1] * 6]),
    "elevator": (
        [0.5, 0, 0.48, 1, 1, 1, 0, 0.43, 0, 0.41, 0.4, 0.39], [1, 1, 0.702, 1, 1, 1, 1, 1, 1, 0.709, 0.71, 1],
    ),
    "rudder": ([0.7, 0, 1, 0, 0, 1, 0, 1, 0, 1, 1, 0.59], [1] * 12),
    "flap": ([0.4, 0, 1, 1, 1, 1, 0, 0.33, 0, 1, 1, 0.29], [1] * 12),
}  # fmt: skip


def columns_of(is_ours=True, pairs=False):
    fdi = SimpleNamespace(is_ours=is_ours, pairs=pairs)
    rows = stepped.rows_of_replay(
        0.5 * ROW, stepped.Replayed(SAYS, *ALONE, np.ones(4), np.ones(4)), SURFACES, fdi
    )
    return {name: list(values) for name, values in of.diagnosis_columns(rows, SURFACES).items()}


def test_verdicts_as_columns():
    columns = columns_of()
    assert list(columns) == [
        "t_s", "faulty", "named",
        *(f"{name}_{what}" for name in SURFACES for what in ("effectiveness", "low", "high")), "credible",
    ]  # fmt: skip
    assert columns["t_s"] == [0.5 * k for k in range(12)]
    assert columns["faulty"] == [0] + [1] * 11
    assert columns["named"] == [
        "", "unknown", "elevator", "rudder", "rudder", "aileron", *["unknown"] * 3, "elevator", "elevator",
        "unknown",
    ]  # fmt: skip
    assert columns["elevator_effectiveness"] == pytest.approx([1, 1, 0.6, *[1] * 6, 0.41, 0.71, 1])
    assert columns["rudder_effectiveness"] == [1, 1, 1, 0.75, *[1] * 8]
    assert columns["aileron_effectiveness"] == columns["flap_effectiveness"] == [1] * 12
    for name, (low, high) in BOUNDS.items():
        assert columns[f"{name}_low"] == pytest.approx(low), name
        assert columns[f"{name}_high"] == pytest.approx(high), name
    assert columns["credible"] == [1] * 12


def scenario(**sensors):
    return SimpleNamespace(name="one", sensors=Sensors.model_validate(sensors))


@pytest.mark.parametrize(("beside", "as_flown"), [
    (None, None), ((0.5, 3.0), True), ((0.5 + 1e-12, 3.0 - 1e-12), True), ((0.5, 1.0), False),
    ((1.0, 3.0), False), ((None, None), False), ((0.5, None), False),
])  # fmt: skip
def test_whether_a_replay_is_as_flown(tmp_path, beside, as_flown):
    if beside is not None:
        found = {"detection": {"time_s": beside[0]}, "isolation": {"time_s": beside[1]}}
        document = found | {"flight": {}, "tracking": {}}
        (tmp_path / "metrics.json").write_text(json.dumps(document))
    log = {"t_s": T_S, "detected": np.array([1, 1, 0, 1, 1, 1, 1])}
    assert of._replay_verdict(tmp_path / "log.parquet", scenario(), log, SAID) == {
        "flight": "one", "replay": True, "duration_s": 3.0, "faulty": True, "detection_s": 0.5,
        "isolation_s": 3.0, "isolated": "unanticipated", "rows_that_differ": 2, "left_out": [],
        "as_flown": as_flown, "credible": {"share": 1.0, "reasons": []},
    }  # fmt: skip


def test_a_replay_that_finds_nothing(tmp_path):
    found = of._replay_verdict(
        tmp_path / "log.parquet", scenario(), {"t_s": T_S[:2] + 1.0}, [Verdict(), Verdict()]
    )
    assert (found["faulty"], found["detection_s"], found["isolation_s"], found["isolated"]) == (
        False,
        None,
        None,
        None,
    )
    assert (found["duration_s"], found["rows_that_differ"]) == (0.5, 0)


def test_columns_that_a_log_must_have(tmp_path):
    path = synthetic.write_parquet(
        tmp_path / "log.parquet", {"t_s": [0.0, 1.0], "a": [1.0, 2.0], "b": [3.0, 4.0]}
    )
    assert {name: values.tolist() for name, values in of._read_columns(path, ["t_s", "b"]).items()} == {
        "t_s": [0.0, 1.0],
        "b": [3.0, 4.0],
    }
    with pytest.raises(BadInput, match=r"no column c, allowed: a log\.parquet as `run` writes it"):
        of._read_columns(path, ["t_s", "c"])
    aircraft = SimpleNamespace(signals=["dpt"], surfaces=SURFACES)
    assert stepped.input_columns(aircraft) == (
        ["p_measured_rad_s", "q_measured_rad_s", "r_measured_rad_s"],
        ["alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", "dpt"],
        [f"{name}_cmd_rad" for name in SURFACES],
        ["phi_rad", "theta_rad", "psi_rad"],
    )
