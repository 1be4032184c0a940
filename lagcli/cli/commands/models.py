"""`lagcli models`: the models that are installed with lagcli."""

import sys
from typing import Annotated

import typer

from lagcli.cli import completion
from lagcli.cli.options import Json


def models(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME", autocompletion=completion.shipped, help="Print the file of this model."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """List the shipped models, or print one of them.

    Their names can be used wherever a model file can: `lagcli derive slider_crank`.
    """
    import json as json_module
    import textwrap

    from lagcli.cli.streams import text_width, visible_json
    from lagcli.model.loader import load
    from lagcli.model.reading import shipped_model, shipped_models

    if name is not None:
        print(shipped_model(name).read_text(encoding="utf-8"), end="")
        return
    loaded = {key: load(path) for key, path in shipped_models().items()}
    if json:
        listed = [
            {"name": key, "description": model.description, "path": model.path}
            for key, model in loaded.items()
        ]
        print(visible_json(json_module.dumps({"command": "models", "models": listed})))
        return
    indent = " " * (max(map(len, loaded), default=0) + 2)
    width = text_width() if sys.stdout.isatty() else 80
    for key, model in loaded.items():
        whole = (model.description or "").replace(" = ", "\u00a0=\u00a0")  # no break around it
        lines = textwrap.wrap(whole, max(width - len(indent), 24))
        print(f"{key:<{len(indent)}}" + f"\n{indent}".join(lines).replace("\u00a0", " "))
