"""Draw hostile aircraft and models of identified vehicles, put each before a command, and count how it ends.

    python -m tools.hostile --count 500 --seed 1 --jobs 2

Each case is a mutation of a valid one: the built-in aircraft, or a model that `identify` has written. It must
end in at most 5 s of processor with exit status 2 and lines that say where; or, for one that is legal after
all, with 0, 1 or, for an aircraft that loads but cannot be flown to the end, 3 and one line. A case that ends
otherwise (a signal, a traceback, more time, more memory) is printed and makes the exit status 1.
"""

import argparse
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

from beaver_ftc.documents.files import data_root
from beaver_ftc_logs.sample_logs import files

COMMAND = [sys.executable, "-P", "-c", "from beaver_ftc.cli.main import main; main()"]
LIMITED = ["sh", "-c", 'ulimit -t 20; ulimit -v 6291456; exec "$@"', "sh"]  # what goes on for ever is ended
MOST_CPU_S, MOST_BYTES = 5.0, 2 << 30
END = "</fdm_config>"
FUNCTION = (
    '<system name="x"><channel name="x"><fcs_function name="x/y"><function>{}</function>{}</fcs_function>'
    "</channel></system>"
)
NUMBERS = (
    ".nan",
    ".inf",
    "-.inf",
    "1e308",
    "-1e308",
    "1e-320",
    "0",
    "-1",
    "1e9",
    "9" * 400,
    "''",
    "[]",
    "{}",
)
XML_NUMBERS = ("nan", "inf", "-1e308", "1e308", "1e-320", "0", "-1", "1e12", "", "x", "0x10", "9" * 400)
JSON_VALUES: tuple[Any, ...] = (
    1e308, -1e308, 1e-320, 0, -1, 10**400, True, None, "x", "x" * 100_000, [], {}, [[]], [0] * 1000
)  # fmt: skip


class Case(NamedTuple):
    """What was done, and what is to be run in its folder."""

    kind: str
    command: list[str]
    folder: Path


def main() -> int:
    """Draw, run, count."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--count", type=int, default=500)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--first", type=int, default=0)
    asked.add_argument("--jobs", type=int, default=1)
    options = asked.parse_args()
    with tempfile.TemporaryDirectory(prefix="hostile-") as scratch:
        log, model = identified(Path(scratch))

        def one(n: int) -> str:
            return run(drawn(n, options.seed, Path(scratch), log, model))

        ends: Counter[str] = Counter()
        with ThreadPoolExecutor(options.jobs) as pool:
            for end in pool.map(one, range(options.first, options.first + options.count)):
                ends[end] += 1
                if ends.total() % 20 == 0:
                    print(f"{ends.total()}: {dict(sorted(ends.items()))}", flush=True)
    for end, count in sorted(ends.items()):
        print(f"{end}: {count}")
    print(f"most processor: {max((WORST['cpu_s'], 0)):.1f} s, most memory: {WORST['bytes'] / 2**20:.0f} MB")
    return int(any(end.startswith("WRONG") for end in ends))


WORST = {"cpu_s": 0.0, "bytes": 0.0}


def drawn(n: int, seed: int, scratch: Path, log: Path, model: dict[str, Any]) -> Case:
    """Case n, in a folder of its own: three aircraft to two models."""
    rng, folder = random.Random(f"{seed} {n}"), scratch / f"{n:05d}"
    folder.mkdir()
    return a_model(rng, folder, log, model) if n % 5 > 2 else an_aircraft(rng, folder)


def identified(folder: Path) -> tuple[Path, dict[str, Any]]:
    """A log, and the model that `identify` makes of another."""
    for name, text in files().items():
        (folder / name).write_text(text)
    healthy, vehicle, model = folder / "healthy.csv", folder / "vehicle.yaml", folder / "model.json"
    command = [*COMMAND, "identify", str(healthy), "--vehicle", str(vehicle), "--out", str(model)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return folder / "suspect.csv", json.loads(model.read_text())


def an_aircraft(rng: random.Random, folder: Path) -> Case:
    """The built-in aircraft with one to three mutations, and a flight of it."""
    there = folder / "a"
    shutil.copytree(data_root() / "aircraft" / "beaver", there)
    model, described = there / "beaver.xml", there / "aircraft.yaml"
    said = []
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        mutation = rng.choice(OF_MODELS + OF_FILES)
        path = described if mutation in OF_FILES else rng.choice([model, model, *there.rglob("*.xml")])
        path.write_text(mutation(rng, path.read_text(errors="replace")), errors="replace")
        said.append(f"{mutation.__name__} in {path.name}")
    (folder / "s.yaml").write_text("name: s\nduration_s: 2\naircraft: ./a\n")
    return Case("; ".join(said), [*COMMAND, "run", "s.yaml", "--no-report"], folder)


def inserted(rng: random.Random, text: str, what: str) -> str:
    """Before the root's end; in a file that has another root, at a random element's end."""
    if END in text:
        return text.replace(END, what + END)
    places = [match.end() for match in re.finditer(r"</[a-z_]+>", text)][:-1] or [len(text)]
    at = rng.choice(places)
    return text[:at] + what + text[at:]


def deep(rng: random.Random, text: str) -> str:
    tag, depth = rng.choice(("a", "sum", "channel", "product")), int(10 ** rng.uniform(1.5, 5.5))
    inside = f"<{tag}>" * depth + "<value>1</value>" + f"</{tag}>" * depth
    return inserted(rng, text, rng.choice((inside, FUNCTION.format(inside, ""))))


def many_rows(rng: random.Random, text: str) -> str:
    rows = "\n".join(f"{i} {rng.gauss(0, 1):.3g}" for i in range(int(10 ** rng.uniform(2, 6))))
    table = "<table><independentVar>velocities/p-rad_sec</independentVar><tableData>{}</tableData></table>"
    return inserted(rng, text, FUNCTION.format(table.format(rows), ""))


def many_functions(rng: random.Random, text: str) -> str:
    one = '<fcs_function name="x/y{}"><function><sin><value>1</value></sin></function></fcs_function>'
    count = int(10 ** rng.uniform(1, 5))
    inside = "".join(map(one.format, range(count)))
    return inserted(rng, text, f'<system name="x"><channel name="x">{inside}</channel></system>')


def delay(rng: random.Random, text: str) -> str:
    of, unit = 10 ** rng.uniform(-3, 13), rng.choice(("", ' type="frames"', ' type="time"'))
    value = rng.choice((of, -of, "nan", "inf", "x"))
    kind = rng.choice(("pure_gain", "sensor", "actuator", "lag_filter"))
    component = (
        f'<{kind} name="x/d"><input>velocities/p-rad_sec</input><gain>1</gain><c1>1</c1>'
        f"<delay{unit}>{value}</delay></{kind}>"
    )
    return inserted(rng, text, f'<system name="x"><channel name="x">{component}</channel></system>')


def number(rng: random.Random, text: str) -> str:
    """One of its numbers replaced."""
    places = list(re.finditer(r">\s*(-?\d[\d.eE+-]*)\s*<", text))
    if not places:
        return text
    match = rng.choice(places)
    return text[: match.start(1)] + rng.choice(XML_NUMBERS) + text[match.end(1) :]


def late_error(rng: random.Random, text: str) -> str:
    """A function that raises once time has passed, or writes where nothing should."""
    time_s = f"<lt><property>simulation/sim-time-sec</property><value>{rng.uniform(0, 2):.3g}</value></lt>"
    bad = rng.choice((
        "<property>no/such</property>", "<quotient><value>1</value><value>0</value></quotient>",
        "<sqrt><value>-1</value></sqrt>", "<exp><value>1e9</value></exp>",
        "<switch><value>7</value><value>1</value><value>2</value></switch>",
    ))  # fmt: skip
    target = rng.choice((
        "", "simulation/reset", "simulation/terminate", "simulation/do_simple_trim", "velocities/p-rad_sec",
        "simulation/dt", "position/h-sl-ft", "propulsion/set-running", "ic/h-sl-ft", "fcs/elevator-cmd-rad",
        "aero/dpt", "simulation/jsbsim-debug", "inertia/mass-slugs",
    ))  # fmt: skip
    inside = f"<ifthen>{time_s}<value>0</value>{bad}</ifthen>"
    return inserted(rng, text, FUNCTION.format(inside, target and f"<output>{target}</output>"))


def entities(rng: random.Random, text: str) -> str:
    bomb = '<!DOCTYPE l [<!ENTITY a "lol">' + "".join(
        f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True)
    )
    return re.sub(r"(<\?xml[^>]*\?>)?", lambda match: match[0] + bomb + "]>", text, count=1) + "&i;"


def cyclic(rng: random.Random, text: str) -> str:
    return inserted(
        rng, text, f'<system file="{rng.choice(("elevator", "aileron", "x", "../a/Systems/flap"))}"/>'
    )


def acting(rng: random.Random, text: str) -> str:
    return inserted(rng, text, rng.choice((
        '<output name="written.csv" type="CSV" rate="10"/>', '<input port="5000"/>', '<child name="x"/>',
        '<system name="x"><property value="1">simulation/write-state-file</property></system>',
        '<system file="/etc/passwd"/>', '<output name="127.0.0.1" type="SOCKET" port="1"/>',
    )))  # fmt: skip


def cut(rng: random.Random, text: str) -> str:
    return text[: rng.randrange(len(text))]


def without_an_element(rng: random.Random, text: str) -> str:
    places = list(re.finditer(r"<([a-z_]+)[^<>]*>[^<>]*</\1>", text))
    match = rng.choice(places) if places else None
    return text[: match.start()] + text[match.end() :] if match else text


def long_text(rng: random.Random, text: str) -> str:
    long = "x" * int(10 ** rng.uniform(2, 6.5))
    return inserted(
        rng,
        text,
        rng.choice((f'<property value="0">{long}</property>', f"<!-- {long} -->", f'<a b="{long}"/>')),
    )


def bytes_in_between(rng: random.Random, text: str) -> str:
    at = rng.randrange(len(text))
    return text[:at] + rng.choice(("\x00", "\x1b]0;t\x07", "\udcff", "\ufeff", "<", "&")) + text[at:]


def value_of_a_key(rng: random.Random, text: str) -> str:
    places = list(re.finditer(r"(?<=[:,\[ ])-?\d[\d.e-]*", text))
    match = rng.choice(places)
    return text[: match.start()] + rng.choice(NUMBERS) + text[match.end() :]


def name_in_a_file(rng: random.Random, text: str) -> str:
    match = rng.choice(list(re.finditer(r"[a-z]+[/_-][a-z_/-]+", text)))
    new = rng.choice(
        ("x", "simulation/reset", "y" * 5000, "../b", "<b>", "simulation/write-state-file", "fcs/no")
    )
    return text[: match.start()] + new + text[match.end() :]


def deep_yaml(rng: random.Random, text: str) -> str:
    depth = int(10 ** rng.uniform(1, 5))
    return text + "x: " + "[" * depth + "]" * depth + "\n"


def alias_bomb(rng: random.Random, text: str) -> str:
    lines = [
        "a0: &a0 [1, 1]",
        *(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]" for i in range(1, rng.randrange(2, 60))),
    ]
    return text + "\n".join(lines) + "\n"


def without_a_line(rng: random.Random, text: str) -> str:
    lines = text.splitlines(keepends=True)
    del lines[rng.randrange(len(lines))]
    return "".join(lines)


OF_MODELS: tuple[Callable[[random.Random, str], str], ...] = (
    deep, many_rows, many_functions, delay, number, number, late_error, late_error, entities, cyclic, acting,
    cut, without_an_element, long_text, bytes_in_between,
)  # fmt: skip
OF_FILES: tuple[Callable[[random.Random, str], str], ...] = (
    value_of_a_key, value_of_a_key, name_in_a_file, deep_yaml, alias_bomb, without_a_line,
)  # fmt: skip


def a_model(rng: random.Random, folder: Path, log: Path, model: dict[str, Any]) -> Case:
    """The identified model with one to three mutations, and a diagnosis by it."""
    changed, said = json.loads(json.dumps(model)), []
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        section, key = rng.choice([*_places(changed)])
        old, how = section[key], rng.randrange(5)
        if how < 3 or not isinstance(old, int | float):
            new = rng.choice(JSON_VALUES) if how else _reshaped(rng, old)
        else:
            new = old * 10 ** rng.uniform(-12, 12) * rng.choice((1, -1))
        section[key] = new
        said.append(f"{key}: {new!r:.60}")
    text = json.dumps(changed)
    if rng.random() < 0.1:
        text = rng.choice((text[: rng.randrange(len(text))], "[" * 100_000, "null", "[]", "NaN", ""))
    (folder / "model.json").write_text(text)
    command = [*COMMAND, "diagnose", str(log), "--model", "model.json", "--out", "out"]
    return Case("; ".join(said), command, folder)


def _places(data: Any) -> Iterator[tuple[Any, Any]]:
    """Where a value stands: what holds it, and by which key. Few of a long list."""
    pairs = data.items() if isinstance(data, dict) else list(enumerate(data))[:3]
    for key, value in pairs:
        yield data, key
        if isinstance(value, dict | list):
            yield from _places(value)


def _reshaped(rng: random.Random, value: Any) -> Any:
    """A list with more, fewer or equal rows; anything else in a list of its own."""
    if not isinstance(value, list) or not value:
        return [value]
    return rng.choice((value[:-1], value + value[-1:], [value[0]] * len(value), [value], value * 50))


def run(case: Case) -> str:
    """How a case ends; what it was is printed where that is wrong."""
    began_s = time.monotonic()
    out = case.folder / "out.txt"
    with out.open("wb") as said:
        child = subprocess.Popen(
            [*LIMITED, *case.command], cwd=case.folder, stdout=subprocess.DEVNULL, stderr=said
        )
        _, status, used = os.wait4(child.pid, 0)
    code = os.waitstatus_to_exitcode(status)
    child.returncode = code
    text = out.read_text(errors="replace")
    cpu_s, size = used.ru_utime + used.ru_stime, used.ru_maxrss * 1024
    WORST["cpu_s"], WORST["bytes"] = max(WORST["cpu_s"], cpu_s), max(WORST["bytes"], size)
    shutil.rmtree(case.folder, ignore_errors=True)
    took = f"{cpu_s:.1f} s of processor, {time.monotonic() - began_s:.0f} s, {size / 2**20:.0f} MB"
    shown = f"{case.kind}: status {code}, {took}: {text[-200:]!r}"
    lines = [line for line in text.splitlines() if not line.startswith("beaver-ftc: ")]
    if cpu_s > MOST_CPU_S or size > MOST_BYTES:
        end = "WRONG, too much"
    elif "Traceback" in text or re.search("^unexpected ", text, re.MULTILINE) or code not in (0, 1, 2, 3):
        end = "WRONG, broken"
    elif code in (2, 3) and not lines:
        end = "WRONG, without a line"
    else:
        end = {2: "refused, exit 2", 3: "not flown to the end, exit 3"}.get(code, "legal, exit 0 or 1")
    if end.startswith("WRONG"):
        print(f"{end}: {shown}", file=sys.stderr, flush=True)
    return end


if __name__ == "__main__":
    sys.exit(main())
