"""Parameters that nothing in a model file uses."""

from __future__ import annotations

import re
from collections.abc import Iterator

from lagcli.model.expression.units import WITH_UNIT, is_unit
from lagcli.model.model import Model
from lagcli.model.names.members import family_of
from lagcli.model.spelling import nearest
from lagcli.model.yaml.composing import compose
from lagcli.model.yaml.source import Mapping, Scalar, Sequence, Source, YamlNode

#: Blocks and fields that contain text, or that name parameters without using their values.
_TEXTS = ("name", "title", "description", "presets")
_FIELDS = ("description", "unit", "label", "latex")
_NAMING = (("fit", "data"), ("fit", "parameters"), ("simulation", "sensitivity"))
_IDENTIFIER = re.compile(r"[^\W\d]\w*")


def unused_parameters(model: Model) -> dict[str, list[str]]:
    """Return the parameters and families of them that nothing uses, with similar names.

    A name that occurs anywhere outside of texts, units and its own declaration counts as used.
    """
    root, _ = compose(Source(model.text, model.path))
    used = {name for text in _formulas(root, ()) for name in _IDENTIFIER.findall(text)}
    declared = dict.fromkeys(_IDENTIFIER.findall(family_of(x))[0] for x in model.parameters)
    unused = [name for name in declared if name not in used]
    others = [x for x in declared if x not in unused]
    return {name: nearest(name, others, 1) for name in unused}


def _formulas(node: YamlNode, path: tuple[str, ...]) -> Iterator[str]:
    """Yield the texts of a model file that may use parameters."""
    if isinstance(node, Scalar):
        number = WITH_UNIT.fullmatch(node.value)
        if number is None or not is_unit(number[2].strip()):
            yield node.value
    elif isinstance(node, Sequence):
        for item in node.items:
            yield from _formulas(item, path)
    elif isinstance(node, Mapping):
        for key, _, value in node:
            inside = (*path, key)
            if inside in _NAMING or (not path and key in _TEXTS):
                continue
            if len(path) > 1 and key in _FIELDS and isinstance(value, Scalar):
                continue
            # the range of a family's index uses parameters, its name is declared
            yield key if path != ("parameters",) else _IDENTIFIER.sub("", key, count=1)
            yield from _formulas(value, inside)
