"""`lagcli sweep`: many runs of one model, in one file."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from typing import Annotated, Any

import typer

from lagcli.cli import completion
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
from lagcli.cli.streams import print_notes, text_width, visible
from lagcli.cli.styles import print_listing
from lagcli.errors import UsageError
from lagcli.files import refuse_same_file
from lagcli.prose import counted
from lagcli.settings.settings import SettingsOverrides

_CAUSES, _MEASURES = 10, 20  # largest numbers of causes and measures in the summary
_LABEL = 12  # columns of its labels


class Keep(StrEnum):
    """The stored part of each row."""

    measures = "measures"
    trajectories = "trajectories"


@with_settings(without=("sensitivity",))
def sweep(
    model: ModelPath,
    output: Annotated[
        str,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Result file: .h5 (HDF5), or .csv for only the measures.",
        ),
    ],
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUES",
            autocompletion=completion.varied,
            help="A quantity to vary and its values: m=1:2:0.1, l=0.2,0.3,"
            " 'phi=linspace(0, pi, 9)', logspace(first, last, count), @file.csv; with --sample, a"
            " range: m=1..2, uniform, loguniform(a, b), normal(mean, deviation). Repeatable: all"
            " combinations.",
        ),
    ] = None,
    measure: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=EXPR",
            help="A number computed from each run: max, min, mean, rms, final, argmax, argmin of an"
            " expression, at(expression, time), time_of(condition), and arithmetic of these, e.g."
            " 'peak=max(abs(lambda.guide))'. Repeatable.",
        ),
    ] = None,
    keep: Annotated[
        Keep | None,
        typer.Option(
            help="Store only the measures, or all samples too. [default: measures if any is given"
            " or the samples take more than 1 GB, else trajectories]"
        ),
    ] = None,
    sample: Annotated[
        str | None,
        typer.Option(
            metavar="KIND:N", help="Sample N points from the ranges: sobol:N, lhs:N or random:N."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of --sample.")] = 0,
    zip_: Annotated[
        bool,
        typer.Option("--zip", help="Vary all quantities together instead of all combinations."),
    ] = False,
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs", "-j", min=1, help="Number of processes. [default: the number of processors]"
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Run the rows on the workers of a Dask scheduler, tcp://HOST:PORT, or local:N for"
            " N workers on this machine; needs lagcli[cluster].",
        ),
    ] = None,
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Continue an interrupted sweep: run the missing rows."),
    ] = False,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="With --resume, repeat failed rows too.")
    ] = False,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help="Count a row as failed if `lagcli simulate` would warn: its energy balance or"
            " residuals exceed what the tolerance explains, its inertia is negative, or values"
            " are not finite.",
        ),
    ] = False,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    preset: PresetName = None,
    *,
    settings: SettingsOverrides,
    force: Force = False,
    quiet: Quiet = False,
    json: Json = False,
    no_color: NoColor = False,
) -> int:
    """Simulate a model for many parameter and initial values.

    A failed row does not stop the others; its status and message are in the file, and the exit
    status is 3. --resume continues an interrupted sweep. Each process integrates eight rows at a
    time; rows of models with contacts, events or branches (`abs`, `if`, …) one by one.
    """
    from lagcli.cli.progress import RowProgress
    from lagcli.sweeps.run import sweep as run_sweep

    refuse_same_file(model, output)
    for item in vary or []:
        if item.lstrip().startswith("@"):
            refuse_same_file(item.strip()[1:], output, "the table of --vary")
    with (
        _workers(scheduler, jobs, quiet) as executor,
        RowProgress(enabled=not quiet, color=not no_color) as progress,
    ):
        summary = run_sweep(
            model,
            vary or [],
            output,
            measures=measure or [],
            keep=keep.value if keep else None,
            sample=sample,
            seed=seed,
            zipped=zip_,
            set=assignments("--set", set),
            set_initial=assignments("--set-initial", set_initial),
            preset=preset,
            jobs=jobs,
            resume=resume,
            retry_failed=retry_failed,
            strict=strict,
            force=force,
            progress=progress,
            executor=executor,
            settings=settings,
        )
    print_notes(summary.notes)
    if json:
        from lagcli.cli.summary import to_json

        print(to_json(summary.as_dict()))
    elif not quiet:
        print_listing(_text(summary, text_width()), _LABEL, plain=no_color, lost=True)
    for warning, count in summary.warnings.items():
        print(
            f"warning: {count} of {counted(summary.rows, 'row')}: {visible(warning)}",
            file=sys.stderr,
        )
    if summary.status == "interrupted":
        print(f"error: interrupted; {_kept(summary)}", file=sys.stderr)
        return INTERRUPTED_STATUS
    if summary.ok < summary.rows:
        failed = f"{summary.rows - summary.ok} of {counted(summary.rows, 'row')} failed"
        print(f"error: {failed}", file=sys.stderr)
        return FAILED_STATUS
    return 0


@contextmanager
def _workers(scheduler: str | None, jobs: int | None, quiet: bool) -> Iterator[Any]:
    """Yield a function that runs the rows on a cluster, if requested."""
    if scheduler is None:
        yield None
        return
    if jobs is not None:
        raise UsageError(
            "--jobs are processes of this machine, and --scheduler has workers of its own; give"
            " one of them (--scheduler local:N starts N workers here)"
        )
    from lagcli.sweeps.rows.cluster import Cluster

    def say(text: str) -> None:
        if not quiet:
            print(f"note: {visible(text)}", file=sys.stderr)  # the bar may replace the stream

    with Cluster(scheduler, say) as cluster:
        yield cluster.run


def _kept(summary: Any) -> str:
    """Print the number of rows that an interrupted sweep has stored."""
    if summary.output is None:
        return "the journal was removed while the sweep ran, so that no rows are kept"
    return (
        f"{summary.done} of {counted(summary.rows, 'row')} kept in {summary.output}\n"
        "   help: the same command with --resume continues"
    )


def _text(summary: Any, columns: int) -> str:
    """Return the summary as text."""
    from lagcli.results.listing import entry
    from lagcli.results.ranges import ValueRange, families_of, range_lines

    s = summary
    lines = [f"{s.status}: {s.done} of {counted(s.rows, 'row')}, {s.ok} good"]

    def said(label: str, text: str) -> None:
        lines.extend(entry(f"  {label}", text, _LABEL, columns))

    if s.done > s.run:
        said("found", f"{counted(s.done - s.run, 'row')} done before, {s.run} run now")
    causes = list(s.failed.items())
    for i, (cause, count) in enumerate(causes[:_CAUSES]):
        said("" if i else "failed", f"{count}: {cause}")
    if len(causes) > _CAUSES:
        said("", f"and {counted(len(causes) - _CAUSES, 'more cause')} (--json lists all)")
    ranges = [
        ValueRange(
            name, x["unit"] or "", x["min"], f"run {x['row_min']}", x["max"], f"run {x['row_max']}"
        )
        for name, x in s.ranges.items()
    ]
    if ranges:
        shown = families_of(ranges)
        lines += ["  measures", *range_lines(shown[:_MEASURES], columns, 4)]
        if len(shown) > _MEASURES:
            lines.append(f"    … {len(shown) - _MEASURES} more (lagcli info {s.output})")
    speed = f", {s.rows_per_second:.4g} rows per second" if s.run else ""
    said("time", f"{s.seconds:.2f} s{speed}")
    kept = "trajectories" if s.keep == "trajectories" else counted(len(s.measures), "measure")
    if s.status == "completed":
        said("written", f"{s.output}: {kept} of each row")
    return "\n".join(lines)
