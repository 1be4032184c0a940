"""Function calls in expressions: arity checks, vector and rotation functions."""

from __future__ import annotations

import symengine as se
from symengine import Basic

from lagcli.functions import FUNCTIONS
from lagcli.model.expression import tensors
from lagcli.model.expression.tensors import ShapeError, Tensor
from lagcli.model.expression.tokens import ExpressionError, error_at
from lagcli.model.expression.trees import CallExpr, Name
from lagcli.model.names.scope import Scope
from lagcli.model.spelling import did_you_mean, nearest

TENSOR_FUNCTIONS: dict[str, tuple[str, ...]] = {
    "dot": ("tensor", "tensor"),
    "cross": ("tensor", "tensor"),
    "norm": ("tensor",),
    "transpose": ("tensor",),
    "omega": ("tensor",),
    "axial": ("tensor",),
    "rot_x": ("scalar",),
    "rot_y": ("scalar",),
    "rot_z": ("scalar",),
    "rot": ("tensor", "scalar"),
    "diag": ("scalar", "scalar", "scalar"),
    "quat": ("scalar", "scalar", "scalar", "scalar"),
}

_OTHER_NAMES = {
    **{alias: name for name, f in FUNCTIONS.items() for alias in f.aliases},
    **{"piecewise": "if", "where": "if"},
}
_ZERO, _ONE = se.Integer(0), se.Integer(1)
_AXES = {
    "rot_x": tensors.vector(_ONE, _ZERO, _ZERO),
    "rot_y": tensors.vector(_ZERO, _ONE, _ZERO),
    "rot_z": tensors.vector(_ZERO, _ZERO, _ONE),
}


def check_call(tree: CallExpr, scope: Scope) -> None:
    """Raise ExpressionError for an unknown function or a wrong number of arguments."""
    name, count = tree.function, len(tree.arguments)
    fewest: int
    most: int | None
    if name == "if":
        fewest = most = 3
    elif name in TENSOR_FUNCTIONS:
        fewest = most = len(TENSOR_FUNCTIONS[name])
    elif name in FUNCTIONS:
        fewest, most = FUNCTIONS[name].fewest, FUNCTIONS[name].most
    else:
        raise _unknown(tree, scope)
    if count < fewest or (most is not None and count > most):
        wanted = f"{fewest}" if most == fewest else f"{fewest} or more"
        if most not in (fewest, None):
            wanted = f"{fewest} or {most}"
        raise error_at(
            "wrong-arguments",
            f"`{name}` takes {wanted} argument{'s' if wanted != '1' else ''}, not {count}",
            tree,
            _count_help(tree),
        )


def _count_help(tree: CallExpr) -> str | None:
    """Return a remedy for a wrong number of arguments."""
    if tree.function == "if":
        return "write if(condition, a, b)"
    first = tree.arguments[0] if len(tree.arguments) == 1 else None
    if tree.function == "quat" and isinstance(first, Name):
        name = first.text
        return (
            f"a quaternion coordinate is a rotation already: write `{name}` if `{name}` is one;"
            " else name the four components"
        )
    return None


def _unknown(tree: CallExpr, scope: Scope) -> ExpressionError:
    name, end = tree.function, tree.start + len(tree.function)
    if scope.declared(name):
        message, help_ = f"`{name}` is not a function", f"write a product as `{name}*(…)`"
    elif name in _OTHER_NAMES:
        message = f"there is no function `{name}`"
        help_ = f"write it with `{name_of(name)}`"
    else:
        message = f"there is no function `{name}`"
        close = nearest(name, [*FUNCTIONS, *TENSOR_FUNCTIONS, *scope.functions, "body", "if"])
        help_ = did_you_mean(close) or "the functions are listed in docs/model-file.md"
    return ExpressionError("unknown-function", message, tree.start, end, help_, f"{name}()")


def name_of(name: str) -> str:
    """Return lagcli's name of a function that other programs call differently."""
    return _OTHER_NAMES.get(name, name)


def tensor_call(name: str, arguments: list[Basic | Tensor], scope: Scope) -> Basic | Tensor:
    """Apply a vector or rotation function to arguments of the right kinds.

    Raises
    ------
    ShapeError
        The shapes do not fit.
    """
    a, *rest = arguments
    match name:
        case "dot":
            return tensors.dot(a, *rest)
        case "cross":
            return tensors.cross(a, *rest)
        case "norm":
            return tensors.norm(a)
        case "axial":
            return tensors.axial(a)
        case "transpose":
            return tensors.transpose(a)
        case "quat":
            return tensors.quaternion(a, *rest)
        case "diag":
            return tensors.diagonal(a, *rest)
        case "omega":
            return tensors.angular_velocity(a, scope.derivative)
        case "rot":
            if any(scope.derivative(x) != 0 for x in a.entries):
                raise ShapeError("the axis of rot() must be constant")
            return tensors.rotation(a, *rest)
    return tensors.rotation(_AXES[name], a)
