"""Values of a command's parameters, from the words of a command line.

Options and arguments can be mixed. ``--`` ends the options. The value of an option is the next
word, or follows it: ``--rtol 1e-6``, ``--rtol=1e-6``, ``-o run.h5``, ``-orun.h5``. Short switches
can be joined: ``-qh``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from lagcli.cli.parameters import CommandParameter
from lagcli.cli.quantities import WrongNumber


class CommandLineError(Exception):
    """Words that the parameters do not allow."""


def split(
    words: Sequence[str], parameters: Iterable[CommandParameter], *, mixed: bool = True
) -> tuple[dict[str, list[str]], list[str]]:
    """Return the texts of the given options by name, in the order of the line, and the other words.

    Parameters
    ----------
    words : sequence of str
    parameters : iterable of CommandParameter
    mixed : bool
        Whether options may follow other words.

    Raises
    ------
    CommandLineError
        There is no such option, or its value is missing or not allowed.
    """
    options = {flag: p for p in parameters for flag in p.flags}
    given: dict[str, list[str]] = {}
    others: list[str] = []
    left = list(reversed(words))  # the next word is the last

    def give(flag: str, option: CommandParameter) -> None:
        texts = given.setdefault(option.name, [])
        if not option.is_switch:
            if not left:
                raise CommandLineError(f"Option {flag!r} requires an argument.")
            texts.append(left.pop())

    while left:
        word = left.pop()
        if word == "--":
            break
        if not word.startswith("-") or word == "-":
            others.append(word)
            if not mixed:
                break
        elif word.startswith("--"):
            flag, equals, text = word.partition("=")
            option = options.get(flag)
            if option is None:
                raise _no_such_option(flag, options)
            if equals and option.is_switch:
                raise CommandLineError(f"Option {flag!r} does not take a value.")
            left += [text] * bool(equals)
            give(flag, option)
        else:
            for i, letter in enumerate(word[1:], start=2):
                option = options.get(f"-{letter}")
                if option is None:
                    raise CommandLineError(f"No such option: -{letter}")
                attached = not option.is_switch and word[i:]
                left += [word[i:]] * bool(attached)
                give(f"-{letter}", option)
                if attached:
                    break
    return given, others + left[::-1]


def _no_such_option(flag: str, known: Iterable[str]) -> CommandLineError:
    from difflib import get_close_matches

    near = get_close_matches(flag, [name for name in known if name.startswith("--")])
    listed = f" (Possible options: {', '.join(sorted(near))})" if near else ""
    return CommandLineError(f"No such option: {flag}{listed}")


def values(
    given: dict[str, list[str]], others: Sequence[str], parameters: Sequence[CommandParameter]
) -> dict[str, Any]:
    """Return the values of all parameters by name.

    Parameters
    ----------
    given : dict of lists of str
        Texts of options.
    others : sequence of str
        Texts of arguments; the last argument may take several.
    parameters : sequence of CommandParameter

    Raises
    ------
    CommandLineError
        A value is missing, not of its type, out of its range, or one too many.
    """
    rest = list(others)
    texts = dict(given)
    for p in parameters:
        if not p.flags and rest:
            texts[p.name] = [rest.pop(0) for _ in rest[: None if p.many else 1]]
    known = {p.name: p for p in parameters}
    ordered = [known[name] for name in given] + [p for p in parameters if not p.flags]
    ordered += [p for p in parameters if p not in ordered]
    results = {p.name: _value(p, texts.get(p.name)) for p in ordered}
    if rest:
        raise CommandLineError(f"Got unexpected extra argument(s) ({' '.join(rest)})")
    return results


def _value(parameter: CommandParameter, texts: list[str] | None) -> Any:
    """Return the value of a parameter, or its default."""
    if texts is None:
        if parameter.required:
            kind = "option" if parameter.flags else "argument"
            listed = ",\n\t".join(parameter.choices)
            choose = f" Choose from:\n\t{listed}" if listed else ""
            raise CommandLineError(f"Missing {kind} {_named(parameter)}.{choose}")
        return parameter.default
    if parameter.is_switch:
        return True
    if parameter.many:
        return [_converted(parameter, text) for text in texts]
    return _converted(parameter, texts[-1])


def _converted(parameter: CommandParameter, text: str) -> Any:
    if parameter.choices:
        for choice in parameter.choices:
            if choice == text:
                return choice
        raise _invalid(
            parameter, f"{text!r} is not one of {', '.join(map(_quoted, parameter.choices))}"
        )
    try:
        value = parameter.type(text)
    except WrongNumber as error:
        raise _invalid(parameter, str(error)) from None
    except ValueError:
        raise _invalid(parameter, f"{text!r} is not a valid {parameter.type_name}") from None
    least, most = parameter.least, parameter.most
    if (least is not None and value < least) or (most is not None and value > most):
        raise _invalid(parameter, f"{value} is not in the range {parameter.range}")
    return value


def _invalid(parameter: CommandParameter, problem: str) -> CommandLineError:
    return CommandLineError(f"Invalid value for {_named(parameter)}: {problem}.")


def _named(parameter: CommandParameter) -> str:
    """Return how messages call a parameter."""
    return " / ".join(map(_quoted, parameter.flags or (parameter.metavar or "",)))


def _quoted(text: str) -> str:
    return f"'{text}'"
