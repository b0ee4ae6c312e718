"""The compiled frame and its plain Python form give the same numbers, on the truth of a faulty flight."""

import os
import subprocess
import sys

import numpy as np
import pytest

from beaver_ftc.loop.loop import Loop
from beaver_ftc.plant import channels as ch
from flying import scenario

FRAMES, FAULT_FRAME = 240, 60
WORDS = {
    "duration_s": FRAMES / 20,
    "rate_hz": 20,
    "faults": [
        {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.4, "at_s": FAULT_FRAME / 20}
    ],
}

# Flies the recorded truth once more: the frame alone, with the same inputs in either form.
PROGRAM = """
import sys
import numba, numpy as np
from beaver_ftc.loop.stepping import fly_frame
from beaver_ftc.loop.loop import Loop
from beaver_ftc.scenario.schema import Scenario
folder, law = sys.argv[1:]
words = np.load(f"{folder}/words.npy", allow_pickle=True).item()
truth, references = np.load(f"{folder}/truth.npy"), np.load(f"{folder}/references.npy")
loop = Loop(Scenario.model_validate(words | {"control": {"law": law}}))
frames = loop.frames.view(np.recarray) if numba.config.DISABLE_JIT else loop.frames
frames["truth"]["native"], frames["truth"]["factor"] = 0, 1.0
log = np.empty((len(truth), len(loop.columns)))
for k, seen in enumerate(truth):
    frames["truth"]["value"][0] = seen
    frames["truth"]["faulted"] = k >= int(words["faults"][0]["at_s"] * words["rate_hz"])
    fly_frame(frames, references, log)
np.save(f"{folder}/log-{law}-{numba.config.DISABLE_JIT}.npy", log)
"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A flight's truth, frame by frame in SI, and its references."""
    folder = tmp_path_factory.mktemp("recording")
    words = scenario(**WORDS).model_dump(mode="json", exclude_unset=True)
    loop = Loop(scenario(**WORDS))
    truth, references = np.empty((FRAMES, ch.most_channels(4))), np.empty((FRAMES, 3))
    for k in range(FRAMES):
        loop.fly_chunk(k, 1)
        truth[k], references[k] = loop.frames["truth"]["value"][0], loop.references[0]
    assert loop.land().isolated == "elevator"
    np.save(folder / "words.npy", words)
    np.save(folder / "truth.npy", truth)
    np.save(folder / "references.npy", references)
    return folder


def fly_again(folder, law, disable_jit):
    subprocess.run(
        [sys.executable, "-c", PROGRAM, str(folder), law],
        env={**os.environ, "NUMBA_DISABLE_JIT": str(disable_jit)},
        check=True,
    )
    return np.load(folder / f"log-{law}-{disable_jit}.npy")


@pytest.mark.parametrize("law", ["fault-tolerant", "oracle", "nominal"])
def test_every_column_of_the_log_agrees_to_rounding(recording, law):
    compiled, plain = (fly_again(recording, law, disable_jit) for disable_jit in (0, 1))
    assert np.ptp(compiled, axis=0).astype(bool).mean() > 0.7, "hardly anything moved: nothing was compared"
    np.testing.assert_allclose(plain, compiled, rtol=1e-12, atol=1e-12)
