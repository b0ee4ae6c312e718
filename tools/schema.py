"""A JSON Schema without references, for tools that read one."""

from collections.abc import Mapping
from typing import Any

Node = Mapping[str, Any]


def inlined(schema: Node) -> dict[str, Any]:
    """A schema with each definition in the place of a reference to it, with its name as the title. If the
    place says more, the definition is the one thing that may stand there.
    """
    definitions = schema.get("$defs", {})

    def written_out(node: Any) -> Any:
        if isinstance(node, list):
            return [written_out(one) for one in node]
        if not isinstance(node, dict):
            return node
        made = {key: written_out(of) for key, of in node.items() if key != "$ref"}
        if "$ref" not in node:
            return made
        name = node["$ref"].rpartition("/")[2]
        found = written_out(definitions[name]) | {"title": name}
        return made | {"anyOf": [found]} if made else found

    return written_out(schema)
