"""`identify --check`, tables as people write them, and mis-scaled logs, through the command."""

import json

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.vehicle import load_vehicle
from products.logs import synthetic
from products.logs.small import run
from products.logs.test_signals import T_S, turning

PHI, THETA, RATES = turning()
KINEMATIC = {
    "t_s": T_S, "p_rad_s": RATES[0], "q_rad_s": RATES[1], "r_rad_s": RATES[2],
    "roll_cmd": 0.3 * np.sin(T_S), "pitch_cmd": 0.2 * np.cos(1.3 * T_S), "roll_rad": PHI, "pitch_rad": THETA,
    "az_m_s2": -9.8 + 0.1 * np.sin(2.0 * T_S),
}  # fmt: skip


def logged(path, names=None, factors=None, delimiter=",", comma=False, above=()):
    """The kinematic flight as somebody else writes it."""
    names, factors = names or {}, factors or {}
    rows = np.column_stack([values * factors.get(name, 1.0) for name, values in KINEMATIC.items()])
    lines = [*above, delimiter.join(names.get(name, name) for name in KINEMATIC)]
    lines += [delimiter.join(f"{cell:.9g}" for cell in row) for row in rows]
    text = "\n".join(lines) + "\n"
    path.write_text(text.replace(".", ",") if comma else text)
    return path


def test_a_strangers_log_is_told_and_gets_a_vehicle_file(tmp_path):
    names = {"t_s": "TimeUS", "p_rad_s": "GyrX", "q_rad_s": "GyrY", "r_rad_s": "GyrZ"}
    factors = dict.fromkeys(names, 57.29578) | {"t_s": 1e6}
    path = logged(tmp_path / "their log.csv", names, factors, ";", True, ("a logger", "v2"))
    out = tmp_path / "their.yaml"
    done = run("identify", "--check", path, "--out", out)
    assert done.exit_code == 0
    for said in (
        "time is in column TimeUS, its steps fit us", "names are in line 3",
        "semicolons, with a decimal comma", "1200 samples at 20 Hz", "they agree",
    ):  # fmt: skip
        assert said in done.stdout
    vehicle = load_vehicle(out)
    assert (vehicle.time.column, vehicle.time.unit) == ("TimeUS", "us")
    assert vehicle.rates.p.unit == "deg/s"
    assert vehicle.command_columns == ["roll_cmd", "pitch_cmd"]
    again = json.loads(run("identify", "--check", path, "--vehicle", out, "--format", "json").stdout)
    assert again["logs"][0]["usable"]
    assert again["vehicle"] is None


@pytest.mark.parametrize(("factors", "says"), [
    ({"p_rad_s": 57.29578, "q_rad_s": 57.29578, "r_rad_s": 57.29578}, "p_rad_s is in deg/s"),
    ({"t_s": 1e-3}, "is time in another unit?"),
])  # fmt: skip
def test_a_mis_scaled_column_is_refused_with_the_factor_that_fits(tmp_path, factors, says):
    (tmp_path / "v.yaml").write_text(
        "name: k\nrates: {p: p_rad_s, q: q_rad_s, r: r_rad_s}\ncommands: [roll_cmd, pitch_cmd]\n"
        "surfaces: {a: {roll_cmd: 1}, e: {pitch_cmd: 1}}\nattitude: {roll: roll_rad, pitch: pitch_rad}\n"
        "acceleration: az_m_s2\n"
    )
    path = logged(tmp_path / "k.csv", factors=factors)
    done = run("identify", "--check", path, "--vehicle", tmp_path / "v.yaml")
    assert done.exit_code == 2
    assert says in done.stdout
    with pytest.raises(BadInput, match="k: ") as error:
        run("identify", path, "--vehicle", tmp_path / "v.yaml", "--out", tmp_path / "m.json")
    assert says in str(error.value)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize(("keys", "says"), [
    ("rates: {p: {column: a, unit: deg}, q: b, r: c}", "rates.p.unit: 'deg' is no unit of it, allowed:"),
    ("rates: {p: {column: a, scale: 0}, q: b, r: c}", "rates.p.scale: 0 leaves nothing of the column"),
    ("rates: {p: a, q: {column: a, unit: deg/s}, r: c}", "rates.q: 'a' is read in two ways"),
    ("rates: {p: a, q: b, r: c}\ntime: {column: t, unit: min}", "time.unit: 'min' is not known, allowed: s,"),
])  # fmt: skip
def test_a_mistaken_unit_is_a_line(tmp_path, keys, says):
    (tmp_path / "v.yaml").write_text(f"name: w\n{keys}\ncommands: [u]\nsurfaces: {{x: {{u: 1}}}}\n")
    with pytest.raises(BadInput) as error:
        load_vehicle(tmp_path / "v.yaml")
    assert says in str(error.value)


def test_the_sample_logs_are_followed_from_check_to_diagnosis(tmp_path):
    """The whole way of the page: the weak elevon is named, and nothing before it."""
    run("new", "mine", "--log", "--out", tmp_path)
    folder = tmp_path / "mine"
    vehicle, model = folder / "vehicle.yaml", folder / "model.json"
    checked = run("identify", "--check", folder / "healthy.csv", "--vehicle", vehicle)
    assert "they agree" in checked.stdout
    run("identify", folder / "healthy.csv", "--vehicle", vehicle, "--out", model)
    done = run(
        "diagnose", folder / "suspect.csv", "--model", model, "--out", tmp_path / "out", "--format", "json"
    )
    (verdict,) = json.loads(done.stdout)["flights"]
    assert verdict["credible"]["share"] > 0.99
    assert [event["named"] for event in verdict["events"]] == ["unknown", "left"]
    assert 90.0 < verdict["events"][0]["from_s"] < 110.0
    with pytest.raises(BadInput, match="exists, allowed: another name"):
        run("new", "mine", "--log", "--out", tmp_path)
    with pytest.raises(BadInput, match="--like and --log are given"):
        run("new", "other", "--log", "--like", "fault-free")


def test_what_cannot_be_checked_is_a_line(tmp_path):
    (tmp_path / "folder.csv").mkdir()
    logged(tmp_path / "k.csv")
    synthetic.write_csv(tmp_path / "bare.csv", {"t_s": T_S, "height": T_S})
    logged(tmp_path / "dead.csv", factors={"q_rad_s": 0.0})
    for name, more, says in (
        ("none.csv", (), "no such file or folder"), ("none.xyz", (), "no such file or folder"),
        ("folder.csv", (), "no mavros-imu-data_raw topic"),
        ("folder.csv", ("--reader", "table"), "is a directory"),
        ("k.csv", ("--reader", "what"), "--reader what: is not known"),
    ):  # fmt: skip
        with pytest.raises(BadInput, match=says) as error:
            run("identify", "--check", tmp_path / name, *more)
        assert len(str(error.value).splitlines()) == 1
    for name, says in (
        ("bare", "no column looks like the rate p"),
        ("dead", "rate q does not move: nothing can"),
    ):
        done = run("identify", "--check", tmp_path / f"{name}.csv")
        assert (done.exit_code, says in done.stdout) == (2, True)
