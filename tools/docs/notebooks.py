"""The notebooks with what they show: `python -m tools.docs.notebooks` runs them, stores texts and pictures.

Pictures are reduced to a few colours, so that a notebook stays small. `tests/test_notebooks.py` runs them
again and compares the texts.
"""

import base64
import io
import sys
import tempfile
from pathlib import Path
from typing import Any

from tools.docs.pictures import in_few_colours

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
COLOURS, WIDTH_PX = 64, 800
TIMEOUT_S = 1800
_KEPT = ("text/plain", "text/html", "image/png")


def run(path: Path) -> Any:
    """A notebook run from top to bottom, in an empty folder."""
    import nbclient
    import nbformat

    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        resources = {"metadata": {"path": folder}}
        nbclient.NotebookClient(notebook, timeout=TIMEOUT_S, resources=resources).execute()
    return notebook


def outputs(notebook: Any) -> list[Any]:
    """What its cells show."""
    return [output for cell in notebook.cells for output in cell.get("outputs", [])]


def texts(notebook: Any) -> list[str]:
    """What is shown in words, output by output."""
    shown = outputs(notebook)
    return [output.get("text") or output.get("data", {}).get("text/plain", "") for output in shown]


def pictures(notebook: Any) -> int:
    """How many pictures it shows."""
    return sum("image/png" in output.get("data", {}) for output in outputs(notebook))


def slim(notebook: Any) -> Any:
    """Without what differs each time it runs, and with small pictures."""
    for number, cell in enumerate((cell for cell in notebook.cells if cell.cell_type == "code"), 1):
        cell.execution_count, cell.metadata = number, {}
        cell.outputs = _without_notices(cell.outputs)
        for output in cell.outputs:
            if "execution_count" in output:
                output.execution_count = number
            if "data" in output:
                output.metadata = {}
                output.data = {kind: output.data[kind] for kind in _KEPT if kind in output.data}
            if "image/png" in output.get("data", {}):
                output.data["image/png"] = _reduced(output.data["image/png"])
    return notebook


def _without_notices(outputs: list[Any]) -> list[Any]:
    """Without standard error, such as the notice that code is compiled; what it has parted is one text."""
    kept: list[Any] = []
    for output in outputs:
        if output.get("name") == "stderr":
            continue
        if kept and output.output_type == "stream" and kept[-1].get("name") == output.name:
            kept[-1].text += output.text
        else:
            kept.append(output)
    return kept


def _reduced(picture: str) -> str:
    """A picture with fewer pixels and colours."""
    from PIL import Image

    image = Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB")
    if image.width > WIDTH_PX:
        image = image.resize(
            (WIDTH_PX, round(image.height * WIDTH_PX / image.width)), Image.Resampling.LANCZOS
        )
    return base64.b64encode(in_few_colours(image, COLOURS)).decode("ascii")


def main(names: list[str]) -> None:
    """Run the notebooks of these names, all without any, and store what they show."""
    import nbformat

    for path in sorted(FOLDER.glob("*.ipynb")):
        if not names or path.stem in names:
            nbformat.write(slim(run(path)), path)
            print(f"{path.name}: {path.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
