"""Submissions that cheat: what each does when it is loaded, reset or asked, and what is said of it.

HIDDEN stands for a file of the teacher's part.
"""

from typing import NamedTuple


class Cheat(NamedTuple):
    """Statements at each place; said: what its reason must match."""

    said: str
    load: str = "pass"
    reset: str = "pass"
    step: str = "pass"
    answer: str = "bf.Verdict()"


NOT_ALLOWED = "tried what is not allowed: "

CHEATS = {
    "reads the hidden flights": Cheat(NOT_ALLOWED + r"opens .*loss\.yaml", reset="open(HIDDEN).read()"),
    "looks for them": Cheat(NOT_ALLOWED + "lists", load="os.listdir(os.path.dirname(HIDDEN))"),
    "reads the grader's environment": Cheat(
        NOT_ALLOWED + "opens /proc/.*/environ", reset="open(f'/proc/{os.getppid()}/environ', 'rb').read()"
    ),
    "reads the grader's memory": Cheat(
        NOT_ALLOWED + "opens /proc/.*/mem", reset="open(f'/proc/{os.getppid()}/mem', 'rb')"
    ),
    "takes the grader's files": Cheat(NOT_ALLOWED + "lists", reset="os.listdir(f'/proc/{os.getppid()}/fd')"),
    "flies the truth ahead": Cheat(
        NOT_ALLOWED + r"imports beaver_ftc\.results", reset="bf.fly('elevator-partial-loss')"
    ),
    "asks the simulator": Cheat(NOT_ALLOWED + "imports jsbsim", load="import jsbsim"),
    "looks for the truth among objects": Cheat(NOT_ALLOWED + "searches the memory", step="gc.get_objects()"),
    "looks for the truth in frames": Cheat(
        "LookupError: no frame knows it",
        step="""
frame, names = sys._getframe(), set()
while frame:
    names |= {*frame.f_locals, *frame.f_globals}
    frame = frame.f_back
if not names & {"truth", "scenario", "frames", "loop", "fault", "flight", "seed"}:
    raise LookupError("no frame knows it")
""",
    ),
    "patches the grader": Cheat(
        NOT_ALLOWED + "imports beaver_ftc.",
        load="from beaver_ftc_live.challenge import grading; grading.FULL = 1000.0",
    ),
    "patches what sends": Cheat(
        "writes on the line to the grader",
        step="main = sys.modules['__main__']; main.HEAD.pack; main.VERDICT = b'X'",
    ),
    "writes a score on the grader's pipe": Cheat(
        "writes on the line to the grader", step="os.write(OUT, b'score 100' * 9)"
    ),
    "answers ahead": Cheat(
        "writes on the line to the grader",
        step="main = sys.modules['__main__']; os.write(OUT, main.HEAD.pack(b'V', 9, 88) + b'0' * 88)",
    ),
    "opens a connection": Cheat(NOT_ALLOWED + "opens a network connection", step="socket.socket()"),
    "keeps a file for the next flight": Cheat(NOT_ALLOWED + "writes state", step="open('state', 'w')"),
    "keeps it in a file's date": Cheat(NOT_ALLOWED + "changes files", step="os.utime(np.__file__, (1, 1))"),
    "keeps it in a module": Cheat(
        "LookupError: nothing is left",
        step="if not hasattr(np, 'kept'): np.kept = 1",
        reset="""
if not hasattr(np, "kept"):
    raise LookupError("nothing is left")
""",
    ),
    "stalls": Cheat("no answer in time, at 0 s", step="time.sleep(60)"),
    "closes the line and stays": Cheat("closes the line to the grader", step="os.close(OUT); time.sleep(60)"),
    "takes all memory": Cheat(r"MemoryError: .*the limit is 1024 MiB", step="bytearray(1 << 31)"),
    "forks to have more": Cheat(NOT_ALLOWED + "starts a process", step="os.fork()"),
    "has a shell do it": Cheat(NOT_ALLOWED + "starts a process", step="os.system('sleep 60 &')"),
    "starts a thread": Cheat("thread", step="threading.Thread(target=print).start()"),
    "ends the grader": Cheat(NOT_ALLOWED + "sends a signal", step="os.kill(os.getppid(), 9)"),
    "reaches around Python": Cheat(NOT_ALLOWED + "reaches around", step="ctypes.CDLL(None).fork()"),
    "lifts its limits": Cheat(
        NOT_ALLOWED + "changes its limits",
        step="import resource; resource.setrlimit(resource.RLIMIT_AS, (-1, -1))",
    ),
    "estimates nothing": Cheat(
        "its estimate is not finite: nan", answer="bf.Verdict(True, 'q', 'elevator', None, float('nan'))"
    ),
    "estimates infinity": Cheat(
        "its effectiveness is not finite", answer="bf.Verdict(effectiveness=np.full(4, np.inf))"
    ),
    "sends too many numbers": Cheat(
        r"effectiveness has shape .1000000", answer="bf.Verdict(effectiveness=np.ones(1_000_000))"
    ),
    "answers with an object": Cheat("step returned Loaded, allowed: a Verdict", answer="Loaded()"),
    "names a surface that is none": Cheat("isolated 'score'", answer="bf.Verdict(True, isolated='score')"),
    "always alarms": Cheat("a false alarm in every flight", answer="bf.Verdict(True, 'q', 'elevator')"),
    "reads the seed": Cheat(
        r"LookupError: \(0, .*OMP_NUM_THREADS",
        reset="raise LookupError(context.seed, sys.argv, dict(os.environ))",
    ),
    "leaves": Cheat("SystemExit: 0", step="raise SystemExit(0)"),
    "leaves without a word": Cheat("its process ended, status 0", step="os._exit(0)"),
    "colours the teacher's terminal": Cheat(
        r"ValueError: \?\?31m \?script\?", step="raise ValueError('\\x1b[31m <script> | x')"
    ),
    "asks the model for a million": Cheat(
        "writes on the line to the grader", step="context.model.f(np.zeros((1_000_000, 3)), context.trim_y)"
    ),
    "asks the model for ever": Cheat(
        "asks the design model more than", step="while True: context.model.G(context.trim_y)"
    ),
    "computes for ever": Cheat("no answer in time", step="while True: pass"),
    "asks the model for shapes that are none": Cheat(
        "asks the design model for shapes", step="context.model.f(np.zeros(5), context.trim_y)"
    ),
}

_TEMPLATE = """
import ctypes, gc, os, socket, sys, threading, time
import numpy as np
import beaver_ftc as bf

HIDDEN, OUT = {hidden!r}, 4

class Loaded:
    def __reduce__(self):
        return os.system, ("touch /tmp/owned",)

{load}

class Mine:
    def reset(self, context):
        global kept
        kept = context
{reset}

    def step(self, measured, command):
        context = kept
{step}
        return {answer}
"""


def source_of(cheat: Cheat, hidden: str) -> str:
    """The submission."""
    indented = {part: _indented(getattr(cheat, part)) for part in ("reset", "step")}
    return _TEMPLATE.format(hidden=hidden, load=cheat.load, answer=cheat.answer, **indented)


def _indented(statements: str) -> str:
    return "\n".join(f"        {line}" for line in statements.strip().splitlines())
