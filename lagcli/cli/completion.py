"""Completion of values: files, shipped models, and the names of the model's parameters.

Each function returns candidates for the beginning of a value, as the ``autocompletion`` of an
argument or option. Where there are none, the shell completes files by itself.
"""

import os
import shlex
from collections.abc import Iterator
from pathlib import Path

import typer

from lagcli.results.formats import MODEL_SUFFIXES, SUFFIXES


def models(incomplete: str) -> list[str]:
    """Return model files, folders and shipped models."""
    return _with_folders(incomplete, [*_files(incomplete, MODEL_SUFFIXES), *shipped()])


def model_files(incomplete: str) -> list[str]:
    """Return model files and folders."""
    return _with_folders(incomplete, [*_files(incomplete, MODEL_SUFFIXES)])


def results(incomplete: str) -> list[str]:
    """Return result files and folders."""
    return _with_folders(incomplete, [*_files(incomplete, SUFFIXES)])


def shipped() -> list[str]:
    """Return the names of the shipped models."""
    from lagcli.model.reading import shipped_models

    return list(shipped_models())


def parameters(ctx: typer.Context) -> list[str]:
    """Return the parameters of the line's model, as the beginning of NAME=VALUE."""
    return [_assigned(name) for name in _names(ctx, "parameters")]


def initial_values(ctx: typer.Context) -> list[str]:
    """Return the coordinates and velocities of the line's model, as `parameters`."""
    names = _names(ctx, "coordinates")
    return [_assigned(form) for name in names for form in (name, f"{name}_dot")]


def varied(ctx: typer.Context) -> list[str]:
    """Return what a sweep can vary: parameters and initial values."""
    return [*parameters(ctx), *initial_values(ctx)]


def presets(ctx: typer.Context) -> list[str]:
    """Return the names of the presets of the line's model."""
    return _names(ctx, "presets")


def _files(start: str, suffixes: tuple[str, ...]) -> Iterator[str]:
    """Yield the files with these suffixes in the folder of a word; those of folders end in /."""
    folder, slash, name = start.rpartition("/")
    prefix = folder + slash
    try:
        entries = sorted(os.scandir(prefix or "."), key=lambda entry: entry.name)
    except OSError:
        return
    for entry in entries:
        path = prefix + entry.name + "/" * entry.is_dir()
        hidden = entry.name.startswith(".") and not name.startswith(".")
        # the shell itself completes and quotes other names
        if path.endswith(suffixes) and not hidden and shlex.quote(path) == path:
            yield path


def _with_folders(start: str, found: list[str]) -> list[str]:
    """Return candidates, and folders if there are any: a shell completes a folder better."""
    fitting = [name for name in found if name.startswith(start)]
    return [*_files(start, ("/",)), *fitting] if fitting else []


def _names(ctx: typer.Context, key: str) -> list[str]:
    """Return the names that the line's model declares under a key; none if it cannot be read."""
    from lagcli.errors import LagcliError
    from lagcli.model.reading import find_model, read_text
    from lagcli.model.yaml.composing import compose
    from lagcli.model.yaml.source import Mapping, Scalar, Sequence, Source

    # behind an option that still waits for its value, arguments are not assigned to parameters
    words = [ctx.params.get("model"), *(ctx.params.get("models") or ()), *ctx.args]
    model = next((word for word in words if word and find_model(word).is_file()), None)
    if model is None:
        return []
    try:
        root, _ = compose(Source(*read_text(Path(model))))
    except LagcliError:
        return []
    _, node = root.entries.get(key, (None, None))
    if isinstance(node, Mapping):
        return list(node.entries)
    if isinstance(node, Sequence):
        return [item.value for item in node.items if isinstance(item, Scalar)]
    return []


def _assigned(name: str) -> str:
    """Return the beginning of NAME=VALUE; for a family, up to the index."""
    base, bracket, _ = name.partition("[")
    return base + (bracket or "=")
