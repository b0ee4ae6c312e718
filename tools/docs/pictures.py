"""Pictures that commands draw: written light, and compared by what is seen."""

import io
from pathlib import Path
from typing import Any

import numpy as np

SEEN = 0.01  # mean difference of the colours, of 0 to 1, that is a change: other letters are less


def lighten(picture: Path) -> Path:
    """Reduce a picture to a palette of 256 colours: half of the size, and no difference to see.

    The palette covers all colours, however few pixels have one: a thin line keeps the colour of its legend.
    """
    from PIL import Image

    with Image.open(picture) as image:
        content = in_few_colours(image, 256)
    picture.write_bytes(content)
    return picture


def in_few_colours(image: Any, colours: int) -> bytes:
    """A picture of PIL as PNG with a palette."""
    from PIL import Image

    written = io.BytesIO()
    reduced = image.convert("RGB").quantize(colours, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    reduced.save(written, "png", optimize=True)
    return written.getvalue()


def write(path: Path, content: bytes) -> None:
    """Put a picture into its place."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    if path.suffix == ".png":
        lighten(path)


def look_the_same(path: Path, content: bytes) -> bool:
    """Whether a file shows what is drawn; what is no PNG has to be the same bytes."""
    if not path.is_file():
        return False
    if path.suffix != ".png":
        return path.read_bytes() == content
    stands, drawn = _pixels(path.read_bytes()), _pixels(content)
    return stands.shape == drawn.shape and float(np.abs(stands - drawn).mean()) < SEEN


def _pixels(content: bytes) -> np.ndarray:
    """Colours of 0 to 1, (height, width, 3)."""
    from PIL import Image

    with Image.open(io.BytesIO(content)) as image:
        return np.asarray(image.convert("RGB"), dtype=float) / 255.0
