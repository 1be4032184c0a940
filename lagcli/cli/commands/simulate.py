"""`lagcli simulate`: integrate the motion and write it."""

import signal
import sys
import time
from contextlib import nullcontext
from typing import TYPE_CHECKING, Annotated

import typer

from lagcli.cli.options import (
    FAILED_STATUS,
    INTERRUPTED_STATUS,
    Force,
    Json,
    ModelPath,
    NoColor,
    PresetName,
    Quiet,
    SetInitial,
    SetParameter,
    assignments,
    with_settings,
)
from lagcli.cli.streams import print_notes, text_width
from lagcli.errors import UsageError
from lagcli.files import refuse_same_file
from lagcli.prose import counted
from lagcli.results.formats import SUFFIX_TEXT
from lagcli.settings.settings import SettingsOverrides

if TYPE_CHECKING:
    from lagcli.model.model import Model


@with_settings()
def simulate(
    model: ModelPath,
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help=f"Result file: {SUFFIX_TEXT}, or - for CSV on standard output. Names in braces"
            " are replaced by values: run_{m}.h5, run_{phi:.3f}.csv.",
        ),
    ] = None,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    preset: PresetName = None,
    *,
    settings: SettingsOverrides,
    strict: Annotated[
        bool,
        typer.Option("--strict", help="Exit with status 3 if the summary has warnings."),
    ] = False,
    meta: Annotated[
        bool, typer.Option("--meta", help="Write the provenance of a CSV file to FILE.json.")
    ] = False,
    force: Force = False,
    quiet: Quiet = False,
    json: Json = False,
    no_color: NoColor = False,
) -> int:
    """Simulate the motion and write it with its multipliers.

    Without -o, only a summary is printed. If a run fails or is interrupted, the samples up to that
    time are written, and the result is marked.
    """
    from lagcli.cli import summary
    from lagcli.cli.progress import Progress
    from lagcli.model.loader import load
    from lagcli.results import check_target, open_writer
    from lagcli.results.formats import files_of
    from lagcli.simulations.cancellation import Interruption
    from lagcli.simulations.simulation import prepare
    from lagcli.trajectory.extremes import Extremes
    from lagcli.trajectory.samples import ENDED, Samples

    if output == "-" and json:
        raise UsageError("-o - and --json both use standard output; write to a file, or drop one")
    began = time.perf_counter()
    given = assignments("--set", set), assignments("--set-initial", set_initial)
    loaded = load(model, *given, preset=preset)
    load_seconds = time.perf_counter() - began
    if output is not None:
        from lagcli.cli.output_name import resolve_name

        output = resolve_name(output, loaded)
        for name in files_of(output):
            refuse_same_file(loaded.path, name)
            for table in loaded.input_files:
                refuse_same_file(table, name, "a table of the model's inputs")
        check_target(output, force=force, meta=meta)
    simulation = prepare(loaded, settings)
    simulation.check_memory()
    extremes = Extremes(loaded.constraint_names, simulation.monitor.names)
    writing, nothing = 0.0, None  # the empty block of a run that ended before its first sample
    with (
        Interruption(signal.SIGINT, signal.SIGTERM) as interruption,
        nullcontext() if output is None else open_writer(output, force, meta) as writer,
    ):

        def take(samples: Samples) -> None:
            nonlocal writing, nothing
            extremes.add(vars(samples))
            if not len(samples.time):
                nothing = samples
            elif writer is not None:
                entered = time.perf_counter()
                writer.append(samples)
                writing += time.perf_counter() - entered

        chosen = simulation.settings
        with Progress(
            chosen.t_start, chosen.t_end, enabled=not quiet, color=not no_color
        ) as progress:
            record = simulation.run(take, progress, interruption)
        entered = time.perf_counter()
        kept = bool(extremes.samples) or record.status in ENDED
        if writer is not None and kept:
            if nothing is not None:
                writer.append(nothing)
            writer.finish(record)
    now = time.perf_counter()
    seconds = {
        "load": load_seconds,
        **record.seconds,
        "write": writing + now - entered,
        "total": now - began,
    }
    written = output if kept else None
    nonlinear = [
        c.name
        for c in simulation.model.constraints
        if c.kind == "nonlinear" and not c.of_coordinate
    ]
    result = summary.summarize(record, extremes, simulation.initial, written, seconds, nonlinear)
    if json:
        print(summary.to_json(result))
    elif not quiet:
        from lagcli.cli.styles import print_listing

        stream = sys.stderr if output == "-" else sys.stdout
        text = summary.format_summary(result, loaded, text_width(stream))
        print_listing(text, summary.LABEL, stream, plain=no_color, lost=bool(written))
    if not quiet:
        from lagcli.model.hints import hints

        print_notes(map(str, hints(loaded)))
    if record.status in ENDED:
        for warning in record.warnings:
            print(f"{'error' if strict else 'warning'}: {warning}", file=sys.stderr)
            _say_where(loaded, warning)
        return FAILED_STATUS if strict and record.warnings else 0
    print(f"error: {record.message}", file=sys.stderr)
    _say_where(loaded, record.message)
    if output is not None:
        left = (
            f"kept {counted(extremes.samples, 'sample')} in {output}"
            if written
            else "nothing written"
        )
        print(f"   note: {left}", file=sys.stderr)
    return INTERRUPTED_STATUS if record.status == "interrupted" else FAILED_STATUS


def _say_where(model: "Model", message: str) -> None:
    """Print where the names in a message of the engine are declared."""
    from lagcli.model.locations import declarations_in

    for note in declarations_in(model, message):
        print(f"   note: {note}", file=sys.stderr)
