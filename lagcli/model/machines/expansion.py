"""Expansion of bodies, joints and forces to the other keys of a model file."""

from __future__ import annotations

import re

from lagcli.model.keys import MACHINE
from lagcli.model.machines.bodies import Bodies
from lagcli.model.machines.forces import read_forces
from lagcli.model.machines.joints import Joints, pinned
from lagcli.model.machines.references import Key, items_of
from lagcli.model.machines.spatial_bodies import SpatialBodies
from lagcli.model.machines.spatial_starts import SpatialMachine
from lagcli.model.machines.starts import Machine
from lagcli.model.machines.written import MachineEntries
from lagcli.model.names.draft import Draft
from lagcli.model.yaml.source import Derived, Mapping, Scalar, YamlNode


def expand_machine(draft: Draft) -> Machine:
    """Replace the keys of machines in a draft by coordinates, T, V, constraints and others.

    Returns
    -------
    Machine
        Its bodies and joints, which place the bodies at the start.
    """
    written = MachineEntries(draft)
    dimension, reason = _dimension(draft)
    bodies: Bodies
    if dimension == 3:
        bodies = SpatialBodies(written, _free_index(draft), reason)
    else:
        bodies = Bodies(written, _free_index(draft))
    gravity = _gravity(written, dimension)
    nodes = {key: _block(draft, key) for key in ("bodies", "joints", "forces")}
    body_node = nodes["bodies"]
    if body_node is None:
        draft.report.finish()
        first = next(k for k in MACHINE if k in draft.root.entries)
        draft.report.add(
            "missing-key",
            f"the file has `{first}`, but no `bodies`",
            draft.root.entries[first][0].location,
            "a force on a coordinate is written under `Q`, as in `Q: {x: -c*x'}`;\nbodies are"
            " `bodies: {crank: {mass: 2 kg, length: 0.3 m}}`",
        )
        draft.report.finish()
    assert body_node is not None
    if "L" in draft.root.entries:
        draft.report.add(
            "contradiction",
            "`L` replaces `T` and `V`, which the bodies give",
            draft.root.entries["L"][0].location,
            "write `T` and `V`; they are added to those of the bodies",
        )
    bodies.read(body_node, gravity)
    joints = Joints(written, bodies, _fixed(draft))
    if nodes["joints"] is not None:
        joints.read(nodes["joints"])
    if nodes["forces"] is not None:
        read_forces(written, bodies, joints, nodes["forces"])
    draft.report.finish()  # errors of what is generated from these would follow
    machine = (SpatialMachine if dimension == 3 else Machine)(written, bodies, joints)
    draft.names.joints = set(joints.by_base)
    for joint in joints.by_base.values():
        coordinate = pinned(joint)
        if coordinate is not None and not joint.key.index:
            draft.names.aliases[joint.q] = coordinate
    draft.root = written.root(MACHINE)
    _rename(draft, joints)
    draft.report.finish()
    return machine


def _block(draft: Draft, key: str) -> Mapping | None:
    node = draft.get(key)
    if node is None or (isinstance(node, Scalar) and node.missing):
        return None
    examples = {
        "bodies": "crank: {mass: 2 kg, length: 0.3 m}",
        "joints": "O: revolute(ground.O, crank.a)",
        "forces": "s: spring(ground.O, crank.b, stiffness=100 N/m)",
    }
    return draft.mapping(node, f"`{key}`", f"write\n{key}:\n  {examples[key]}")


def _dimension(draft: Draft) -> tuple[int, str]:
    """Return the dimension of a machine, as given, or 3 where a vector has three components.

    The text says which vector that is.
    """
    node = draft.get("dimension")
    if node is None:
        vector = _in_space(draft)
        return (3, f"; {vector}, so that the machine is in space") if vector else (2, "")
    text = node.value.strip() if isinstance(node, Scalar) else ""
    if text not in ("2", "3"):
        draft.report.add(
            "wrong-value",
            f"`dimension` is {node.what}",
            node.location,
            "write `dimension: 2` for a machine in a plane, `dimension: 3` for one in space",
        )
    return (3 if text == "3" else 2), ""


def _in_space(draft: Draft) -> str:
    """Return which vector, of gravity and of the bodies, has three components."""
    vectors = [("gravity", draft.get("gravity"))]
    bodies = draft.get("bodies")
    for _, key, body in bodies if isinstance(bodies, Mapping) else ():
        for name, _, value in body if isinstance(body, Mapping) else ():
            own = f"{key.value}.{name}"
            if name in ("inertia", "com"):
                vectors.append((own, value))
            elif name == "points" and isinstance(value, Mapping):
                vectors += [(f"{own}.{point.value}", node) for _, point, node in value]
    for shown, node in vectors:
        items = items_of(node) if node is not None else None
        if node is not None and items is not None and len(items) == 3:
            return f"`{shown}` in line {node.location.line} has three components"
    return ""


def _gravity(written: MachineEntries, dimension: int) -> tuple[str, ...]:
    node = written.draft.get("gravity")
    if node is None:
        return ("0",) * dimension
    items = items_of(node)
    if items is None or len(items) != dimension:
        given = node.what if items is None else f"a list of {len(items)}"
        zeros = "0, " * (dimension - 1)
        written.report.add(
            "shape",
            f"`gravity` must be a vector of {dimension}, not {given}",
            node.location,
            f"write `gravity: [{zeros}-9.81 m/s^2]`"
            + ("; machines in space have `dimension: 3`" if dimension == 2 else ""),
        )
        return ("0",) * dimension
    key = Key("gravity", "", "", Derived("gravity", node.location, node))
    return tuple(written.parameter(key, axis, v) for axis, v in zip("xyz", items, strict=False))


def _free_index(draft: Draft) -> str:
    """Return a name for the indices of families that name none."""
    taken = set()
    for key in ("coordinates", "parameters", "definitions", "inputs", "bodies", "joints"):
        node = draft.get(key)
        if isinstance(node, Mapping):
            taken |= {re.split(r"[^\w]", name.strip())[0] for name in node.entries}
    return next(x for x in ("i", "j", "k", "n", "index", "i_") if x not in taken)


_JOINT = r"\s*(\w+)\s*(\[[^\]]*\])?\s*\.(angle|position)('|_dot)?\s*"


def _initial(draft: Draft) -> list[tuple[str, Scalar, YamlNode]]:
    node = draft.get("initial")
    return list(node) if isinstance(node, Mapping) else []


def _fixed(draft: Draft) -> list[str]:
    """Return the coordinates of joints that have a fixed initial value."""
    found = []
    for name, _, value in _initial(draft):
        match = re.fullmatch(_JOINT, name)
        if match is not None and not (isinstance(value, Mapping) and "guess" in value.entries):
            found.append(f"{match[1]}{'[]' if match[2] else ''}.{match[3]}")
    return found


def _rename(draft: Draft, joints: Joints) -> None:
    """Rename initial values of joints: the angle of a pin on the ground is that of its body.

    A guess of any other joint serves to place the bodies, and is removed.
    """
    entries = {}
    declared = draft.get("coordinates")
    known = set(declared.entries) if isinstance(declared, Mapping) else set()
    families = {re.sub(r"\[[^\]]*\]", "[]", name) for name in known}
    for name, key, value in _initial(draft):
        match = re.fullmatch(_JOINT, name)
        joint = joints.by_base.get(match[1]) if match else None
        if match is None or joint is None or not joint.quantity:
            entries[name] = (key, value)
            continue
        if match[3] not in joint.quantities:
            draft.report.add(
                "unknown-name",
                f"the joint `{match[1]}` has an {joint.quantity}, not `{match[3]}`"
                if joint.quantity == "angle"
                else f"the joint `{match[1]}` has a {joint.quantity}, not `{match[3]}`",
                key.location,
                f"write `{match[1]}{match[2] or ''}.{joint.quantity}`",
            )
            continue
        coordinate = pinned(joint)
        if coordinate is not None and not joint.key.index:
            primes = "'" if match[4] else ""
            renamed = coordinate + primes
            entries[renamed] = (key_at(renamed, key), value)
        elif re.sub(r"\[[^\]]*\]", "[]", f"{match[1]}{match[2] or ''}.{match[3]}") in families:
            entries[name] = (key, value)
    node = draft.get("initial")
    if isinstance(node, Mapping):
        key = draft.root.entries["initial"][0]
        made = Mapping(node.source, node.start, node.end, entries)
        draft.root.entries["initial"] = (key, made)


def key_at(name: str, key: Scalar) -> Scalar:
    """Return a key with another name at the place of a key."""
    return Derived(name, key.location, key)
