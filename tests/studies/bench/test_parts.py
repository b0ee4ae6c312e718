"""Parts of the frame are really taken out, and nothing but them."""

import pytest

from beaver_ftc.loop import stepping
from beaver_ftc.studies.bench.parts import PARTS, frame_with, frame_without, nothing


def test_all_parts_together_are_the_frame_itself():
    assert frame_with(len(PARTS)) is stepping.fly_on


@pytest.mark.parametrize("i", range(len(PARTS)))
def test_every_part_names_kernels_there_are(i):
    assert frame_with(i) is not stepping.fly_on


def test_an_unknown_kernel_is_refused():
    with pytest.raises(ValueError, match=r"no such kernel: frame\.dream"):
        frame_without({"frame.dream": nothing}, "dream")
