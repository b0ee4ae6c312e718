"""A flying wing made of difference equations whose coefficients are known, and its logs in each format."""

import struct

import numpy as np

RATE_HZ = 10.0
PAST = np.array([[0.5, 0.02, 0.05], [0.0, 0.6, 0.0], [-0.1, 0.0, 0.7]])
RIGHT = np.array([[0.05, -0.02, 0.01], [0.5, 0.25, 0.06], [0.2, 0.10, 0.02]])
LEFT = RIGHT * np.array([1.0, -1.0, 1.0])
TRIM = np.array([-0.03, 0.04, 0.0])
NOISE = np.array([0.05, 0.04, 0.02])
COLUMNS = (
    "t_s", "p_rad_s", "q_rad_s", "r_rad_s", "roll_command", "pitch_command", "right_effectiveness",
    "left_effectiveness",
)  # fmt: skip
SHORT = {"p_rad_s": "p", "q_rad_s": "q", "r_rad_s": "r", "roll_command": "roll", "pitch_command": "pitch"}
VEHICLE = """\
name: wing
rates: {p: p_rad_s, q: q_rad_s, r: r_rad_s}
commands: [roll_command, pitch_command]
surfaces: {right: {roll_command: 0.5, pitch_command: 0.5}, left: {roll_command: 0.5, pitch_command: -0.5}}
labels: {right: right_effectiveness, left: left_effectiveness}
"""


def vehicle(topic, names=None):
    """The vehicle's file for logs whose columns stand in a topic, perhaps under other names."""
    text = VEHICLE[: VEHICLE.index("labels")]
    for name in ("p_rad_s", "q_rad_s", "r_rad_s", "roll_command", "pitch_command"):
        text = text.replace(name, f"{topic}.{(names or {}).get(name, name)}")
    return text


def fly(duration_s=240.0, parts=(), seed=1, trim=(0.1, -0.2), gain=1.0):
    """Columns of a flight. parts: (from_s, to_s, right, left) effectiveness, healthy elsewhere."""
    rng = np.random.default_rng(seed)
    n = round(duration_s * RATE_HZ)
    t_s = np.arange(n) / RATE_HZ
    effectiveness = np.ones((n, 2))
    for begin, end, *values in parts:
        effectiveness[(t_s >= begin) & (t_s < end)] = values
    commands = np.array(trim) + _wander(rng, n, 0.06)
    surfaces = np.column_stack([commands.sum(axis=1) / 2, (commands[:, 0] - commands[:, 1]) / 2])
    moved = [surfaces[2 - j : n - 1 - j] * effectiveness[3:] for j in range(3)]
    driven = gain * sum(moved[j][:, :1] * RIGHT[j] + moved[j][:, 1:] * LEFT[j] for j in range(3))
    noise = NOISE * rng.standard_normal((n - 3, 3))
    rates = np.zeros((n, 3))
    for k in range(3, n):
        rates[k] = TRIM + rates[k - 1] @ PAST + driven[k - 3] + noise[k - 3]
    return dict(zip(COLUMNS, np.column_stack([t_s, rates, commands, effectiveness]).T, strict=True))


def _wander(rng, n, sd):
    """Commands that wander with a time constant of half a second, (n, 2)."""
    values, steps = np.zeros((n, 2)), 0.6 * sd * rng.standard_normal((n - 1, 2))
    for k in range(1, n):
        values[k] = 0.8 * values[k - 1] + steps[k - 1]
    return values


def write_csv(path, columns, rows=slice(None)):
    """Write columns as a CSV table; nan is an empty cell."""
    table = np.column_stack([column[rows] for column in columns.values()])
    lines = [",".join("" if np.isnan(cell) else repr(float(cell)) for cell in row) for row in table]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n")
    return path


def write_parquet(path, columns):
    import pyarrow as pa
    from pyarrow import parquet

    parquet.write_table(pa.table(columns), path)
    return path


def write_alfa(folder, duration_s=60.0, failure_s=None, seed=3, columns=None):
    """A folder in the processed form of the ALFA set: gyro 10 Hz, attitude errors 20 ms later, outputs 3 Hz.
    columns: of a flight, else one of this duration and seed."""
    folder.mkdir()
    origin_ns = 1_538_768_543_780_097_959
    flown = columns or fly(duration_s, seed=seed, trim=(0.0, 0.0))
    ns = origin_ns + np.round(flown["t_s"] * 1e9).astype(np.int64)

    def write(topic, stamps, columns):
        rows = [
            f"{stamp},{','.join(repr(float(cell)) for cell in row)}"
            for stamp, row in zip(stamps, np.column_stack(list(columns.values())), strict=True)
        ]
        header = ",".join(["%time", *columns])
        (folder / f"{folder.name}-{topic}.csv").write_text("\n".join([header, *rows]) + "\n")

    axes = dict(zip("xyz", "pqr", strict=True))
    raw = {f"field.angular_velocity.{axis}": flown[f"{rate}_rad_s"] for axis, rate in axes.items()}
    raw |= {f"field.linear_acceleration.{axis}": np.zeros(len(ns)) for axis in axes}
    write("mavros-imu-data_raw", ns, raw)
    for axis, name in (("roll", "roll_command"), ("pitch", "pitch_command")):
        late = ns + 20_000_000
        write(
            f"mavros-nav_info-{axis}",
            late,
            {"field.commanded": np.rad2deg(flown[name]), "field.measured": np.zeros(len(ns))},
        )
    write(
        "mavros-rc-out", ns[::3], {f"field.channels{i}": np.full(len(ns[::3]), 1500.0) for i in range(1, 6)}
    )
    if failure_s is not None:
        stamps = origin_ns + np.round(np.arange(failure_s, duration_s, 0.5) * 1e9).astype(np.int64)
        write("failure_status-aileron", stamps, {"field.data": np.full(len(stamps), 2.0)})
    return folder


def write_ulog(path, columns, name="vehicle_rates", further_topics=None, parameters=(), changes=()):
    """A PX4 ULog file with one topic that holds these columns as doubles, stamps in us.

    further_topics: columns by topic. parameters, changes: (name, value) before and after the first topic; a
    whole number is an int32_t.
    """

    def message(kind, body):
        return struct.pack("<HB", len(body), ord(kind)) + body

    def parameter(key, value):
        kind, code = ("int32_t", "i") if isinstance(value, int) else ("float", "f")
        text = f"{kind} {key}".encode()
        return message("P", bytes([len(text)]) + text + struct.pack(f"<{code}", value))

    topics = {name: columns} | (further_topics or {})
    fields = {topic: [field for field in of if field != "t_s"] for topic, of in topics.items()}
    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    for topic, names in fields.items():
        layout = "uint64_t timestamp;" + "".join(f"double {field};" for field in names)
        data += message("F", f"{topic}:{layout}".encode())
    data += b"".join(parameter(*one) for one in parameters)
    for number, topic in enumerate(topics):
        data += message("A", struct.pack("<BH", 0, number) + topic.encode())
    for number, (topic, of) in enumerate(topics.items()):
        rows = np.column_stack([of[field] for field in fields[topic]])
        for t_s, row in zip(of["t_s"], rows, strict=True):
            stamp = round(t_s * 1e6) + 1_000_000
            data += message("D", struct.pack(f"<HQ{len(row)}d", number, stamp, *row))
        data += b"" if number else b"".join(parameter(*one) for one in changes)
    path.write_bytes(data)
    return path


def write_ardupilot(path, columns, name="RATE", parameters=()):
    """An ArduPilot dataflash log (text form) with one message that holds these columns, stamps in us.

    parameters: (name, value) before the message.
    """
    fields = [field for field in columns if field != "t_s"]
    short = [field[:12] for field in fields]
    lines = [
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns",
        f"FMT, 140, {11 + 8 * len(fields)}, {name}, Q{'d' * len(fields)}, TimeUS,{','.join(short)}",
    ]
    if parameters:
        lines.append("FMT, 64, 35, PARM, QNff, TimeUS,Name,Value,Default")
    lines += [f"PARM, 900000, {key}, {value}, 0" for key, value in parameters]
    for i, t_s in enumerate(columns["t_s"]):
        row = ", ".join(repr(float(columns[field][i])) for field in fields)
        lines.append(f"{name}, {round(t_s * 1e6) + 1_000_000}, {row}")
    path.write_text("\n".join(lines) + "\n")
    return path


_DATAFLASH_TYPE = {"TimeUS": "Q", "I": "B", "C": "B", "Instance": "B", "Count": "i", "Name": "N"}


def write_dataflash(path, messages):
    """An ArduPilot dataflash log (binary form) of (kind, row) in order; a row's names are its fields. TimeUS,
    I, C, Instance and Count are whole numbers, Name is a text, the others are floats of eight bytes."""
    data, kinds = b"", {}

    def message(number, body):
        return b"\xa3\x95" + bytes([number]) + body

    for kind, row in messages:
        layout = "".join(_DATAFLASH_TYPE.get(field, "d") for field in row)
        packed = "<" + layout.replace("N", "16s")
        if kind not in kinds:
            kinds[kind] = 130 + len(kinds)
            size = 3 + struct.calcsize(packed)
            body = struct.pack(
                "<BB4s16s64s", kinds[kind], size, kind.encode(), layout.encode(), ",".join(row).encode()
            )
            data += message(128, body)
        data += message(kinds[kind], struct.pack(packed, *row.values()))
    own = struct.pack("<BB4s16s64s", 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    path.write_bytes(message(128, own) + data)
    return path


def write_rates(path, columns):
    """A flight as messages RATE of a binary dataflash log, under short names."""
    messages = []
    for i, t_s in enumerate(columns["t_s"]):
        row = {SHORT[name]: columns[name][i] for name in SHORT if name in columns}
        messages.append(("RATE", {"TimeUS": round(t_s * 1e6) + 1_000_000} | row))
    return write_dataflash(path, messages)
