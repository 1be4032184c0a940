"""`lagcli completion`: completion in bash, zsh and fish."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, NamedTuple

from lagcli.cli.parameters import Argument, CommandParameter
from lagcli.results.formats import MODEL_SUFFIXES, SUFFIXES

Names = Callable[["CommandWords"], Iterable[str]]


class Candidate(NamedTuple):
    """A word with its description; a word that ends in ``=`` or ``/`` can be continued."""

    word: str
    help: str = ""


class CommandWords(NamedTuple):
    """A command line: the values of its arguments so far, and the word to complete."""

    arguments: list[str]
    word: str


def candidates(words: Sequence[str]) -> list[Candidate]:
    """Return the candidates for the last of the words that follow the program's name.

    Parameters
    ----------
    words : sequence of str
        At least one; the last may be empty.
    """
    from lagcli.cli.app import COMMANDS, command

    *before, word = words
    if not before:
        known = [Candidate(name, command(name).summary) for name in COMMANDS]
        return [c for c in known if c.word.startswith(word)]
    if before[0] not in COMMANDS:
        return []
    parameters = command(before[0]).parameters
    return [c for c in _of_command(parameters, before[1:], word) if c.word.startswith(word)]


def _of_command(
    parameters: Sequence[CommandParameter], before: Sequence[str], word: str
) -> Iterator[Candidate]:
    """Yield candidates for a word of a command."""
    options = {flag: p for p in parameters for flag in p.flags}
    arguments: list[str] = []
    pending = None  # the option whose value comes next
    for earlier in before:
        if pending is not None:
            pending = None
        elif earlier.startswith("-") and earlier != "-":
            option = options.get(earlier)
            pending = option if option is not None and not option.is_switch else None
        else:
            arguments.append(earlier)
    line = CommandWords(arguments, word)
    if pending is not None:
        yield from _values(pending, line)
    elif word.startswith("-"):
        for flag, option in options.items():
            if flag.startswith("--"):
                yield Candidate(flag, option.help)
    else:
        positional = [p for p in parameters if not p.flags]
        if positional:
            yield from _values(positional[min(len(arguments), len(positional) - 1)], line)


def _values(parameter: CommandParameter, line: CommandWords) -> Iterator[Candidate]:
    """Yield the values that a parameter of a command can have."""
    if parameter.choices:
        yield from map(Candidate, parameter.choices)
        return
    for key in (*parameter.flags, parameter.metavar):
        if key in _NAMES:
            yield from map(Candidate, _NAMES[key](line))
            return


# files


def _files(line: CommandWords, suffixes: tuple[str, ...]) -> Iterator[str]:
    """Yield the files with these suffixes, and folders."""
    folder, _, start = line.word.rpartition("/")
    prefix = f"{folder}/" if folder or line.word.startswith("/") else ""
    try:
        entries = sorted(os.scandir(prefix or "."), key=lambda entry: entry.name)
    except OSError:
        return
    for entry in entries:
        if entry.name.startswith(".") and not start.startswith("."):
            continue
        if entry.is_dir():
            yield f"{prefix}{entry.name}/"
        elif entry.name.endswith(suffixes):
            yield prefix + entry.name


def _models(line: CommandWords) -> Iterator[str]:
    yield from _files(line, MODEL_SUFFIXES)
    yield from _shipped(line)


def _shipped(line: CommandWords) -> Iterator[str]:
    from lagcli.model.reading import shipped_models

    yield from shipped_models()


def _results(line: CommandWords) -> Iterator[str]:
    yield from _files(line, SUFFIXES)


# names of the model in the line


def _keys(line: CommandWords, *keys: str) -> Iterator[str]:
    """Yield the names that the line's model declares under keys; none if it cannot be read."""
    from lagcli.errors import LagcliError
    from lagcli.model.reading import find_model, read_text
    from lagcli.model.yaml.composing import compose
    from lagcli.model.yaml.source import Mapping, Scalar, Sequence, Source

    model = next((a for a in line.arguments if find_model(a).is_file()), None)
    if model is None:
        return
    try:
        root, _ = compose(Source(*read_text(Path(model))))
    except LagcliError:
        return
    for key in keys:
        _, node = root.entries.get(key, (None, None))
        if isinstance(node, Mapping):
            yield from node.entries
        elif isinstance(node, Sequence):
            yield from (item.value for item in node.items if isinstance(item, Scalar))


def _parameters(line: CommandWords) -> Iterator[str]:
    for name in _keys(line, "parameters"):
        yield _assigned(name)


def _initial_values(line: CommandWords) -> Iterator[str]:
    for name in _keys(line, "coordinates"):
        yield _assigned(name)
        yield _assigned(f"{name}'")


def _presets(line: CommandWords) -> Iterator[str]:
    yield from _keys(line, "presets")


def _varied(line: CommandWords) -> Iterator[str]:
    yield from _parameters(line)
    yield from _initial_values(line)


def _assigned(name: str) -> str:
    """Return the beginning of NAME=VALUE; for a family, up to the index."""
    base, bracket, _ = name.partition("[")
    return base + (bracket or "=")


#: Values of an option or an argument, by its name or its metavar.
_NAMES: dict[str | None, Names] = {
    "--set": _parameters,
    "--set-initial": _initial_values,
    "--vary": _varied,
    "--preset": _presets,
    "--from": _shipped,
    "NAME": _shipped,
    "MODEL": _models,
    "MODEL…": _models,
    "FILE": _results,
    "FILE… [NAME…]": _results,
    "SWEEP.h5": _results,
    "FILE.yaml": lambda line: _files(line, MODEL_SUFFIXES),
}


class Shell(StrEnum):
    """Shells that have a completion script."""

    bash = "bash"
    zsh = "zsh"
    fish = "fish"


def completion(
    shell: Annotated[Shell, Argument(metavar="SHELL", help="bash, zsh or fish.")],
    words: Annotated[
        list[str] | None,
        Argument(metavar="[WORDS]", help="Complete the last of these words instead."),
    ] = None,
) -> None:
    """Print the completion script of a shell.

    It completes commands, options and their values, files, shipped models, and the names of the
    model's parameters, initial values and presets. Load it from the shell's start-up file:

    bash: eval "$(lagcli completion bash)"

    zsh: eval "$(lagcli completion zsh)", after compinit

    fish: lagcli completion fish | source
    """
    if words is None:
        print(_SCRIPTS[shell], end="")
        return
    for candidate in candidates(words):
        print(f"{candidate.word}\t{candidate.help}")


# Each script calls `lagcli completion SHELL -- WORDS`, which prints lines of a candidate, a tab and
# its help. Candidates that end in = or / are continued without a blank.
_BASH = r"""_lagcli() {
    local line words=("${COMP_WORDS[@]:1:COMP_CWORD}") current=${COMP_WORDS[COMP_CWORD]}
    COMPREPLY=()
    while IFS=$'\t' read -r line _; do
        COMPREPLY+=("$line")
        [[ $line == *[=/[] ]] && compopt -o nospace
    done < <(lagcli completion bash -- "${words[@]}" 2>/dev/null)
    # readline replaces the word after a quote, so only plain words are escaped
    if [[ $current != [\"\']* ]]; then
        local i
        for i in "${!COMPREPLY[@]}"; do
            printf -v "COMPREPLY[$i]" %q "${COMPREPLY[i]}"
        done
    fi
}
complete -o default -F _lagcli lagcli
"""
_ZSH = r"""#compdef lagcli
_lagcli() {
    local line word
    local -a plain plain_help open
    while IFS= read -r line; do
        word=${line%%$'\t'*}
        if [[ $word == *[=/[] ]]; then
            open+=("$word")
        else
            plain+=("$word")
            plain_help+=("$word  ${line#*$'\t'}")
        fi
    done < <(lagcli completion zsh -- "${(@Q)words[2,CURRENT]}" 2>/dev/null)
    (( $#open )) && compadd -S '' -- "${open[@]}"
    (( $#plain )) && compadd -l -d plain_help -- "${plain[@]}"
    (( $#open + $#plain )) || _files
}
if [[ $funcstack[1] == _lagcli ]]; then _lagcli "$@"; else compdef _lagcli lagcli; fi
"""
_FISH = r"""function __lagcli_complete
    set -l words (commandline -opc) (commandline -ct)
    set -l found (lagcli completion fish -- $words[2..-1] 2>/dev/null)
    if set -q found[1]
        printf '%s\n' $found
    else
        __fish_complete_path (commandline -ct)
    end
end
complete --command lagcli --no-files --keep-order --arguments '(__lagcli_complete)'
"""
_SCRIPTS = {Shell.bash: _BASH, Shell.zsh: _ZSH, Shell.fish: _FISH}
