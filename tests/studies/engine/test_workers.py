"""Workers that is dismissed leaves at once and in silence, whatever its workers are doing."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Future

import pytest

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.studies.engine import workers

PROGRAM = """
import sys, time
from beaver_ftc.studies.engine.workers import Batch, Work, _Worker

def nap(case):
    time.sleep(20.0)

if __name__ == "__main__":
    workers = [_Worker(Work(nap)) for _ in range(3)]
    for number, worker in enumerate(workers):
        worker.fly(Batch(number, [0], [None]))
    time.sleep(float(sys.argv[1]))
    for worker in workers:
        worker.end()
"""


@pytest.mark.parametrize("seconds", [0.0, 1.5])
def test_workers_end_before_and_after_they_have_started(tmp_path, seconds):
    program = tmp_path / "dismissed.py"
    program.write_text(PROGRAM)
    begun = time.monotonic()
    done = subprocess.run(
        [sys.executable, program, str(seconds)], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert time.monotonic() - begun < 18.0


def test_workers_that_have_started_end_where_another_cannot_start(monkeypatch):
    class Started:
        def __init__(self, work):
            if len(running) == 2:
                raise SimulationFailed("no more")
            self.pid = Future()
            self.pid.set_result(1)
            running.append(self)

        def end(self):
            running.remove(self)

    running = []
    monkeypatch.setattr(workers, "_Worker", Started)
    with pytest.raises(SimulationFailed, match="no more"):
        workers.LocalWorkers(workers.Work(len), 4)
    assert running == []


STOPPED = """
import os, signal, threading, time
from beaver_ftc.studies.engine import processes

def send(stop):
    while stop.is_alive():
        os.killpg(0, signal.SIGINT)
        time.sleep(0.02)

if __name__ == "__main__":
    heard = []
    signal.signal(signal.SIGINT, lambda *_: heard.append(1))
    stop = threading.Thread(target=time.sleep, args=(1.5,))
    stop.start()
    threading.Thread(target=send, args=(stop,)).start()
    processes.start_early()
    worker = processes.context().Process(target=print, args=("worked",))
    with processes.single_threaded():
        worker.start()
    worker.join()
    stop.join()
    print(len(heard) > 1)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there workers start afresh, on a terminal of their own")
def test_ctrl_c_while_workers_are_getting_ready_is_for_the_one_who_gives_the_orders(tmp_path):
    """Sent, as by a terminal, to the whole group, over and over while the process they fork from imports."""
    (tmp_path / "stopped.py").write_text(STOPPED)
    done = subprocess.run(
        [sys.executable, "stopped.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        start_new_session=True,
    )
    assert (done.stdout, done.stderr, done.returncode) == ("worked\nTrue\n", "", 0)


INTERRUPTED = """
import sys
from beaver_ftc.studies.engine import processes, workers

processes._PRELOAD[:] = ["slow"]  # imported by the process that workers are forked from
if __name__ == "__main__":
    print("begun", flush=True)
    try:
        workers.LocalWorkers(workers.Work(print), 2)
    except KeyboardInterrupt:
        sys.exit(130)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there workers start afresh, on a terminal of their own")
def test_ctrl_c_ends_a_command_that_waits_for_its_first_worker(tmp_path):
    """Not once the imports are over, and without a word of what is forked when nobody waits any more."""
    (tmp_path / "slow.py").write_text("import time\ntime.sleep(60)\n")
    (tmp_path / "begun.py").write_text(INTERRUPTED)
    with subprocess.Popen(
        [sys.executable, "-c", HEARD_AGAIN, sys.executable, "begun.py"],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    ) as running:  # fmt: skip
        running.stdout.readline()
        time.sleep(1.0)
        os.killpg(running.pid, signal.SIGINT)
        said = running.communicate(timeout=30)[1]
    assert (running.returncode, said) == (130, b"")


HEARD_AGAIN = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
os.execv(sys.argv[1], sys.argv[1:])
"""


KILLED = """
import os, signal, threading
from multiprocessing import forkserver
from beaver_ftc.studies.engine import processes, workers

ends, begun = int(__import__("sys").argv[1]), []
start = workers.start_early

def start_and_kill():
    # stopped, it does not answer; then it is gone, as if memory had run out
    start()
    server = forkserver._forkserver._forkserver_pid
    if len(begun) < ends:
        os.kill(server, signal.SIGSTOP)
        threading.Timer(0.3, os.kill, (server, signal.SIGKILL)).start()
    begun.append(server)

processes._PRELOAD[:] = []
workers.start_early = start_and_kill
if __name__ == "__main__":
    try:
        worker = workers._Worker(workers.Work(len))
        print(worker.fly(workers.Batch(0, [0], ["four"])).result(60), len(set(begun)))
        worker.end()
    except workers.SimulationFailed as error:
        print(error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there workers start afresh")
@pytest.mark.parametrize(
    ("ends", "says"),
    [(1, "[4] 2"), (9, "a worker process cannot start: what it is forked from is ended, each time")],
)
def test_what_workers_are_forked_from_is_killed(tmp_path, ends, says):
    (tmp_path / "killed.py").write_text(KILLED)
    done = subprocess.run(
        [sys.executable, "killed.py", str(ends)], cwd=tmp_path, capture_output=True, text=True, check=False,
        timeout=120,
    )  # fmt: skip
    assert (done.stdout.strip(), done.stderr, done.returncode) == (says, "", 0)
