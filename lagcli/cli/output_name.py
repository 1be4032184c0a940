"""File names that contain values of the run: ``run_{m}_{phi:.3f}.h5`` → ``run_2_0.500.h5``."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from lagcli.errors import UsageError
from lagcli.model.spelling import did_you_mean, nearest, shorten

if TYPE_CHECKING:
    from lagcli.model.model import Model

_PIECES = r"\{\{|\}\}|\{(?P<field>[^{}]*)\}|[{}]"
#: Format specifications after the colon: those of Python that are valid in a file name: no
#: fill characters (``/`` would be a folder) and no padding with blanks (a shell splits there).
_FORMAT = r"\+?(0[1-9]\d?)?(d|(\.\d\d?)?[eEfFgG]?)"
_SHOWN = 30


def resolve_name(template: str, model: Model) -> str:
    """Return a file name in which names in braces are replaced by values of the model.

    Parameters
    ----------
    template : str
        ``{m}`` is replaced by the value of the parameter m in SI, with enough digits to distinguish
        it from any other; ``{phi}``, ``{phi_dot}`` (or ``{phi'}``) by initial values as given,
        before the consistent initialization. ``{m:.3f}`` specifies the format: optional ``+``,
        ``0`` and width, ``.`` and digits, one of ``d e E f F g G``. ``{{`` and ``}}`` are literal
        braces.
    model : Model
        The model with the values of the command line.

    Returns
    -------
    str

    Raises
    ------
    UsageError
        A name is neither a parameter nor an initial value, a format is invalid or unsuitable for
        the value, or a brace is unbalanced.
    """
    if "{" not in template and "}" not in template:
        return template
    values = _values(model)

    def piece(match: re.Match[str]) -> str:
        text = match[0]
        if text in ("{{", "}}"):
            return text[0]
        if match["field"] is None:
            raise _wrong(
                template,
                f"`{text}` at character {match.start() + 1} has no matching brace",
                f"write {text * 2} for a brace",
            )
        name, _, form = match["field"].partition(":")
        name = "".join(name.split())
        if name not in values:
            raise _unknown(template, name, list(values))
        if not re.fullmatch(_FORMAT, form):
            raise _wrong(
                template,
                f"`{shorten(form)}` is not a number format",
                f"write for example {{{name}:.3f}}, {{{name}:05.1f}}, {{{name}:.2e}},"
                f" or {{{name}:03d}} for whole numbers",
            )
        return _written(template, name, values[name], form)

    return re.sub(_PIECES, piece, template)


def _values(model: Model) -> dict[str, float]:
    """Return the values that can be used."""
    values = model.parameter_values
    for q, initial in model.initial_positions.items():
        values[q] = initial.value
    for q, initial in model.initial_velocities.items():
        base, bracket, index = q.partition("[")
        values[f"{base}_dot{bracket}{index}"] = values[f"{q}'"] = initial.value
        values[f"{q}_dot"] = initial.value
    return values


def _written(template: str, name: str, value: float, form: str) -> str:
    if not form:
        return repr(value).removesuffix(".0")
    if not form.endswith("d"):
        return format(value, form)
    if not value.is_integer():
        raise _wrong(
            template,
            f"{name} = {value!r} is not whole, which the format `{form}` asks for",
            f"write {{{name}}} for all its digits, or {{{name}:.3f}}",
        )
    return format(int(value), form)


def _unknown(template: str, name: str, known: list[str]) -> UsageError:
    if not name:
        return _wrong(template, "there is no name between the braces", "write {{}} for braces")
    shown = [k for k in known if not k.endswith("'")]
    rest = f" and {len(shown) - _SHOWN} more" if len(shown) > _SHOWN else ""
    return _wrong(
        template,
        f"`{shorten(name)}` is neither a parameter nor an initial value of the model",
        did_you_mean(nearest(name, known))
        or f"there are {', '.join(shown[:_SHOWN])}{rest}; for a brace write {{{{",
    )


def _wrong(template: str, what: str, remedy: str) -> UsageError:
    return UsageError(f"-o {shorten(template)}: {what}; {remedy}")
