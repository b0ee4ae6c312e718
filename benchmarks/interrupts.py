"""How long each command takes to end after Ctrl-C or SIGTERM, and what it leaves behind.

    python benchmarks/interrupts.py [COMMAND ...] [--after 0.3 1.5 4]

Every command of some length is started in an empty folder and interrupted: while it imports, while its
workers start, and while it works. Printed are the signal, after how long it came, the exit status, the time
to the end, processes left a second later, and whether a traceback was written. The exit status is 1 if one
took longer than 2 s, wrote a traceback, or left a process.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from beaver_ftc.studies.present.tables import markdown_table

MOST_S = 2.0
FILES = {
    "long.yaml": "name: long\nduration_s: 20000\n",
    "windy.yaml": "name: windy\nduration_s: 30\nenvironment: {turbulence: dryden, severity: light}\n"
    "fdi: {bounds: {turbulence: light}}\n",
    "many.sweep.yaml": "name: many\nruns: 5000\nvary: {'faults[0].magnitude': {uniform: [0.1, 0.9]}}\n"
    "base:\n  name: many\n  duration_s: 14\n"
    "  faults: [{type: loss_of_effectiveness, actuator: elevator, magnitude: 0.4, at_s: 5}]\n",
    "plan.yaml": "name: plan\nflights: {many: {sweep: many.sweep.yaml}}\nrequirements:\n"
    "  found: {text: It is found., flights: many, all: detected}\n",
}
COMMANDS = {
    "run": "run long.yaml",
    "mismatch": "mismatch long.yaml",
    "sweep": "sweep many.sweep.yaml --workers 2",
    "sweep --search": "sweep many.sweep.yaml --search delay --workers 2",
    "compare --sweep": "compare --sweep many.sweep.yaml --workers 2",
    "compare --benchmark": "compare --benchmark --workers 2",
    "compare --tune": "compare --tune --workers 2",
    "reproduce": "reproduce --workers 2",
    "matrix": "matrix --workers 2",
    "power": "power --workers 2",
    "smallest": "smallest windy.yaml --surface aileron --within 0.5",
    "verify": "verify --workers 2",
    "bench": "bench",
    "derive": "derive jsbsim:c172p --out derived",
    "detectability": "detectability windy.yaml",
    "live": "live fault-free",
    "sitl --as ardupilot": "sitl fault-free --as ardupilot",
    "sitl --as px4": "sitl fault-free --as px4",
    "diagnose": "diagnose log.csv --aircraft beaver",
}
# Undoes what a shell that starts jobs in the background has its processes ignore.
HEARD = """
import os, signal, sys
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, signal.SIG_DFL)
os.execv(sys.argv[1], sys.argv[1:])
"""


def interrupted(line: str, number: signal.Signals, after_s: float) -> tuple[str, ...] | None:
    """A row of the table; None where the command ended by itself before."""
    command = Path(sys.executable).with_name("beaver-ftc")
    with tempfile.TemporaryDirectory() as folder:
        for name, text in FILES.items():
            Path(folder, name).write_text(text)
        rows = (f"{i / 50:.2f},0,0,0,0,0,0,45,1000\n" for i in range(200_000))
        Path(folder, "log.csv").write_text(
            "t_s,p_rad_s,q_rad_s,r_rad_s,aileron,elevator,rudder,V,q\n" + "".join(rows)
        )
        process = subprocess.Popen(
            [sys.executable, "-c", HEARD, command, *line.split()],
            cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True,
        )  # fmt: skip
        try:
            process.wait(after_s)
            return None
        except subprocess.TimeoutExpired:
            begun = time.monotonic()
        if number == signal.SIGINT:
            os.killpg(process.pid, number)  # as a terminal sends it
        else:
            process.send_signal(number)
        try:
            said = process.communicate(timeout=60)[1]
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            said = process.communicate()[1]
        took_s = time.monotonic() - begun
        time.sleep(1.0)
        left = _left(process.pid)
    traceback = "yes" if b"Traceback" in said else "no"
    if traceback == "yes":
        print(said.decode(errors="replace"), file=sys.stderr)
    return number.name, f"{after_s:g}", str(process.returncode), f"{took_s:.2f}", str(left), traceback


def _left(group: int) -> int:
    """Processes of a group that still run."""
    listed = subprocess.run(["ps", "-eo", "pgid=,stat="], capture_output=True, text=True, check=True).stdout
    states = [line.split() for line in listed.splitlines()]
    return sum(int(of) == group and not state.startswith("Z") for of, state in states)


def main() -> None:
    """Interrupt each command with either signal at each instant."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("commands", nargs="*", default=list(COMMANDS), metavar="COMMAND")
    parser.add_argument("--after", type=float, nargs="+", default=[0.15, 1.5, 4.0], help="s")
    asked = parser.parse_args()
    rows = []
    for name in asked.commands:
        for number in (signal.SIGINT, signal.SIGTERM):
            for after_s in asked.after:
                row = interrupted(COMMANDS[name], number, after_s)
                if row is not None:
                    rows.append((name, *row))
                    print(*rows[-1], sep="  ", flush=True)
    head = ("command", "signal", "after, s", "exit status", "ended in, s", "left", "traceback")
    print(f"\n{markdown_table(head, rows)}")
    worst = max(float(row[4]) for row in rows)
    fine = worst <= MOST_S and all(row[5:] == ("0", "no") for row in rows)
    print(f"\n{len(rows)} interruptions, the slowest in {worst:.2f} s")
    sys.exit(not fine)


if __name__ == "__main__":
    main()
