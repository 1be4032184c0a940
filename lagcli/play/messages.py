"""Error messages in terms of the page: fields instead of options."""

from __future__ import annotations

import re

from lagcli.settings.settings import Settings

#: Matches a value of the page as written by the command line: in locations and in remedies.
_PLACE = re.compile(r"(?m)(^|\()--set(?:-initial)? ([\w\[\].,']+?)=(.*?)(?=: \w+\[[\w-]+\]: |\)$)")
_REMEDY = re.compile(r"""--set(?:-initial)? (['"]?)([\w\[\].,']+?)=([^`"\n]*?)\1(?=[`\s]|$)""")
_FREE = re.compile(r"\bfree ([^\n]+?), for instance `[^`\n]*`")
_SETTING = re.compile(
    r"--([a-z][a-z-]*[a-z])(?: ([-+\d][\w.+-]*|[A-Z]\w*|scipy|compiled|projection))?"
)
#: Settings that the page, or the command that starts it, provides.
_OWN = {"t_end": "t_end", "timeout": "`lagcli play --timeout`"}
_WHERE = "Settings are given under `simulation` in the model file; then start the page again."


def on_page(text: str) -> str:
    """Return a message that names fields of the page instead of options.

    Values become fields, guesses become marks, and settings belong in the model file.
    """
    found = _PLACE.sub(r"\1\2 = \3", text)
    found = _REMEDY.sub(r"\2 = \3", found)
    found = _FREE.sub(r"mark \1 as a guess", found)
    settings = []

    def setting(match: re.Match[str]) -> str:
        name, value = match[1].replace("-", "_"), match[2]
        if name not in Settings.DECLARED:
            return match[0]
        if name in _OWN:
            return _OWN[name] + (f" = {value}" if value else "")
        settings.append(name)
        return f"`{name}: {value}`" if value else f"`{name}`"

    found = _SETTING.sub(setting, found)
    return f"{found}\n{_WHERE}" if settings else found
