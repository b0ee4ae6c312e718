"""`python -m tools.requirements EXTRA ...`: what extras want beside the package, as pip and uv read it."""

import sys
import tomllib
from pathlib import Path


def requirements(*extras: str) -> list[str]:
    """A line for each, those of the package's own extras among them."""
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))[
        "project"
    ]
    found: list[str] = []
    for extra in extras:
        for wanted in project["optional-dependencies"][extra]:
            own = wanted.removeprefix(f"{project['name']}[").removesuffix("]")
            found += requirements(own) if own != wanted else [wanted]
    return found


if __name__ == "__main__":
    print(*requirements(*sys.argv[1:]), sep="\n")
