"""Energies and forces: T, V, L, D and Q."""

from __future__ import annotations

import symengine as se
from symengine import Basic

from lagcli.model.expression.algebra import nonlinear_in
from lagcli.model.expression.tensors import (
    Tensor,
    Value,
    angular_velocity,
    rotation_remedy,
)
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.model import Definition
from lagcli.model.names.draft import Draft, Entry, Formula, Parsed
from lagcli.model.names.families import Declaration, Member, by_name, members_of, read_key
from lagcli.model.names.members import members_clause
from lagcli.model.names.namespace import Allowed
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.source import Scalar, YamlNode


def read_energies(draft: Draft) -> tuple[Basic | None, Basic | None]:
    """Return T (None for a model written with L) and V (−L for such a model)."""
    given = [k for k in ("T", "V", "L") if k in draft.root.entries]
    if "L" in given:
        if len(given) > 1:
            key, other = draft.root.entries["L"][0], draft.root.entries[given[0]][0]
            draft.report.add(
                "contradiction",
                f"`L` replaces `T` and `V`, but `{given[0]}` is given too",
                key.location,
                "keep either `L`, or `T` and `V`",
                ((f"`{given[0]}` is given here", other.location),),
            )
            for name in given[:-1]:
                read_scalar(draft, name)
        lagrangian = read_scalar(draft, "L")
        return None, None if lagrangian is None else -lagrangian
    if "T" not in given and draft.misspelled_keys.isdisjoint("TL"):
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
        rates = sorted((s for s in potential.free_symbols if s.name.endswith("'")), key=str)
        rate = nonlinear_in(potential, rates)
        if rate is not None:
            draft.report.add(
                "nonlinear-potential",
                f"`V` is not linear in the velocity `{rate.name}`",
                draft.root.entries["V"][1].location,
                "write kinetic energy in `T`, and damping in `D`, the Rayleigh dissipation"
                f" function:\n`D: c/2*{rate.name}^2` gives the force -c*{rate.name}; or write `L`"
                " instead of `T` and `V`",
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
    return draft.scalar(parsed, f"`{key}`")


def read_forces(
    draft: Draft,
    entries: list[Entry],
    block: str = "Q",
) -> dict[str, Basic]:
    """Return Q_i by coordinate: Σ F·∂r/∂q_i over the entries of `Q`, or of impulses of an event."""
    terms: dict[str, list[Basic]] = {}
    declared = [_acted_on(draft, key, node, block) for _, key, node in entries]
    groups = [members_of(draft, d) for d in declared if d is not None]
    unique = by_name(draft, [member for group in groups for member in group])
    for group in groups:
        if group:
            chosen = [m for m in group if unique[m.name] is m]
            _read_force(draft, group[0].declaration, chosen, terms, block)
    return {name: se.Add(*parts) for name, parts in terms.items()}


def _acted_on(draft: Draft, key: Scalar, node: YamlNode, block: str) -> Declaration | None:
    """Return the target of a force; report an unknown name."""
    names = draft.names
    if "[" in key.value:
        declaration = read_key(draft, key, node, "force")
        if declaration is None:
            return None
    else:
        declaration = Declaration(key.value, key, node)
    family = declaration.family
    known = family in names.coordinates or family in names.definitions
    known = known or bool(names.families.get(family, set()) & {"coordinate", "definition"})
    if not known and not (names.incomplete or declaration.name in names.suspects):
        _report_unknown(draft, declaration.title, key, block)
    return declaration


def _read_force(
    draft: Draft,
    d: Declaration,
    members: list[Member],
    terms: dict[str, list[Basic]],
    block: str,
) -> None:
    """Add the forces of one entry."""
    names = draft.names
    what = f"the {'force' if block == 'Q' else 'impulse'} on `{shorten(d.title)}`"
    parsed = draft.parse(d.node, what)
    if parsed is None:
        return
    draft.trees[f"{block}.{d.title}"] = parsed.tree
    formula = Formula(draft, parsed, what, Allowed.MULTIPLIERS, d.indices)
    for member in members:
        name = member.name
        if name in names.coordinates:
            force = formula.scalar(member.indices)
            if force is not None:
                terms.setdefault(name, []).append(force)
            continue
        if d.spans and name not in names.definitions:
            if d.family in names.families and d.family not in names.broken:
                message = f"`Q` names `{name}`, but {members_clause(d.name, names.members(d.name))}"
                help_ = "use the same ranges" if d.several else "name another member"
                draft.report.add("no-member", message, d.key.location, help_)
                return
            continue
        sized = formula.value(member.indices)
        if sized is not None and name in draft.definitions:
            with draft.report.expression(parsed.node):
                formula.good = False
                formula.good = _project(
                    draft, sized.value, draft.definitions[name], d.key, parsed, terms
                )
        if not formula.good:
            return


def _report_unknown(draft: Draft, name: str, key: Scalar, block: str) -> None:
    names = draft.names
    block = block.rpartition(".")[2]  # `Q`, or the field `impulse` of an event
    base = name.rstrip("'").removesuffix("_dot")
    if f"{name}[]" in names.families:
        help_: str | None = f"name its members: `{name}[i = 1..N]`, or one, as in `{name}[1]`"
    elif base != name and (base in names.coordinates or base in names.definitions):
        help_ = f"a force acts on the coordinate or along the definition: `{base}`"
    else:
        close = nearest(name, [*names.coordinates, *names.definitions])
        help_ = did_you_mean(close)
    draft.report.add(
        "unknown-name",
        f"`{block}` names `{shorten(name)}`, which is neither a coordinate nor a definition",
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
) -> bool:
    """Add F·∂r/∂q_i to each Q_i; return whether this succeeded."""
    place = along.value
    both = isinstance(place, Tensor) and isinstance(force, Tensor)
    if both and force.shape == (3, 1) and place.is_rotation:
        _add_torque(draft, force, place, terms)
        return True
    if isinstance(place, Tensor) != isinstance(force, Tensor) or (
        isinstance(place, Tensor) and place.shape != force.shape
    ):
        wanted = place.kind if isinstance(place, Tensor) else "a scalar"
        raise ExpressionError(
            "shape",
            f"the force on `{along.name}` must be {wanted}, as `{along.name}` is",
            parsed.tree.start,
            parsed.tree.end,
            (both and rotation_remedy(place))
            or "a force along a vector is a vector of the same length",
        )
    pairs = (
        list(zip(force.entries, place.entries, strict=True))
        if isinstance(place, Tensor)
        else [(force, place)]
    )
    free = sorted(set().union(*(x.free_symbols for _, x in pairs)), key=str)
    coordinates = draft.names.coordinates
    if any(s.name.endswith("'") and s.name.rstrip("'") in coordinates for s in free):
        draft.report.add(
            "velocity-in-position",
            f"a force acts along a position, but `{along.name}` depends on velocities",
            key.location,
            "define the position, and give the force along that",
        )
        return False
    for q in free:
        if q.name in coordinates:
            parts = [f * draft.names.slope(x, q) for f, x in pairs]
            terms.setdefault(q.name, []).append(se.Add(*parts))
    return True


def _add_torque(
    draft: Draft, torque: Tensor, rotation: Tensor, terms: dict[str, list[Basic]]
) -> None:
    """Add τ·∂ω/∂q_i' to each Q_i: a torque on a body, in its frame."""
    names = draft.names
    omega = angular_velocity(rotation, names.derivative)
    for v in sorted(set().union(*(x.free_symbols for x in omega.entries)), key=str):
        name = v.name.removesuffix("'")
        if name != v.name and name in names.coordinates:
            pairs = zip(torque.entries, omega.entries, strict=True)
            parts = [tau * names.slope(w, v) for tau, w in pairs]
            terms.setdefault(name, []).append(se.Add(*parts))
