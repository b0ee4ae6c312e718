"""Parts of the frame are really taken out, and nothing but them."""

import numpy as np
import pytest

from beaver_ftc.design.fdc import SURFACES
from beaver_ftc.loop import stepping
from beaver_ftc.loop.loop import Loop
from beaver_ftc.studies.bench.parts import PARTS, frame_with, frame_without, nothing
from flying import scenario
from telling import bits


def test_all_parts_together_are_the_frame_itself():
    assert frame_with(len(PARTS)) is stepping.fly_on


@pytest.mark.parametrize("i", range(len(PARTS)))
def test_every_part_names_kernels_there_are(i):
    assert frame_with(i) is not stepping.fly_on


def test_an_unknown_kernel_is_refused():
    with pytest.raises(ValueError, match=r"no such kernel: frame\.dream"):
        frame_without({"frame.dream": nothing}, "dream")


def test_with_reading_alone_the_truth_is_read_and_nothing_else_happens():
    loop = Loop(scenario(duration_s=2))
    loop.fly_chunk(0, 10)
    loop.fly_on = loop.direct(frame_with(1))
    before = loop.frames.copy()
    commands = [loop.plant.read(f"fcs/{s}-cmd-rad") for s in SURFACES]
    loop.plant.write("fcs/elevator-cmd-rad", 0.01)
    loop.frames["row"] = 0
    loop.log[:] = np.nan
    loop.fly_frames(20, 1)
    now = loop.frames
    assert (now["truth"]["value"] != before["truth"]["value"]).any(axis=1).all()
    assert now["k"][0] == before["k"][0] + 20
    for untouched in ("fdi", "control", "accounts"):
        assert bits(now[untouched]) == bits(before[untouched])
    for untouched in ("f", "G", "sums", "means"):
        assert bits(now["prediction"][untouched]) == bits(before["prediction"][untouched])
    assert np.isnan(loop.log).all()
    assert loop.plant.read("fcs/elevator-cmd-rad") == 0.01 != commands[1]
