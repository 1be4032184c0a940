"""`lagcli new`: a new model file."""

import os
import re
import sys
from typing import Annotated

import typer

from lagcli.cli import completion
from lagcli.cli.options import Force, Quiet


def new(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE.yaml", autocompletion=completion.model_files, help="Model file to write."
        ),
    ],
    source: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="NAME",
            autocompletion=completion.shipped,
            help="Copy a shipped model (`lagcli models` lists them).",
        ),
    ] = None,
    coordinates: Annotated[
        str | None,
        typer.Option(metavar="NAMES", help="Coordinates of the model, e.g. x,y. [default: x,y]"),
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a new model file with comments, ready to run.

    Without options it is a pendulum in x and y.
    """
    from lagcli.errors import UsageError
    from lagcli.results.atomic import whole_file

    stem = re.fullmatch(r"(?:.*/)?([^/]+)\.ya?ml", file)
    if stem is None:
        raise UsageError(f"{file} is not a YAML file; name it {os.path.splitext(file)[0]}.yaml")
    if source is not None and coordinates is not None:
        raise UsageError("--from copies a model with its coordinates; leave out --coordinates")
    name = stem[1].removesuffix(".lag")
    text = _copy(source, name) if source else _template(name, coordinates)
    with whole_file(file, force) as target:
        target.write(text.encode())
    if not quiet:
        print(f"written: {file}", file=sys.stderr)
        print(f"next: lagcli derive {file}", file=sys.stderr)
        print(f"      lagcli simulate {file} -o {name}.h5", file=sys.stderr)


def _template(name: str, coordinates: str | None) -> str:
    from lagcli.errors import LagcliError, UsageError
    from lagcli.model.loader import load_text
    from lagcli.model.template import new_model

    names = [n.strip() for n in (coordinates or "").split(",")] if coordinates else []
    text = new_model(name, names)
    try:
        load_text(text)
    except LagcliError:
        raise UsageError(
            f"--coordinates {coordinates} cannot be the names of coordinates; write names such as"
            " x,y or phi_1,phi_2, separated by commas; m, k, t and names of functions are taken"
        ) from None
    return text


def _copy(source: str, name: str) -> str:
    from lagcli.model.reading import shipped_model

    text = shipped_model(source).read_text(encoding="utf-8")
    return re.sub(r"^name: .*", f"name: {name}", text, count=1, flags=re.M)
