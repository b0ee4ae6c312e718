"""`identify --check`, tables as people write them, and mis-scaled logs, through the command."""

import json

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from beaver_ftc.cli.main import app
from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import check, physics
from beaver_ftc_logs.check import _guess_angle_unit
from beaver_ftc_logs.mixing import Mixing
from beaver_ftc_logs.readers import read_flight
from beaver_ftc_logs.recording import Column, RecordedFlight
from beaver_ftc_logs.units import nearest_unit
from beaver_ftc_logs.vehicle import load_vehicle
from products.logs import limited, synthetic
from products.logs.test_signals import T_S, turning, yawed

PHI, THETA, RATES = turning()
KINEMATIC = {
    "t_s": T_S, "p_rad_s": RATES[0], "q_rad_s": RATES[1], "r_rad_s": RATES[2],
    "roll_cmd": 0.3 * np.sin(T_S), "pitch_cmd": 0.2 * np.cos(1.3 * T_S), "roll_rad": PHI, "pitch_rad": THETA,
    "az_m_s2": -9.8 + 0.1 * np.sin(2.0 * T_S),
}  # fmt: skip


def run(*arguments):
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done


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


@pytest.mark.parametrize(("time", "rates"), [
    ("Time [ms]", "sensor_combined.gyro_rad[{}]"),
    ("time (ms)", "Gyro {} [rad/s]"),
    ("t_ms", "vehicle_attitude.{}speed"),
    ("Time / ms", "control_state.{}_rate"),
    ("Timestamp [ms]", "{} rate [rad/s]"),
])  # fmt: skip
def test_names_that_loggers_write_are_found(tmp_path, time, rates):
    words = (0, 1, 2) if "[{}]" in rates else "xyz" if "Gyro" in rates else ("roll", "pitch", "yaw")
    names = {f"{axis}_rad_s": rates.format(word) for axis, word in zip("pqr", words, strict=True)}
    path = logged(tmp_path / "named.csv", names | {"t_s": time}, {"t_s": 1e3})
    told = json.loads(run("identify", "--check", path, "--format", "json").stdout)
    assert told["logs"][0]["usable"]
    assert told["vehicle"]["time"] == {"column": time, "unit": "ms"}
    assert list(told["vehicle"]["rates"].values()) == [names["p_rad_s"], names["q_rad_s"], names["r_rad_s"]]
    head, *rows = path.read_text().splitlines()
    lines = [f"{head},t_s", *(f"{row},{float(row.split(',')[0]) / 1e3:.9g}" for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    told = json.loads(run("identify", "--check", path, "--format", "json").stdout)
    assert "time" not in told["vehicle"]  # ours, which comes before any other


@pytest.mark.parametrize(("factors", "says"), [
    ({"p_rad_s": 57.29578, "q_rad_s": 57.29578, "r_rad_s": 57.29578}, "p_rad_s is in deg/s"),
    ({"roll_rad": 57.29578}, "roll_rad is in deg"),
    ({"az_m_s2": 1 / 9.80665}, "it is in g, a factor of 9.807 fits"),
    ({"p_rad_s": -1.0}, "one of them has the other sign"),
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


@pytest.fixture
def whole_log(tmp_path):
    """The flight with a gap of 3 s, angles in degrees, a gyro that reads 1.1 and two that read 0.8 times."""
    (tmp_path / "k.yaml").write_text(
        "name: k\nrates: {p: gx, q: gy, r: gz}\ncommands: [roll_cmd, pitch_cmd]\n"
        "surfaces: {a: {roll_cmd: 1}, e: {pitch_cmd: 1}}\n"
        "attitude: {roll: {column: phi, unit: deg}, pitch: {column: theta, unit: deg}, "
        "yaw: {column: psi, unit: deg}}\nacceleration: az_m_s2\n"
    )
    columns = dict(KINEMATIC)
    angles = dict(zip(("phi", "theta", "psi"), np.rad2deg([PHI, THETA, yawed()]), strict=True))
    rates = dict(zip(("gx", "gy", "gz"), RATES * [[1.1], [0.8], [0.8]], strict=True))
    for name in ("p_rad_s", "q_rad_s", "r_rad_s", "roll_rad", "pitch_rad"):
        del columns[name]
    kept = (T_S < 20.0) | (T_S >= 22.95)
    return {name: values[kept] for name, values in (columns | angles | rates).items()}, tmp_path


def of_level_nose(line, columns):
    """The line that is to be found, where a log has no pitch angle: by sums over windows of a second."""
    if line not in ("roll by p alone", "yaw of a level nose"):
        return line
    t_s, roll = columns["t_s"], np.deg2rad(columns["phi"])
    of, by = ("phi", "gx") if line.startswith("roll") else ("psi", "gz")
    rate = columns["gx"] if by == "gx" else columns["gy"] * np.sin(roll) + columns["gz"] * np.cos(roll)
    changes, sums = [], []
    for k in range(0, len(t_s) - 20, 20):
        if t_s[k + 20] - t_s[k] < 2.0:
            changes.append((columns[of][k + 20] - columns[of][k] + 180.0) % 360.0 - 180.0)
            sums.append(np.trapezoid(rate[k : k + 21], t_s[k : k + 21]))
    changes, sums = np.deg2rad(changes), np.array(sums)
    slope = np.linalg.norm(changes) / np.linalg.norm(sums)
    correlation = changes @ sums / np.linalg.norm(changes) / np.linalg.norm(sums)
    how = f"{slope:.3f} times the integral of {by} (correlation {correlation:.2f}): they agree"
    return f"the change of {of} is {how}"


SIZE_TEXT = "1141 samples at 20 Hz over 59.95 s; gaps: 1, the longest of 3 s"


@pytest.mark.parametrize(("change", "lines"), [
    ({}, [
        "the change of phi is 0.909 times the integral of gx (correlation 1.00): they agree",
        "the change of theta is 1.250 times the integral of gy (correlation 1.00): they agree",
        "the change of psi is 1.250 times the integral of gz (correlation 1.00): they agree",
    ]),
    ({"theta": None, "psi": None, "phi": None},
     ["no roll angle is named: whether the rates are in rad/s is not checked"]),
    ({"phi": 0.0, "theta": None, "psi": None}, ["too little moves to compare the rates with the roll angle"]),
    ({"theta": None, "psi": None}, ["roll by p alone"]),
    ({"theta": None}, ["roll by p alone", "yaw of a level nose"]),
    ({"phi": None}, ["no roll angle is named: whether the rates are in rad/s is not checked"]),
])  # fmt: skip
def test_what_a_check_says_of_a_log_whole(whole_log, change, lines):
    columns, folder = whole_log
    for name, factor in change.items():
        columns[name] = np.full(len(columns[name]), factor) if factor is not None else None
    columns = {name: values for name, values in columns.items() if values is not None}
    lines = [of_level_nose(line, columns) for line in lines]
    path, vehicle = synthetic.write_csv(folder / "k.csv", columns), load_vehicle(folder / "k.yaml")
    assert check.check_log(path, vehicle, None) == {
        "log": str(path), "usable": True, "lines": [SIZE_TEXT, *lines], "vehicle": None,
    }  # fmt: skip
    head = f"{path}: can be used"
    assert check.as_text(check.check_log(path, vehicle, None)).splitlines() == [
        head, *(f"  {line}" for line in [SIZE_TEXT, *lines]),
    ]  # fmt: skip


def test_a_rate_without_some_numbers_that_does_not_move_is_told_after_the_other_remarks(whole_log):
    columns, folder = whole_log
    columns["gz"] = np.full(len(columns["gz"]), 0.25)
    columns["gz"][[3, 9]] = np.nan
    del columns["phi"]
    path = synthetic.write_csv(folder / "k.csv", columns)
    found = check.check_log(path, load_vehicle(folder / "k.yaml"), None)
    assert (found["usable"], found["lines"]) == (False, [
        SIZE_TEXT,
        "gz: rows without a number: 2 of 1141",
        "gz: frozen, the same to the last bit for 59.5 s",
        "gz: clipped at 0.25 in 1129 rows",
        "no roll angle is named: whether the rates are in rad/s is not checked",
        "rate r does not move: nothing can be identified or diagnosed",
    ])  # fmt: skip
    assert check.as_text(found).startswith(f"{path}: cannot be used so\n  {SIZE_TEXT}\n")


def test_of_several_logs_each_is_told_and_the_first_guess_is_proposed(tmp_path):
    """Of one nothing is guessed, two are read by the reader that is asked for; one that cannot be used is
    enough for a status of its own."""
    none = synthetic.write_csv(
        tmp_path / "none.xyz", {"t_s": T_S, "p": RATES[0], "q": RATES[1], "r": RATES[2]}
    )
    good = logged(tmp_path / "good.xyz")
    other = logged(tmp_path / "other.xyz", names={"roll_cmd": "aileron_cmd"})
    out = tmp_path / "below" / "proposed.yaml"
    asked = ["identify", "--check", "--reader", "table"]
    done = run(*asked, none, good, other, "--out", out)
    assert done.exit_code == 2
    lines = done.stdout.splitlines()
    assert [lines[0], lines[2]] == [f"{none}: cannot be used so", f"{good}: can be used"]
    assert lines[1].startswith(f"  {none}: no column is known to carry the command of a surface, allowed: ")
    assert lines[1].endswith("surfaces: {elevator: {COLUMN: 1}}; the log has p, q, r")
    assert lines[-1] == f"vehicle file: {out}"
    assert f"{other}: can be used" in lines
    assert list(yaml.safe_load(out.read_text())["surfaces"]) == [
        "roll_cmd",
        "pitch_cmd",
    ]  # those of the first
    document = json.loads(run(*asked, none, good, other, "--format", "json").stdout)
    assert [(one["log"], one["usable"]) for one in document["logs"]] == [
        (str(none), False), (str(good), True), (str(other), True),
    ]  # fmt: skip
    assert document["vehicle"] == document["logs"][1]["vehicle"]
    assert document["vehicle"]["name"] == "good"
    assert document["logs"][2]["vehicle"]["surfaces"] == {
        "aileron_cmd": {"aileron_cmd": 1.0}, "pitch_cmd": {"pitch_cmd": 1.0},
    }  # fmt: skip
    assert run(*asked, good, other, "--vehicle", out).exit_code == 2  # of one a command is missing
    assert run(*asked, good).exit_code == 0
    with pytest.raises(BadInput, match=r"^identify: --check --out: a vehicle file is given already$"):
        run(*asked, good, "--vehicle", out, "--out", tmp_path / "new.yaml")


def test_a_proposed_vehicle_file_says_what_was_found_and_which_keys_there_are_besides(tmp_path):
    path = logged(tmp_path / "good.csv")
    told = json.loads(run("identify", "--check", path, "--format", "json").stdout)["vehicle"]
    assert told == {
        "name": "good", "reader": "table", "rates": {axis: f"{axis}_rad_s" for axis in "pqr"},
        "commands": ["roll_cmd", "pitch_cmd"],
        "surfaces": {"roll_cmd": {"roll_cmd": 1.0}, "pitch_cmd": {"pitch_cmd": 1.0}},
        "attitude": {"roll": "roll_rad", "pitch": "pitch_rad"}, "acceleration": "az_m_s2",
    }  # fmt: skip
    text = check.vehicle_file_text(told)
    assert text in run("identify", "--check", path).stdout
    assert yaml.safe_load(text) == told
    keys = [line[2:].partition(":")[0] for line in text[text.index("# Further keys:") :].splitlines()[1:]]
    assert keys == [
        "time", "signals", "labels", "airspeed", "energy", "flow", "full_deflection_rad",
        "reference_airspeed_mps", "airspeed_powers", "outputs", "false_alarms_per_hour", "faults",
        "other_laws", "moving_air", "max_rate_hz",
    ]  # fmt: skip


@pytest.mark.parametrize("rates", [1.0, 180.0 / np.pi, 1000.0])
@pytest.mark.parametrize("angles", [1.0, 180.0 / np.pi, 18000.0 / np.pi])
def test_the_unit_of_rates_is_told_by_the_roll_angle_whatever_its_unit(rates, angles):
    """Against the name of the first rate, which says another."""
    columns = {name: Column(T_S, rates * one) for name, one in zip(("dps", "y", "z"), RATES, strict=True)}
    unit = check._guess_rate_unit(
        RecordedFlight("log", columns), list(columns), Column(T_S, angles * PHI), 1.0 / angles
    )
    assert unit == {1.0: "rad/s", 1000.0: "mrad/s"}.get(rates, "deg/s")


def test_a_log_whose_gyro_is_dead_cannot_be_used(tmp_path):
    done = run("identify", "--check", logged(tmp_path / "k.csv", factors={"q_rad_s": 0.0}))
    assert done.exit_code == 2
    assert "rate q does not move: nothing can be identified or diagnosed" in done.stdout


def test_a_log_without_rates_names_what_it_has(tmp_path):
    path = synthetic.write_csv(
        tmp_path / "a.csv", {"t_s": T_S, "height": T_S, **{f"c{i}": T_S for i in range(30)}}
    )
    done = run("identify", "--check", path)
    assert done.exit_code == 2
    assert "no column looks like the rate p" in done.stdout


def test_identify_without_check_wants_vehicle_and_out(tmp_path):
    path = logged(tmp_path / "k.csv")
    with pytest.raises(BadInput, match="--vehicle is missing"):
        run("identify", path)
    with pytest.raises(BadInput, match="--out is missing"):
        run("identify", path, "--vehicle", "alfa")
    (tmp_path / "there.yaml").write_text("")
    with pytest.raises(BadInput, match=r"there.yaml exists, allowed: another name"):
        run("identify", "--check", path, "--out", tmp_path / "there.yaml")


@pytest.mark.parametrize(("change", "notes"), [
    (lambda t: [x.replace(",", ";") for x in t], ["cells are parted by semicolons"]),
    (lambda t: [x.replace(",", ";").replace(".", ",") for x in t],
     ["cells are parted by semicolons, with a decimal comma"]),
    (lambda t: [x.replace(",", "\t") for x in t], ["cells are parted by tabs"]),
    (lambda t: ["logger 3", "", *t], ["names are in line 3, what is above is left out"]),
    (lambda t: [t[0], "s,rad/s" + ",1" * 6, *t[1:]], ["t_s: rows without a number, left out: 1 of 201"]),
    (lambda t: [*t[:7], t[7] + ",3", *t[8:], "1,2"], ["lines with too few or too many cells, left out: 1"]),
])  # fmt: skip
def test_tables_as_people_write_them(tmp_path, change, notes):
    plain = synthetic.write_csv(tmp_path / "plain.csv", synthetic.fly(20.0))
    other = tmp_path / "other.csv"
    other.write_text("\n".join(change(plain.read_text().splitlines()[:-1])) + "\n")
    read, expected = read_flight(other), read_flight(plain)
    assert set(notes) <= set(read.notes) or notes[0][:40] in "".join(read.notes)
    column, same = read.columns["q_rad_s"], expected.columns["q_rad_s"]
    np.testing.assert_array_equal(column.values, same.values[np.isin(same.t_s, column.t_s)])
    assert len(column.values) >= 198


def test_an_err_in_a_cell_is_that_cell_and_no_more(tmp_path):
    lines = synthetic.write_csv(tmp_path / "a.csv", synthetic.fly(20.0)).read_text().splitlines()
    cells = lines[9].split(",")
    lines[9] = ",".join([cells[0], "ERR", *cells[2:]])
    lines[12] = ",".join([(cells := lines[12].split(","))[0], "NA", *cells[2:]])  # missing, and no text
    (tmp_path / "b.csv").write_text("\n".join(lines) + "\n")
    column = read_flight(tmp_path / "b.csv").columns["p_rad_s"]
    assert np.flatnonzero(np.isnan(column.values)).tolist() == [8, 11]
    assert column.note == "p_rad_s: 1 cell holds no number, the first in row 9: 'ERR'"


@pytest.mark.parametrize(("content", "says"), [
    (b"0.0,1.0\n0.1,2.0\n", "its first line holds numbers and no names"),
    (bytes(range(256)), "it holds bytes that are no text"),
    ("t_s,p\n1,2\n".encode("utf-16"), "is written in UTF-16"),
    (b"a line\nanother\n", "no line of names with a line of as many numbers below it"),
    (b"t_s,p\n1,2\n1,2,3\n1\n", "2 of 3 lines have another number of cells than the header"),
])  # fmt: skip
def test_no_table_says_what_was_found(tmp_path, content, says):
    (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(BadInput, match=says):
        read_flight(tmp_path / "a.csv")


def test_a_jump_of_a_million_seconds_needs_little_memory(tmp_path):
    """In 3 GB of address space, as a process of its own."""
    vehicle = tmp_path / "wing.yaml"
    vehicle.write_text(synthetic.VEHICLE)
    columns = synthetic.fly(240.0)
    columns["t_s"][1200:] += 1e6
    path = synthetic.write_csv(tmp_path / "jump.csv", columns)
    statuses, said = limited.run([["identify", "--check", path, "--vehicle", vehicle]])
    assert (statuses, said) == ([0], "")


def test_of_a_wide_table_only_what_the_vehicle_names_is_read(tmp_path):
    path = synthetic.write_csv(tmp_path / "a.csv", synthetic.fly(20.0))
    columns = read_flight(path, columns=["p_rad_s"]).columns
    assert np.isfinite(columns["p_rad_s"].values).all()
    assert np.isnan(columns["q_rad_s"].values).all()
    assert columns["q_rad_s"].values.strides == (0,)  # one number stands for all


def test_columns_of_a_vehicle_have_units_scale_and_offset(tmp_path):
    (tmp_path / "v.yaml").write_text(
        "name: w\ntime: {column: ms, unit: ms}\n"
        "rates: {p: {column: gx, unit: deg/s, scale: 0.1}, q: gy, r: gz}\n"
        "commands: [{column: pwm, scale: 0.0025, offset: -3.75}, {column: share, unit: '%'}]\n"
        "surfaces: {a: {pwm: 1}, e: {share: 1}}\n"
    )
    from beaver_ftc_logs.samples import load_flights_for_fit

    n = 200
    rng = np.random.default_rng(1)
    spread = {"gx": 30.0, "gy": 1.0, "gz": 1.0, "pwm": 50.0, "share": 20.0}
    columns = {name: rng.normal(0.0, sd, n) for name, sd in spread.items()}
    columns = {"ms": np.arange(n) * 100.0, **columns, "pwm": 1500.0 + columns["pwm"]}
    (samples,) = load_flights_for_fit(
        [synthetic.write_csv(tmp_path / "a.csv", columns)], load_vehicle(tmp_path / "v.yaml")
    )
    assert samples.dt_s == pytest.approx(0.1)
    np.testing.assert_allclose(samples.rates[:, 0], np.deg2rad(0.1 * columns["gx"]))
    np.testing.assert_allclose(samples.commands[:, 0], (columns["pwm"] - 1500.0) / 400.0, atol=1e-12)
    np.testing.assert_allclose(samples.commands[:, 1], columns["share"] / 100.0)


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


def test_a_log_that_says_its_time_itself_is_asked_for_no_other(tmp_path):
    (tmp_path / "a.log").write_text("")
    with pytest.raises(BadInput, match="time: t in s is not its time, allowed: TimeUS in us"):
        read_flight(tmp_path / "a.log", None, ("t", "s"))


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


def test_a_path_that_cannot_be_checked_is_a_line(tmp_path):
    (tmp_path / "folder.csv").mkdir()
    for name, says in (
        ("none.csv", "no such file or folder"),
        ("folder.csv", r"no mavros-imu-data_raw topic|is a directory"),
        ("none.xyz", "no such file or folder"),
    ):
        with pytest.raises(BadInput, match=says) as error:
            run("identify", "--check", tmp_path / name)
        assert len(str(error.value).splitlines()) == 1
    with pytest.raises(BadInput, match="is a directory"):
        run("identify", "--check", tmp_path / "folder.csv", "--reader", "table")
    with pytest.raises(BadInput, match="--reader what: is not known"):
        run("identify", "--check", logged(tmp_path / "k.csv"), "--reader", "what")


@pytest.mark.parametrize(("name", "kind", "size", "unit"), [
    ("ATT.Roll", "ardupilot", 3.0, "deg"), ("roll_deg", "table", 3.0, "deg"), ("roll", "table", 40.0, "deg"),
    ("roll", "table", 3.0, "rad"),
])  # fmt: skip
def test_the_unit_of_a_small_roll_angle_is_told_by_its_log_or_name(name, kind, size, unit):
    assert _guess_angle_unit(name, Column(T_S, size * np.sin(T_S)), kind) == unit


def test_angles_and_rates_scaled_alike_are_found_by_the_pitch_angle():
    """No ratio tells; that no pitch angle passes a right angle does."""
    t_s = np.arange(200) * 0.05
    for factor, unit in ((180.0 / np.pi, "deg"), (18000.0 / np.pi, "cdeg")):
        pitch = Column(t_s, factor * 0.2 * np.sin(t_s))
        says = physics.pitch_remark(pitch, "theta")
        assert says is not None
        assert f"it is in {unit}, a factor of {1.0 / factor:.4g} fits" in says
    assert physics.pitch_remark(Column(t_s, 1.6 * np.sin(t_s)), "theta") is None


def held(value, n=60):
    return Column(np.arange(n) * 0.05, np.append(np.full(n - 1, float(value)), np.nan))


@pytest.mark.parametrize(("name", "size", "unit"), [
    ("gyro_dps", 1.0, "deg/s"), ("p_rad_s", 99.0, "rad/s"), ("P_Deg_s", 1.0, "deg/s"), ("wx", 12.0, "rad/s"),
    ("wx", -12.1, "deg/s"),
])  # fmt: skip
def test_the_unit_of_rates_is_told_by_the_first_name_or_the_largest_of_all(name, size, unit):
    columns = {name: held(0.1), "wy": held(size), "wz": held(0.2)}
    assert check._guess_rate_unit(RecordedFlight("log", columns), list(columns), held(0.3), 1.0) == unit


@pytest.mark.parametrize(("values", "found"), [
    ([1100, 1500, np.nan, 1900], {"column": "u", "scale": 0.0025, "offset": -3.75}), ([700.0], "u"),
    ([701.0], {"column": "u", "scale": 0.0025, "offset": -3.75}), ([2300.0], "u"), ([-10.0, 3.0], "u"),
    ([-10.1, 3.0], {"column": "u", "unit": "%"}), ([105.0], {"column": "u", "unit": "%"}), ([105.1], "u"),
])  # fmt: skip
def test_commands_are_pulses_per_cent_or_shares(values, found):
    assert check._pulse_entry("u", np.array(values, dtype=float)) == found


def test_names_as_the_patterns_have_them():
    spelled = {
        " Roll Rate [deg/s] ": "roll_rate_deg_s", "gyro_rad[0]": "gyro_rad[0]", "Time (ms)": "time_ms",
        "a / b": "a_b",
    }  # fmt: skip
    assert {name: check._snake_case(name) for name in spelled} == spelled
    plain = {"my log/2": "my_log_2", "__": "log", "a" * 101: "a" * 100, "_b-1_": "b-1"}
    assert {name: check._plain_name(name) for name in plain} == plain
    rates = ["gyro_x_cmd", "IMU.GyrX", "rolling", "gyro_x", "GyrX"]
    assert check._shortest_match(check._NAME_PATTERNS["p"], rates) == "GyrX"
    assert check._shortest_match(check._NAME_PATTERNS["p"], ["zyro_x", "xgyro_x", "agyro_x"]) == "agyro_x"
    assert check._shortest_match(check._NAME_PATTERNS["p"], ["agyro_x", "zgyro_x", "GyrX"]) == "GyrX"
    assert check._shortest_match(check._NAME_PATTERNS["p"], ["a_gyro_x", "gyro_x"]) == "gyro_x"
    assert check._shortest_match(check._NAME_PATTERNS["r"], rates) is None
    wide = [*(f"x{k}" for k in range(9)), "p", *(f"servo{k}" for k in range(70))]
    assert check._likely_columns(wide) == ["p", *(f"servo{k}" for k in range(59))]


@pytest.mark.parametrize(("correlation", "says"), [
    (0.7, "tell nothing of one another"), (0.71, "agree"), (-0.71, "agree"), (-0.7, "tell nothing"),
])  # fmt: skip
def test_rate_and_angle_agree_from_seven_tenths_on(correlation, says):
    said = check._fit_text(physics.AngleFit(1.25, correlation, 9, 2.0, 3.0), "roll", "p")
    told = f"the change of roll is 1.250 times the integral of p (correlation {correlation:.2f}): they {says}"
    assert said.startswith(told)


@pytest.mark.parametrize(("text", "found", "lines"), [
    ("t_s,p\n0,1\n0.25,1\n0.5,1\n", ("t_s", "s"), []),
    ("time_ms,t_s,p\n0,7,1\n20,7,2\n40,7,3\n", ("time_ms", "ms"),
     ["time is in column time_ms, its steps fit ms"]),
    ("p,Time\n1,5\n2,505\n3,1005\n", ("Time", "us"), ["time is in column Time, its steps fit us"]),
    ("t_s,p\n0,1\n20,1\n40,1\n", ("t_s", "ms"), ["time is in column t_s, its steps fit ms"]),
    ("t_s,p\n0,1\n0.251,1\n0.502,1\n", None, None), ("t_s,p\n0,1\n", None, None),
])  # fmt: skip
def test_time_is_the_column_whose_steps_fit_a_log(tmp_path, text, found, lines):
    path, said = tmp_path / "log.csv", []
    path.write_text(text)
    if found is None:
        with pytest.raises(BadInput, match=r"no column of time, allowed: a table with t_s in seconds"):
            check._find_time(path, said)
        return
    assert (check._find_time(path, said), said) == (found, lines)


@pytest.mark.parametrize(("down", "acceleration"), [
    (-1.02, {"column": "az", "unit": "g"}), (9.7, "az"), (0.0, None), (100.0, None),
    (-32.0, {"column": "az", "unit": "ft/s2"}),
])  # fmt: skip
def test_a_vehicle_file_is_proposed_of_what_was_found(down, acceleration):
    of = {
        "wx": 0.1, "wy": 20.0, "wz": 0.3, "roll_deg": 3.0, "pitch": 2.0, "az": down, "V": 20.0, "u 1": 0.4,
    }  # fmt: skip
    log = RecordedFlight("log", {name: held(value) for name, value in of.items()})
    found = {
        "p": "wx",
        "q": "wy",
        "r": "wz",
        "roll": "roll_deg",
        "pitch": "pitch",
        "az": "az",
        "airspeed": "V",
    }
    mixing = Mixing({"u 1": "u 1"}, {"u_1": {"u 1": 1.0}})
    known = {} if acceleration is None else {"acceleration": acceleration}
    assert check._propose_vehicle("my log", log, "table", ("time_ms", "ms"), found, mixing) == {
        "name": "my_log", "reader": "table", "time": {"column": "time_ms", "unit": "ms"},
        "rates": {axis: {"column": found[axis], "unit": "deg/s"} for axis in "pqr"},
        "commands": ["u 1"], "surfaces": {"u_1": {"u 1": 1.0}},
        "attitude": {axis: {"column": found[axis], "unit": "deg"} for axis in ("roll", "pitch")},
        **known, "airspeed": "V",
    }  # fmt: skip
    bare = found | {"roll": None, "az": None, "airspeed": None}
    assert set(check._propose_vehicle("log", log, "table", ("t_s", "s"), bare, mixing)) == {
        "name", "reader", "rates", "commands", "surfaces",
    }  # fmt: skip


@pytest.mark.parametrize(("factor", "within", "unit"), [
    (0.0174, 1.5, "deg/s"), (0.004, 4.0, "mrad/s"), (0.004, 3.9, None), (1.0, 1.0, "rad/s"),
    (1e-4, 1.8, "cdeg/s"),
])  # fmt: skip
def test_the_nearest_unit_is_within_so_many_times(factor, within, unit):
    assert nearest_unit("rate", factor, within) == unit
