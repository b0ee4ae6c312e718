"""Commands on the pages that are not run as they stand: the one table of them, each with its reason.

`instead` is what is run for them, a template of the pattern's groups; without one, nothing is. Those that are
exempt `by_day` are run as they stand at night.
"""

import re
from dataclasses import dataclass

from samples import AT_NIGHT

from .documents import Command


@dataclass(frozen=True)
class Exempt:
    """Commands that match `pattern` as a whole."""

    pattern: str
    reason: str
    instead: str | None = None
    by_day: bool = False

    def matches(self, line: str) -> bool:
        """Whether this line is one of them."""
        return re.fullmatch(self.pattern, line) is not None

    def replaced(self, line: str) -> str | None:
        """What is run in the line's place."""
        if self.by_day and AT_NIGHT:
            return line
        return None if self.instead is None else re.fullmatch(self.pattern, line).expand(self.instead)


TABLE = (
    Exempt(
        r"make (demo|test|site|cost|waits( WAITS=.*)?|docs-check)",
        "in a checkout: sets up from the package index; make test runs this very suite",
    ),
    Exempt(
        r"beaver-ftc (?!run SCENARIO --)([a-z]+(?: (?:new|grade|submit|gtm)\b)?)"
        r".*?(?<!--out) [A-Z]+(?:,[A-Z]+)*(?: .*)?",
        "names the arguments",
        r"beaver-ftc \1 --help",
    ),
    Exempt(
        r"beaver-ftc evidence flight-controls",
        "minutes: the flights of a whole plan, which the page prints",
        "beaver-ftc evidence --help",
    ),
    Exempt(
        r"beaver-ftc sensitivity --mechanisms( .*)?",
        "flies for minutes; the study's own tests fly a few draws",
        "beaver-ftc sensitivity --help",
    ),
    Exempt(
        r"beaver-ftc sweep elevator-jams\.yaml --rare no_departure",
        "thousands of flights, which the page prints; tests/studies/sweep flies rare events",
        "beaver-ftc sweep --help",
    ),
    Exempt(
        r"pip install (\.|jupyterlab|\"\$BEAVER_FTC\" pytest pytest-xdist|'beaver-ftc\[\w+\]')",
        "needs the package index; these tests install the wheel themselves",
    ),
    Exempt(r"pip wheel .*", "needs the package index for the build; these tests build the wheel themselves"),
    Exempt(r"beaver-ftc --install-completion", "changes the reader's shell"),
    Exempt(
        r"pip install (./examples/my-detector)",
        "into a folder of its own, not into the environment that all tests share",
        r"python -m pip install -q --no-deps --no-build-isolation --no-index --target plugins \1",
    ),
    Exempt(
        r"(beaver-ftc sweep losses-and-laws\.yaml --search false_alarm)( --replay 51)",
        "flies again what the search before it has found: with the script that reads the same search",
        r"\1 --no-report && \1\2 --no-report && python worst-so-far.py",
    ),
    Exempt(r"python worst-so-far\.py", "reads a search: runs with the replay of its worst flight"),
    Exempt(
        r"(beaver-ftc run elevator-partial-loss --figures pdf,svg)",
        "the scripts after it draw its flight: with them",
        r"\1 && python closeup.py && python residual.py",
    ),
    Exempt(r"python (closeup|residual)\.py", "draws a flight: runs with the command before it"),
    Exempt(r"\. \.venv/bin/activate", "in a checkout, after make demo has made the environment"),
    Exempt(r"fgfs .*", "needs FlightGear"),
    Exempt(r"(ray start|srun|sleep|head=).*|.* --ray-address .*", "needs a cluster of several machines"),
    Exempt(
        r"python -m tools\.docs table .*|python (-m )?benchmarks[/.].*",
        "a measurement of minutes to hours, from a checkout",
    ),
    Exempt(
        r"python tools/check_certificate\.py FOLDER",
        "stands for the folder of any run with a certificate",
        "beaver-ftc run elevator-partial-loss --no-report --certificate"
        " && python tools/check_certificate.py runs/elevator-partial-loss",
    ),
    Exempt(r"beaver-ftc compare --sweep examples/gtm/.*|beaver-ftc import gtm .*", "needs NASA's data"),
    Exempt(r"beaver-ftc run left-wing-tip-lost\.yaml", "flies the GTM, which is made from NASA's data"),
    Exempt(
        r"(beaver-ftc live(?: (?!--open)\S+)*)( --open)?",
        "flies until it is ended, which the page's test does (tests/products/live/page): its address",
        r"timeout --signal=INT 10 \1 | grep live:.http",
    ),
    Exempt(
        r"(beaver-ftc sitl elevator-partial-loss --as ardupilot --no-report)",
        "waits for the autopilot that the page shows: with it",
        r"(\1 & python steady.py && wait)",
    ),
    Exempt(r"python steady\.py", "is an autopilot: runs with the simulator that waits for it"),
    Exempt(
        r"(beaver-ftc sitl \S+ --as ardupilot)",
        "waits for an autopilot, which tests/products/links/sitl has: its address",
        r"timeout --signal=INT 10 \1 --port 0 --no-report 2>&1 | grep 127.0.0.1",
    ),
    Exempt(
        r"beaver-ftc sitl .*",
        "waits for an autopilot and wants pymavlink, both of which tests/products/links/sitl has",
        "beaver-ftc sitl --help",
    ),
    Exempt(r"(sim_vehicle.py|PX4_SIM_MODEL=).*", "needs ArduPilot or PX4"),
    Exempt(
        r"(beaver-ftc compare --tune --grade exact --schemes adaptive-estimators)",
        "minutes: five trials",
        r"\1 --trials 5 --restarts 0",
    ),
    Exempt(
        r"beaver-ftc compare (--tune|.*--tuned|.*learned-network).*",
        "a search of minutes, which tests/studies/compare does on few flights, or what it writes",
        "beaver-ftc compare --help",
    ),
    Exempt(
        r"(pip install \./examples/learned-detector|python -m learned_detector\.train .*)",
        "needs scikit-learn; tests/plugins/test_learned.py trains it",
    ),
    Exempt(
        r"python -m tools\.drawn\.certificates",
        "half a minute: a few flights",
        "python -m tools.drawn.certificates --flights 2 --altered 4 --forged 40",
    ),
    Exempt(
        r"beaver-ftc (run|validate|check|sweep|compare|detectability|evidence|sitl|mismatch|separate"
        r"|import gtm|identify(?= --check))(?: --check)?",
        "names the command without its arguments",
        r"beaver-ftc \1 --help",
    ),
    Exempt(
        r"beaver-ftc compare --benchmark( --leaderboard \S+)?",
        "minutes: one set, one flight of each sweep",
        "beaver-ftc compare --benchmark --set published --flights 1 --leaderboard board.md",
    ),
    Exempt(
        r"beaver-ftc reproduce( --out runs)?",
        "minutes: every figure of the study; tests/studies/reproduce flies its cases",
        "beaver-ftc reproduce --help",
        by_day=True,
    ),
    Exempt(r"(beaver-ftc sensitivity \S+)", "a minute: two flights a row", r"\1 --flights 2", by_day=True),
    Exempt(
        r"(beaver-ftc detectability) \S+ (--surface elevator --within 0\.5)",
        "half a minute: shorter flights",
        r"\1 brief.yaml \2",
        by_day=True,
    ),
    Exempt(
        r"(beaver-ftc compare --sweep any-loss\.yaml --\w+ \S+)",
        "half a minute, which make docs-check waits for: two flights",
        r"\1 --flights 2",
        by_day=True,
    ),
    Exempt(
        r"(beaver-ftc compare --sweep elevator-effectiveness --flights) 20",
        "minutes: one flight with one scheme",
        r"\1 1 --schemes zhang2005",
    ),
    Exempt(
        r"(beaver-ftc sweep elevator-effectiveness) --search delay",
        "hundreds of flights: one of them",
        r"\1 --replay 0 --no-report",
    ),
    Exempt(
        r"beaver-ftc detectability --grid.*",
        "minutes: one condition, one rival",
        "beaver-ftc detectability --grid quick --surface rudder --turbulence none --schemes rls-monitor",
    ),
    Exempt(r"(beaver-ftc matrix(?!.*--airspeed).*)", "one airspeed for three", r"\1 --airspeed 45"),
    Exempt(r"beaver-ftc bench.*", "two minutes of compiling", "beaver-ftc bench --rounds 3 --no-parts"),
    Exempt(
        r"beaver-ftc detectability fault-free",
        "half a minute: a shorter flight",
        "beaver-ftc detectability brief.yaml",
    ),
    Exempt(
        r"beaver-ftc verify(?: --hours \d+ --faults \d+)?( --steps)?( --out \S+)?",
        "hours: a few flights",
        r"beaver-ftc verify --hours 0.01 --faults 2\1\2",
    ),
    Exempt(
        r"(beaver-ftc sweep (?:autopilot|elevator|robust)-\S+)",
        "hundreds of flights: one of them (test_sweeps.py flies each in short)",
        r"\1 --replay 0 --no-report",
    ),
    Exempt(
        r"beaver-ftc run SCENARIO (--as \w+|--certificate)",
        "stands for any",
        r"beaver-ftc run brief.yaml \1 --no-report",
    ),
    Exempt(
        r"(beaver-ftc sweep my-sweep.yaml --(?:workers|resume|backend).*)",
        "seconds of figures, which the same command with --junit draws",
        r"\1 --no-report",
    ),
    Exempt(
        r"(beaver-ftc run (?!elevator-partial-loss$)"
        r"(?:[\w./-]+(?: \w[\w./-]+)?|scenarios/\*\.yaml|\S+ --(?:csv|acmi|certificate))"
        r"(?: --junit \S+)?(?: --plugin \S+)?)",
        "seconds of figures: test_scenarios.py draws them, and the same command with elevator-partial-loss",
        r"\1 --no-report",
    ),
    Exempt(
        r"(beaver-ftc mismatch (?:fault-free|\S+ (?:--variant \S+,\S+|--map)))",
        "half a minute with figures, which `mismatch engine-neglected` draws",
        r"\1 --no-report",
    ),
    Exempt(
        r"beaver-ftc run \S+ (--flightgear \S+).*",
        "at the pace of the clock: a shorter flight",
        r"beaver-ftc run brief.yaml \1 --no-report",
    ),
    Exempt(r"(jsbsim .*) --realtime( .*)", "at the pace of the clock", r"\1\2"),
)


def tried(command: Command) -> str | None:
    """What is run for a command that is shown; None where its exception says that nothing is."""
    return instead(command.line)


def instead(line: str) -> str | None:
    """The same of the line of a command."""
    for exempt in TABLE:
        if exempt.matches(line):
            return exempt.replaced(line)
    return line
