"""`lagcli completion`: completion in bash, zsh and fish."""

from enum import StrEnum
from typing import Annotated

import typer


class Shell(StrEnum):
    """Shells that have a completion script."""

    bash = "bash"
    zsh = "zsh"
    fish = "fish"


def completion(
    shell: Annotated[Shell, typer.Argument(metavar="SHELL", help="bash, zsh or fish.")],
    words: Annotated[
        list[str] | None,
        typer.Argument(metavar="[WORDS]", help="Complete the last of these words instead."),
    ] = None,
) -> None:
    """Print the completion script of a shell.

    It completes commands, options and their values, files, shipped models, and the names of the
    model's parameters and initial values. Load it from the shell's start-up file:

    bash: eval "$(lagcli completion bash)"

    zsh: eval "$(lagcli completion zsh)", after compinit

    fish: lagcli completion fish | source
    """
    if words is None:
        print(_SCRIPTS[shell], end="")
        return
    from lagcli.cli.completion import candidates

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
