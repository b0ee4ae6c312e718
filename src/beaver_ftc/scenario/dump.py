"""A scenario back to text, complete and flyable again."""

import re
from typing import Any

import yaml
from pydantic import BaseModel

_SEPARATORS = re.compile("[\x85\u2028\u2029]")


class _Dumper(yaml.SafeDumper):
    """Short mappings and lists of numbers on one line, no aliases."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _is_leaf(value: Any) -> bool:
    return not isinstance(value, dict | list)


def _mapping(dumper: yaml.SafeDumper, mapping: dict[str, Any]) -> yaml.Node:
    flow = bool(mapping) and all(map(_is_leaf, mapping.values())) and "description" not in mapping
    return dumper.represent_mapping("tag:yaml.org,2002:map", mapping.items(), flow_style=flow)


def _list(dumper: yaml.SafeDumper, items: list[Any]) -> yaml.Node:
    return dumper.represent_sequence("tag:yaml.org,2002:seq", items, flow_style=all(map(_is_leaf, items)))


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.Node:
    """Line separators of Unicode are escaped: as they are, they read back as a space."""
    style = '"' if _SEPARATORS.search(text) else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.add_representer(str, _text)
_Dumper.add_representer(dict, _mapping)
_Dumper.add_representer(list, _list)


def to_yaml(scenario: BaseModel) -> str:
    """The fully resolved scenario, every default written out; loading it again gives an equal one."""
    data = scenario.model_dump(mode="json", exclude_none=True, by_alias=True)
    return yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=110)
