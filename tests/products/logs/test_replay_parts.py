"""What a replay says of verdicts, and of what stands beside the log: by verdicts made by hand."""

from types import SimpleNamespace

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import replay as of
from beaver_ftc_logs import stepped
from products.logs import synthetic

SURFACES = ["aileron", "elevator", "rudder", "flap"]


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
