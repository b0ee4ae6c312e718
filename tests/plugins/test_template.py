"""The template package installs and flies."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

TEMPLATE = Path(__file__).parents[2] / "examples" / "my-detector"
BEAVER = Path(sys.executable).with_name("beaver-ftc")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    copy = tmp_path_factory.mktemp("source") / "my-detector"
    subprocess.run(["cp", "-r", TEMPLATE, copy], check=True)
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*command, "--no-index", "--target", folder, copy], check=True)
    return folder


def _beaver(site, folder, *arguments):
    environment = {**os.environ, "PYTHONPATH": str(site)}
    return subprocess.run(
        [BEAVER, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def test_it_flies_by_name_and_by_class(site, tmp_path):
    for name, scheme in (("a", "my-cusum"), ("b", "mine")):
        (tmp_path / f"{name}.yaml").write_text(
            f"name: {name}\nduration_s: 14\nfdi: {{scheme: '{scheme}'}}\n"
            "reference: {q: [{sine: {amplitude_deg_s: 3, frequency_hz: 0.2}}]}\n"
            "faults: [{actuator: elevator, type: loss_of_effectiveness, magnitude: 0.4, at_s: 12}]\n"
            "expect: {detected_within_s: 0.1, isolated_as: elevator, no_false_alarm: true}\n"
        )
    given = ("--plugin", "mine=my_detector:MyCusum")
    done = _beaver(site, tmp_path, "run", "a.yaml", "b.yaml", "--no-report", *given)
    assert done.returncode == 0, done.stdout + done.stderr
