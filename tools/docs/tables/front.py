"""What README shows."""

from pathlib import Path

from tools.docs.first_figure import write_figure
from tools.docs.pictures import lighten


def first_figure() -> str:
    """The picture a newcomer sees first, drawn of a flight flown now."""
    folder = Path("images")
    folder.mkdir(exist_ok=True)
    picture = lighten(write_figure(folder / "elevator-partial-loss.png"))
    return f"![Pitch rate, residual and surfaces of the published elevator case]({picture.as_posix()})"
