"""YAML files, as tools read them."""

from pathlib import Path
from typing import Any

import yaml


def yaml_of(path: Path) -> Any:
    """The data of a YAML file."""
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def beside(module: str) -> Any:
    """The data of the YAML file with the name of a module, whose `__file__` is given."""
    return yaml_of(Path(module).with_suffix(".yaml"))
