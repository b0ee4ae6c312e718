"""Several threads of one process: they fly, step, trim and linearise, and get what one thread gets."""

import subprocess
import sys

# Threads come first, so that they load aircraft themselves; they end, and what one thread gets follows.
SCRIPT = """
import sys, threading
import numpy as np
import beaver_ftc as bf

SHORT = {"duration_s": 1, "expect": {}, "faults[0].at_s": 0.4}
FLOWN = [bf.load("elevator-partial-loss").with_({**SHORT, "seed": seed}) for seed in range(4)]


def work(i):
    simulation = bf.Simulation(FLOWN[i])
    rows = [simulation.step() or simulation.values.copy() for _ in range(20)]
    flight = bf.fly(FLOWN[i])
    airspeed_mps = 45.0 + i
    linear = bf.linearise(FLOWN[i], airspeed_mps=airspeed_mps)
    point = bf.trim(FLOWN[i], airspeed_mps=airspeed_mps)
    return flight.log.to_numpy(), np.array(rows), point, linear.A, linear.B


def threads():
    found, wrong = {}, []

    def flown(i):
        try:
            found[i] = work(i)
        except BaseException as error:
            wrong.append(error)

    started = [threading.Thread(target=flown, args=(i,)) for i in range(4)]
    for thread in started:
        thread.start()
    for thread in started:
        thread.join()
    assert not wrong, wrong
    return found


rounds = [threads() for _ in range(2)]
for i in range(4):
    alone = work(i)
    for found in rounds:
        assert repr(found[i][2]) == repr(alone[2])
        for k in (0, 1, 3, 4):
            assert np.array_equal(found[i][k], alone[k], equal_nan=True), (i, k)
print("equal")
"""


def test_four_threads_get_what_one_gets_and_nothing_aborts():
    shown = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False)
    assert (shown.returncode, shown.stdout) == (0, "equal\n"), shown.stderr


def test_a_thread_may_end_after_another_has_loaded_an_aircraft():
    script = (
        "import threading, beaver_ftc as bf\n"
        "loaded, end = threading.Event(), threading.Event()\n"
        "thread = threading.Thread(target=lambda: (bf.trim(), loaded.set(), end.wait()))\n"
        "thread.start()\n"
        "loaded.wait()\n"
        "bf.trim()\n"
        "end.set()\n"
        "thread.join()\n"
    )
    shown = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert shown.returncode == 0, shown.stderr
