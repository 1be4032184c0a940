"""The plan of a sweep: the number of rows, and the values of each.

A row is a function of the plan and its number, so that rows need not be stored.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from lagcli.arrays import Array, Numbers
from lagcli.errors import UsageError
from lagcli.model.loader import load_text
from lagcli.model.model import InputData, Model
from lagcli.settings.settings import SettingsOverrides
from lagcli.sweeps.plan.factors import (
    MOST_OF_HYPERCUBE,
    MOST_OF_SOBOL,
    SAMPLE_KINDS,
    Factor,
    Sample,
    TableFactor,
)
from lagcli.sweeps.plan.vary import Drawn, read_vary
from lagcli.version import __version__

MOST_ROWS = 10**9


@dataclass(frozen=True, eq=False)
class Plan:
    """Quantities to vary and their values.

    Parameters
    ----------
    factors : tuple of Factor
        Crossed: the last factor varies fastest. Zipped: all have the same length, and vary
        together.
    zipped : bool
    given : tuple of str
        The texts of the options.
    """

    factors: tuple[Factor, ...]
    zipped: bool
    given: tuple[str, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the varied parameters, coordinates and velocities (``phi'``)."""
        return tuple(name for factor in self.factors for name in factor.columns)

    @property
    def length(self) -> int:
        """The number of rows."""
        lengths = [factor.length for factor in self.factors]
        return lengths[0] if self.zipped else math.prod(lengths)

    def rows(self, numbers: Numbers) -> Array:
        """Return the values, in SI, of given rows, (n, columns)."""
        parts, rest = [], numbers
        for factor in reversed(self.factors):
            if self.zipped:
                mine = numbers
            else:
                rest, mine = np.divmod(rest, factor.length)
            parts.append(factor.rows(mine))
        return np.hstack(parts[::-1])

    def described(self) -> dict[str, Any]:
        """Return the plan as JSON values; equal only for equal plans."""
        tables = {
            ", ".join(f.columns): hashlib.sha256(f.values.tobytes()).hexdigest()
            for f in self.factors
            if isinstance(f, TableFactor)
        }
        samples = {
            ", ".join(f.columns): {"kind": f.kind, "points": f.length, "seed": f.seed}
            for f in self.factors
            if isinstance(f, Sample)
        }
        return {
            "vary": list(self.given),
            "columns": list(self.columns),
            "rows": self.length,
            "zip": self.zipped,
            "sample": samples,
            "values_sha256": tables,
        }


def make_plan(
    model: Model,
    vary: Sequence[str],
    sample: str | None = None,
    seed: int = 0,
    zipped: bool = False,
    taken: Mapping[str, object] | None = None,
) -> Plan:
    """Make a plan from the texts of the options.

    Parameters
    ----------
    model : Model
    vary : sequence of str
        ``m=1:2:0.1``, ``@file.csv``, …; see docs/sweeps.md.
    sample : str, optional
        ``sobol:N``, ``lhs:N`` or ``random:N``: points over the quantities with a range.
    seed : int
    zipped : bool
        Whether the factors vary together instead of in all combinations.
    taken : mapping with str keys, optional
        Names with given values, which must not be varied.

    Raises
    ------
    UsageError, ModelError, FileError
        As `read_vary`; also if the options contradict each other.
    """
    if not vary:
        raise UsageError("nothing is varied: give --vary NAME=VALUES, as in --vary m=1:2:0.1")
    read = [read_vary(text, model) for text in vary]
    drawn = [x for x in read if isinstance(x, Drawn)]
    if drawn and sample is None:
        name, text = drawn[0].name, drawn[0].text
        raise UsageError(
            f"--vary {name}={text} is a range: give --sample sobol:1000 (or lhs:, random:) to draw"
            f" from it, or a grid, as in --vary {name}=1:2:0.1"
        )
    if sample is not None and not drawn:
        raise UsageError(
            f"--sample {sample} has nothing to draw from: give a range, as in --vary m=1..2"
        )
    factors: list[Factor] = []
    for x in read:
        if not isinstance(x, Drawn):
            factors.append(x)
        elif x is drawn[0]:
            assert sample is not None
            factors.append(_sample(sample, seed, drawn))
    plan = Plan(tuple(factors), zipped, tuple(t.strip() for t in vary))
    _check(plan, taken or {})
    return plan


def _sample(text: str, seed: int, drawn: Sequence[Drawn]) -> Sample:
    kind, _, number = text.strip().partition(":")
    if kind not in SAMPLE_KINDS or not re.fullmatch("0*[1-9][0-9]{0,17}", number):
        raise UsageError(
            f"--sample {text!r} is not of the form sobol:N, lhs:N or random:N, as in"
            " --sample sobol:1000"
        )
    if seed < 0:
        raise UsageError(f"--seed {seed} is negative; give a whole number from 0 on")
    count = int(number)
    if kind == "lhs" and count * len(drawn) > MOST_OF_HYPERCUBE:
        raise UsageError(
            f"--sample {text}: a Latin hypercube of so many points does not fit into memory; give"
            f" --sample sobol:{count}"
        )
    if kind == "sobol" and count > MOST_OF_SOBOL:
        raise UsageError(
            f"--sample {text}: a Sobol sequence has at most 2^30 points; give --sample"
            f" random:{count}"
        )
    return Sample(
        kind, count, seed, tuple(x.name for x in drawn), tuple(x.distribution for x in drawn)
    )


def _check(plan: Plan, taken: Mapping[str, object]) -> None:
    columns = plan.columns
    for i, name in enumerate(columns):
        if name in columns[:i]:
            raise UsageError(f"--vary gives `{name}` twice; keep one of them")
        if name in taken:
            raise UsageError(
                f"`{name}` is both varied and set to {taken[name]}; drop --set, or --vary {name}"
            )
    if plan.zipped and len({factor.length for factor in plan.factors}) > 1:
        lengths = ", ".join(f"{'+'.join(f.columns)} has {f.length}" for f in plan.factors)
        raise UsageError(
            f"--zip varies all quantities together, but {lengths}; make the numbers of values equal"
        )
    if plan.length > MOST_ROWS:
        raise UsageError(f"these are {plan.length:,} rows; a sweep has at most 10^9")


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
