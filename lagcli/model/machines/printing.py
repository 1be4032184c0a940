"""Text of an expanded model file."""

from __future__ import annotations

import json
import re

from lagcli.model.yaml.source import Mapping, Scalar, Sequence, YamlNode

#: Text that needs no quotes in YAML, also in a flow mapping.
_PLAIN = re.compile(r"(?![-+]\s)[-+]?[\w.(][\w.+*/^()=<>' °µ-]*(?<! )")


def print_model(root: Mapping) -> str:
    """Return the text of a model file: a block for each key, an entry a line."""
    lines = []
    for name, key, node in root:
        if isinstance(node, Mapping) and node.entries:
            lines.append(f"{_key(name)}:")
            lines += [f"  {_key(key.value)}: {_flow(value)}".rstrip() for _, key, value in node]
        else:
            lines.append(f"{_key(name)}: {_flow(node)}".rstrip())
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if re.fullmatch(r"[\w.'(), =\[\]+*/-]+", name) else _scalar(name)


def _flow(node: YamlNode) -> str:
    if isinstance(node, Mapping):
        entries = (f"{_scalar(n)}: {_flow(value)}".rstrip() for n, _, value in node)
        return "{" + ", ".join(entries) + "}"
    if isinstance(node, Sequence):
        return "[" + ", ".join(map(_flow, node.items)) + "]"
    assert isinstance(node, Scalar)
    return "" if node.missing else _scalar(node.value.strip())


def _scalar(text: str) -> str:
    if _PLAIN.fullmatch(text):
        return text
    if not text.isprintable():
        return json.dumps(text)
    return "'" + text.replace("'", "''") + "'"
