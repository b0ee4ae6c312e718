"""Commands that are forked (tools/served.py) do what they do when they are started."""

import signal
import subprocess
import time

import pytest
from tools.served import ONE_CORE, POSSIBLE

pytestmark = pytest.mark.skipif(not POSSIBLE, reason="commands are forked on Linux alone")
LONG = "name: long\nduration_s: 20000\n"
SAYS = "import os, sys; print(os.getcwd(), os.environ['SAID'], sys.argv[1:], __name__); sys.exit(7)\n"


def _said(done):
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("line", [
    "beaver-ftc list --short", "beaver-ftc run absent.yaml", "beaver-ftc",
    "python -m says a 'b c'", "python says.py d", "beaver-ftc validate - < long.yaml",
])  # fmt: skip
def test_it_says_and_ends_as_if_it_were_started(line, installation, started, tmp_path):
    (tmp_path / "says.py").write_text(SAYS)
    (tmp_path / "long.yaml").write_text(LONG)
    forked, alone = (made.run("bash", "-c", line, cwd=tmp_path, SAID="x") for made in (installation, started))
    assert installation.before is not None
    assert _said(forked) == _said(alone)


def test_a_command_sees_one_core_where_it_is_told_so(installation, tmp_path):
    (tmp_path / "cores.py").write_text("import os; print(len(os.sched_getaffinity(0)))\n")
    done = installation.run("bash", "-c", "python -m cores", cwd=tmp_path, **{ONE_CORE: "1"})
    assert done.stdout == "1\n"


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_reaches_it(number, status, installation, tmp_path):
    (tmp_path / "long.yaml").write_text(LONG)
    command = [installation.before / "beaver-ftc", "run", "long.yaml", "--no-report"]
    with subprocess.Popen(command, cwd=tmp_path, env=installation.environment()) as running:
        while not list(tmp_path.glob("runs/.long*/log.parquet")):
            assert running.poll() is None
            time.sleep(0.02)
        running.send_signal(number)
        assert running.wait(timeout=60) == status
    assert not (tmp_path / "runs").exists()


def test_it_ends_with_whoever_asked(installation, tmp_path):
    (tmp_path / "long.yaml").write_text(LONG)
    command = [installation.before / "beaver-ftc", "run", "long.yaml", "--no-report"]
    with subprocess.Popen(command, cwd=tmp_path, env=installation.environment()) as running:
        while not list(tmp_path.glob("runs/.long*/log.parquet")):
            time.sleep(0.02)
        running.kill()
    (log,) = tmp_path.glob("runs/.long*/log.parquet")
    time.sleep(1.0)
    size = log.stat().st_size
    time.sleep(1.0)
    assert log.stat().st_size == size
