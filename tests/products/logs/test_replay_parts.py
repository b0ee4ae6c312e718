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
