"""Energies and forces: T, V, L, D and Q."""

from __future__ import annotations

from collections.abc import Mapping

import symengine as se
from symengine import Basic

from lagcli.model import model as symbols
from lagcli.model.draft import Draft, Parsed
from lagcli.model.expansion import nonlinear_in
from lagcli.model.expressions import Value
from lagcli.model.functions import derivative
from lagcli.model.model import Definition
from lagcli.model.scope import Context
from lagcli.model.source import Scalar
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.tensors import Tensor
from lagcli.model.tokens import ExpressionError


def read_energies(draft: Draft) -> tuple[Basic | None, Basic | None]:
    """Return T (None for a model written with L) and V (−L for such a model)."""
    given = [k for k in ("T", "V", "L") if k in draft.root.entries]
    if "L" in given:
        if len(given) > 1:
            key, other = draft.root.entries["L"][0], draft.root.entries[given[0]][0]
            draft.report.add(
                "contradiction",
                f"`L` stands in place of `T` and `V`, but `{given[0]}` is given too",
                key.location,
                "keep either `L`, or `T` and `V`",
                ((f"`{given[0]}` is given here", other.location),),
            )
            for name in given[:-1]:
                read_scalar(draft, name)
        lagrangian = read_scalar(draft, "L")
        return None, None if lagrangian is None else -lagrangian
    if "T" not in given and draft.meant.isdisjoint("TL"):
        draft.report.add(
            "missing-key",
            "the model has no kinetic energy `T`",
            draft.source.location(0, 0),
            "add `T` (and `V`), or `L`, as in `T: m/2*(x'^2 + y'^2)`",
        )
    kinetic = read_scalar(draft, "T")
    if "V" not in given:
        return kinetic, se.Integer(0)
    potential = read_scalar(draft, "V")
    if potential is not None:
        rates = list(map(symbols.velocity, draft.names.coordinates))
        found = nonlinear_in(potential, rates)
        if found is not None:
            draft.report.add(
                "nonlinear-potential",
                f"`V` is not linear in the velocity `{found.name}`",
                draft.root.entries["V"][1].location,
                "put what is quadratic in velocities into `T`, or write `L` in place of both",
            )
    return kinetic, potential


def read_scalar(draft: Draft, key: str) -> Basic | None:
    """Return the expression under a key of the model."""
    node = draft.get(key)
    if node is None:
        return None
    parsed = draft.parse(node, f"`{key}`")
    if parsed is None:
        return None
    draft.trees[key] = parsed.tree
    return draft.scalar(parsed, Context(f"`{key}`"))


def read_forces(draft: Draft, definitions: Mapping[str, Definition]) -> dict[str, Basic]:
    """Return Q_i by coordinate: Σ F·∂r/∂q_i over the entries of `Q`."""
    names = draft.names
    terms: dict[str, list[Basic]] = {}
    for name, key, node in draft.entries("Q") or []:
        what = f"the force on `{shorten(name)}`"
        known = name in names.coordinates or name in names.definitions
        if not known and not (names.incomplete or name in names.suspects):
            _report_unknown(draft, name, key)
        parsed = draft.parse(node, what)
        if parsed is None:
            continue
        draft.trees[f"Q.{name}"] = parsed.tree
        if name in names.coordinates:
            force = draft.scalar(parsed, Context(what))
            if force is not None:
                terms.setdefault(name, []).append(force)
            continue
        sized = draft.build(parsed, Context(what))
        if sized is not None and name in definitions:
            with draft.report.expression(parsed.node):
                _project(draft, sized.value, definitions[name], key, parsed, terms)
    return {name: se.Add(*parts) for name, parts in terms.items()}


def _report_unknown(draft: Draft, name: str, key: Scalar) -> None:
    names = draft.names
    base = name.rstrip("'").removesuffix("_dot")
    if base != name and (base in names.coordinates or base in names.definitions):
        help_: str | None = f"a force acts on the coordinate or along the definition: `{base}`"
    else:
        close = nearest(name, [*names.coordinates, *names.definitions])
        help_ = did_you_mean(close)
    draft.report.add(
        "unknown-name",
        f"`Q` names `{shorten(name)}`, which is neither a coordinate nor a definition",
        key.location,
        help_ or "a force acts on a coordinate, or along a definition such as x_B",
    )


def _project(
    draft: Draft,
    force: Value,
    along: Definition,
    key: Scalar,
    parsed: Parsed,
    terms: dict[str, list[Basic]],
) -> None:
    """Add F·∂r/∂q_i to each Q_i."""
    place = along.value
    if isinstance(place, Tensor) != isinstance(force, Tensor) or (
        isinstance(place, Tensor) and place.shape != force.shape
    ):
        wanted = place.kind if isinstance(place, Tensor) else "a scalar"
        raise ExpressionError(
            "shape",
            f"the force on `{along.name}` must be {wanted}, as `{along.name}` is",
            parsed.tree.start,
            parsed.tree.end,
            "a force along a vector is a vector of the same length",
        )
    pairs = (
        list(zip(force.entries, place.entries, strict=True))
        if isinstance(place, Tensor)
        else [(force, place)]
    )
    free = set().union(*(x.free_symbols for _, x in pairs))
    if any(symbols.velocity(name) in free for name in draft.names.coordinates):
        draft.report.add(
            "velocity-in-position",
            f"a force acts along a position, but `{along.name}` depends on velocities",
            key.location,
            "define the position, and give the force along that",
        )
        return
    for name in draft.names.coordinates:
        q = symbols.coordinate(name)
        if q in free:
            parts = [f * derivative(x, q) for f, x in pairs]
            terms.setdefault(name, []).append(se.Add(*parts))
