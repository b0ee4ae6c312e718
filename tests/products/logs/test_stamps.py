"""A log whose clock jumps: a gap costs nothing, and what is left out is said."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.diagnose import diagnose
from beaver_ftc_logs.findings import as_text, verdict_document
from beaver_ftc_logs.readers.topics import rows_with_increasing_time
from products.logs import limited, synthetic

JUMP_S = 1e6
ROWS = 1500


def fast(jump_s=JUMP_S, seed=5):
    """A flight at 50 Hz, so that it is averaged, whose clock jumps in the middle."""
    columns = synthetic.fly(ROWS / synthetic.RATE_HZ, seed=seed)
    columns["t_s"] = columns["t_s"] / 5.0
    columns["t_s"][ROWS // 2 :] += jump_s
    return columns


WRITERS = {
    "parquet": (synthetic.VEHICLE, synthetic.write_parquet),
    "ulg": (synthetic.vehicle("vehicle_rates"), synthetic.write_ulog),
    "bin": (synthetic.vehicle("RATE", synthetic.SHORT), synthetic.write_rates),
}


def test_of_rows_with_one_stamp_the_first_is_kept():
    assert rows_with_increasing_time("x", np.array([0.0, 1.0, 1.0, 2.0]))[0].tolist() == [0, 1, 3]


def test_a_jump_of_the_clock_costs_no_memory(tmp_path):
    """Every reader through both commands, in one process of 3 GB: the jump in the time base alone wants 4."""
    pytest.importorskip("pyulog"), pytest.importorskip("pymavlink")
    flights = [("alfa", synthetic.write_alfa(tmp_path / "alfa", columns=fast()))]
    for suffix, (vehicle, write) in WRITERS.items():
        (tmp_path / f"{suffix}.yaml").write_text(vehicle)
        flights.append((tmp_path / f"{suffix}.yaml", write(tmp_path / f"flight.{suffix}", fast())))
    commands = []
    for number, (vehicle, log) in enumerate(flights):
        model, out = tmp_path / f"{number}.json", tmp_path / f"out-{number}"
        commands.append(["identify", log, "--vehicle", vehicle, "--out", model])
        commands.append(["diagnose", log, "--model", model, "--out", out])
    statuses, said = limited.run(commands)
    assert statuses == [0] * 8, said


def test_a_gap_is_a_gap_however_long(sampled, wing_model):
    """The same flight with 10 s and with 10,000 missing: the same samples, and the same of each said."""
    rows = []
    for jump_s in (10.0, 1e4):
        samples = sampled(columns=fast(jump_s))
        model = wing_model.model_copy(update={"rate_hz": 20.0})
        rows.append((samples, diagnose(samples, model)))
        text = as_text(verdict_document(samples, model, rows[-1][1]))
        assert text.splitlines()[0].endswith(" in 30 s, 1 gap in the log left out")
    (one, said), (other, said_too) = rows
    assert one.stretch_number[0] == 0
    assert one.stretch_number[-1] == 1
    np.testing.assert_array_equal(one.stretch_number, other.stretch_number)
    np.testing.assert_allclose(one.rates, other.rates, atol=1e-12)
    np.testing.assert_allclose(said.fault_probability, said_too.fault_probability, atol=1e-9)


def test_a_time_in_another_unit_is_told(sampled):
    """In units of 1e9 s the flight lasts no time at all."""
    columns = fast(0.0)
    columns["t_s"] = columns["t_s"] * 1e-9
    with pytest.raises(BadInput, match=r"logged at 5e\+10 Hz, allowed: up to 100000 Hz, time in seconds"):
        sampled(columns=columns)


def test_no_row_more_than_needed_is_left_out():
    """Against all subsequences of short logs."""
    rng = np.random.default_rng(2)
    for _ in range(200):
        t_s = rng.integers(0, 8, 8).astype(float)
        kept, _ = rows_with_increasing_time("x", t_s)
        assert (np.diff(t_s[kept]) > 0).all()
        masks = ((np.arange(256)[:, None] >> np.arange(8)) & 1).astype(bool)
        longest = max(mask.sum() for mask in masks if (np.diff(t_s[mask]) > 0).all())
        assert len(kept) == longest
