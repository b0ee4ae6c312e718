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


@pytest.mark.parametrize("fdi", [{"is_ours": False}, {"pairs": True}])
def test_verdicts_of_pairs_or_of_another_scheme_bound_nothing(fdi):
    columns = columns_of(**fdi)
    for name in SURFACES:
        assert (columns[f"{name}_low"], columns[f"{name}_high"]) == ([0.0] * 12, [1.0] * 12)
    assert columns["elevator_effectiveness"] == pytest.approx([1, 1, 0.6, *[1] * 6, 0.1, 0.9, 1])


def test_a_loss_is_bounded_by_the_frames_of_the_last_second():
    """By trying each theta, at 3 samples a second: 1 + theta of what explains this frame and the two before;
    0 and 1 where nothing does. The first sample ends no frame, whatever stands there."""
    planted = np.array([3.0, -0.5, -0.42, -0.61, -0.95, -0.55])
    bound = np.array(
        [[0.1] * 3, [0.05, 0.07, 0.2], [0.06, 0.1, 0.1], [0.08, 0.07, 0.2], [0.1] * 3, [0.09] * 3]
    )
    effect = np.zeros((6, 3, 2))
    effect[:, :, 0], effect[:, 1, 1] = [[0.5, -0.6, 0.1]], [0.4, -0.4, 0.8, 0.9, -0.5, 0.7]
    nu = planted[:, None] * effect[:, :, 0]
    shown, samples = [], [np.arange(6.0 * n).reshape(6, n) for n in (3, 5, 2, 3)]

    def step(*sample):
        shown.append(sample)
        return f"verdict {len(shown)}"

    diagnosis = SimpleNamespace(
        step=step, innovation=lambda: tuple(of[len(shown) - 1] for of in (nu, bound, effect))
    )
    found = stepped.replay_samples(diagnosis, samples, 3.0)
    assert found.verdicts == [f"verdict {k}" for k in range(1, 7)]
    for k, sample in enumerate(shown):
        assert [part.tolist() for part in sample] == [of[k].tolist() for of in samples]
    assert found.command_gain_bounds.tolist() == [1.0, 1.0]
    thetas, bounded = np.linspace(-1.0, 0.0, 2001), 0
    for k in range(6):
        for s in range(2):
            explains = np.ones(len(thetas), bool)
            for j in range(max(k - 2, 1), k + 1):
                left = np.abs(nu[j] - thetas[:, None] * effect[j, :, s]) - bound[j]
                explains &= (left <= 1e-9).all(axis=1)
            ends = 1.0 + thetas[explains][[0, -1]] if explains.any() else (0.0, 1.0)
            bounded += 0.0 < ends[0] < ends[1] < 1.0
            assert (
                found.alone_low[k, s],
                found.alone_high[k, s],
            ) == pytest.approx(ends, abs=1e-3)
    assert bounded > 2


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


def test_what_is_withdrawn_is_not_what_is_named():
    """The name that stands at the end, since it has stood there."""
    assert of._last_isolation(T_S[:4], SAID[:4]) == (1.5, "rudder")
    assert of._last_isolation(T_S[:5], SAID[:5]) == (1.5, "rudder")
    assert of._last_isolation(T_S[:5], [*SAID[:4], Verdict(True)]) == (None, None)
    again = [SAID[0], SAID[2], SAID[1], SAID[2], SAID[2]]
    assert of._last_isolation(T_S[:5], again) == (1.5, "elevator")


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


def test_errors_of_the_flow_sensors_are_left_out():
    """Those of the gyros are in the measured rates."""
    flawed = scenario(alpha={"bias_deg": 0.1}, q={"bias_deg_s": 0.1})
    assert of._lacking_inputs(flawed) == ["the declared errors of alpha: the log has the true value"]


FOUND = {
    "flight": "one", "detection_s": 5.126, "isolation_s": 6.5, "isolated": "rudder", "as_flown": True,
    "left_out": [],
}  # fmt: skip


def test_a_replay_in_words():
    assert of.as_text(FOUND) == "one: detected at 5.13 s, rudder isolated at 6.50 s; as flown"
    other = FOUND | {"isolated": None, "as_flown": False, "left_out": ["this", "that"]}
    assert of.as_text(other).splitlines() == [
        "one: detected at 5.13 s; not as flown", "  left out: this", "  left out: that",
    ]  # fmt: skip
    nothing = FOUND | {"detection_s": None, "isolated": None, "as_flown": None}
    assert of.as_text(nothing) == "one: nothing detected; nothing beside it to compare with"


def test_a_log_of_ours_stands_beside_its_scenario(tmp_path):
    path = tmp_path / "log.parquet"
    assert not of.is_log_of_run(path)
    (tmp_path / "scenario.yaml").write_text("")
    assert of.is_log_of_run(path)
    assert not of.is_log_of_run(tmp_path / "other.parquet")


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
