"""Specification of a sweep: model, plan, settings and measures, independent of the machine."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from lagcli.model.inputs import InputData
from lagcli.model.loader import load_text
from lagcli.model.model import Model
from lagcli.settings.settings import SettingsOverrides
from lagcli.sweeps.plan.plan import Plan
from lagcli.version import __version__


@dataclass(frozen=True, eq=False)
class Spec:
    """Specification that determines the result of each row from its number.

    It can be sent to another process or machine, which needs no files.

    Parameters
    ----------
    text, path : str
        Text of the model, and the name of its file.
    set, set_initial : mappings of str to numbers or text
        Values that replace the model's in all rows.
    settings : SettingsOverrides
        Overrides, not yet resolved.
    plan : Plan
    measures : tuple of (name, text)
    keep : "measures" or "trajectories"
        Whether the samples of each row are stored.
    strict : bool
        Whether a row with warnings counts as failed.
    data : mapping of str to InputData
        The tables of the model's inputs.
    """

    text: str
    path: str
    set: Mapping[str, object]
    set_initial: Mapping[str, object]
    settings: SettingsOverrides
    plan: Plan
    measures: tuple[tuple[str, str], ...]
    keep: str
    strict: bool = False
    data: Mapping[str, InputData] = field(default_factory=dict)

    @property
    def size(self) -> tuple[int, int]:
        """The numbers of rows and of measures."""
        return self.plan.length, len(self.measures)

    def load(self, values: Mapping[str, object] | None = None) -> Model:
        """Return the model with some parameters changed.

        Raises
        ------
        ModelError
            A value cannot be used.
        """
        values = {**self.set, **(values or {})}
        return load_text(self.text, self.path, values, self.set_initial, self.data)

    def described(self) -> dict[str, Any]:
        """Return the specification as JSON values; equal only for sweeps with equal rows."""
        inputs = {
            name: hashlib.sha256(x.times.tobytes() + x.values.tobytes()).hexdigest()
            for name, x in self.data.items()
        }
        return {
            **({"inputs": inputs} if inputs else {}),
            "lagcli": __version__,
            "model_sha256": hashlib.sha256(self.text.encode()).hexdigest(),
            "set": {name: str(value) for name, value in self.set.items()},
            "set_initial": {name: str(value) for name, value in self.set_initial.items()},
            "settings": self.settings.as_dict(),
            "plan": self.plan.described(),
            "measures": [list(x) for x in self.measures],
            "keep": self.keep,
            "strict": self.strict,
        }

    @cached_property
    def sha256(self) -> str:
        """The digest of the description."""
        return hashlib.sha256(json.dumps(self.described()).encode()).hexdigest()
