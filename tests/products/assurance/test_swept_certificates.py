"""Certificates of the flights that a sweep keeps."""

import json

import pyarrow.parquet as pq
import yaml

from beaver_ftc.scenario.sweeps import load_sweep
from beaver_ftc.studies.sweep import campaign
from beaver_ftc.studies.sweep.campaign import Options, run_sweep
from beaver_ftc.studies.sweep.one_flight import Keep
from beaver_ftc_assurance.certificates.check_certificate import failures

SWEPT = {
    "base": {
        "name": "short",
        "duration_s": 0.6,
        "faults": [{"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.5, "at_s": 0.3}],
    },
    "runs": 4,
    "sampling": "sobol",
    "vary": {"faults[0].magnitude": {"uniform": [0.2, 0.9]}},
}


def test_the_flights_kept_have_their_certificates_if_asked(tmp_path, monkeypatch):
    monkeypatch.setattr(campaign, "cores", lambda: 1)
    (tmp_path / "brief.yaml").write_text(yaml.safe_dump(SWEPT))
    kept = Keep("selected", frozenset({1}), certified=True)
    run_sweep(load_sweep(tmp_path / "brief.yaml"), Options(out=tmp_path, keep=kept, report=False))
    (folder,) = tmp_path.glob("*/flights/*")
    certificate = json.loads((folder / "certificate.json").read_text())
    table = pq.read_table(folder / "log.parquet")
    log = {name: table[name].to_numpy() for name in table.column_names}
    assert log["detected"].any()
    assert [*failures(certificate, log, (folder / "scenario.yaml").read_text())] == []
    assert certificate["statements"]
