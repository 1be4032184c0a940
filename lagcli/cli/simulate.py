"""`lagcli simulate`: integrate the motion and write it."""

import signal
import sys
import time
from contextlib import nullcontext
from enum import StrEnum
from typing import Annotated, Any

import typer

from lagcli.cli.options import (
    Force,
    Json,
    ModelPath,
    NoColor,
    Quiet,
    SetInitial,
    SetParameter,
    assignments,
    refuse_same_file,
)
from lagcli.errors import LagcliError, UsageError

FAILED_STATUS, INTERRUPTED_STATUS = 3, 130


class Method(StrEnum):
    """Integration methods."""

    auto = "auto"
    DOP853 = "DOP853"
    Taylor = "Taylor"
    Rodas5P = "Rodas5P"
    RK45 = "RK45"
    RK23 = "RK23"
    Radau = "Radau"
    BDF = "BDF"
    LSODA = "LSODA"


class Formulation(StrEnum):
    """How the constraints are kept."""

    projection = "projection"
    baumgarte = "baumgarte"
    index1 = "index1"


class EngineName(StrEnum):
    """Engines."""

    compiled = "compiled"
    scipy = "scipy"


def simulate(
    model: ModelPath,
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Result file: .h5 (HDF5) or .csv, or - for CSV on standard output. Values stand"
            " for names in braces: run_{m}.h5, run_{phi:.3f}.csv.",
        ),
    ] = None,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    t_start: Annotated[float | None, typer.Option(help="Start time, s. [default: 0]")] = None,
    t_end: Annotated[float | None, typer.Option(help="End time, s. [default: 10]")] = None,
    samples: Annotated[
        int | None, typer.Option(help="Number of samples, both ends included. [default: 1001]")
    ] = None,
    dt: Annotated[
        float | None, typer.Option(help="Spacing of the samples, s, in place of --samples.")
    ] = None,
    times: Annotated[
        str | None, typer.Option(metavar="T1,T2,…", help="The sample times themselves, s.")
    ] = None,
    rtol: Annotated[float | None, typer.Option(help="Relative tolerance. [default: 1e-9]")] = None,
    atol: Annotated[float | None, typer.Option(help="Absolute tolerance. [default: 1e-10]")] = None,
    method: Annotated[
        Method | None,
        typer.Option(
            help="Integration method: auto is DOP853, and Rodas5P or Radau where the motion proves"
            " stiff; Taylor takes power series; RK45, RK23, BDF, LSODA are SciPy's. [default: auto]"
        ),
    ] = None,
    formulation: Annotated[
        Formulation | None,
        typer.Option(
            help="How the constraints are kept: projected after each step, by Baumgarte's"
            " stabilization, or not at all, which shows the drift. [default: projection]"
        ),
    ] = None,
    alpha: Annotated[
        float | None, typer.Option(help="Baumgarte's α, 1/s. [default: from the step]")
    ] = None,
    beta: Annotated[float | None, typer.Option(help="Baumgarte's β, 1/s. [default: α]")] = None,
    engine: Annotated[
        EngineName | None, typer.Option(help="Engine. [default: compiled, for its methods]")
    ] = None,
    max_step: Annotated[float | None, typer.Option(help="Largest step, s.")] = None,
    max_steps: Annotated[
        int | None, typer.Option(help="Give up after so many steps. [default: 10000000]")
    ] = None,
    timeout: Annotated[
        float | None, typer.Option(help="Give up after so many seconds of wall time.")
    ] = None,
    through_singular: Annotated[
        bool, typer.Option("--through-singular", help="Pass singular configurations.")
    ] = False,
    meta: Annotated[
        bool, typer.Option("--meta", help="Beside a CSV file, write FILE.json with its provenance.")
    ] = False,
    force: Force = False,
    quiet: Quiet = False,
    json: Json = False,
    no_color: NoColor = False,
) -> int:
    """Simulate the motion, with its multipliers, and write it.

    Without -o, only a summary is printed. A run that fails or is interrupted writes the samples
    that it reached, marked so.
    """
    from lagcli.model.model import Settings

    settings = Settings(
        t_start=t_start,
        t_end=t_end,
        samples=samples,
        dt=dt,
        times=times_of(times),
        rtol=rtol,
        atol=atol,
        method=method.value if method else None,
        formulation=formulation.value if formulation else None,
        alpha=alpha,
        beta=beta,
        engine=engine.value if engine else None,
        max_step=max_step,
        max_steps=max_steps,
        timeout=timeout,
        through_singular=through_singular or None,
    )
    try:
        return _run(
            model,
            output,
            assignments("--set", set),
            assignments("--set-initial", set_initial),
            settings,
            meta=meta,
            force=force,
            quiet=quiet,
            json=json,
            no_color=no_color,
        )
    except LagcliError as error:
        if json:
            from lagcli.cli.summary import error_object, to_json

            typer.echo(to_json(error_object(error)))
        raise


def _run(
    model: str,
    output: str | None,
    parameters: dict[str, str],
    initial: dict[str, str],
    settings: Any,
    *,
    meta: bool,
    force: bool,
    quiet: bool,
    json: bool,
    no_color: bool,
) -> int:
    from lagcli.cli import summary
    from lagcli.cli.output_name import resolve_name
    from lagcli.cli.progress import Progress
    from lagcli.extremes import Extremes
    from lagcli.interruption import Interruption
    from lagcli.model.loader import load
    from lagcli.results import check_target, open_writer
    from lagcli.samples import Samples
    from lagcli.simulation import compiled_available, prepare

    if output == "-" and json:
        raise UsageError("-o - and --json both want standard output; write to a file, or drop one")
    began = time.perf_counter()
    loaded = load(model, set=parameters, set_initial=initial)
    load_seconds = time.perf_counter() - began
    if output is not None:
        output = resolve_name(output, loaded)
        refuse_same_file(model, output)
        check_target(output, force=force, meta=meta)
    simulation = prepare(loaded, settings)
    if settings.engine is None and not compiled_available() and not quiet:
        print(
            "note: the compiled engine was not built (no C compiler at installation); running on"
            " the reference engine, which is slower",
            file=sys.stderr,
        )
    extremes = Extremes(loaded.constraint_names)
    writing = 0.0
    with (
        Interruption(signal.SIGINT, signal.SIGTERM) as interruption,
        nullcontext() if output is None else open_writer(output, force, meta) as writer,
    ):

        def take(samples: Samples) -> None:
            nonlocal writing
            extremes.add(vars(samples))
            if writer is not None and len(samples.time):
                entered = time.perf_counter()
                writer.append(samples)
                writing += time.perf_counter() - entered

        chosen = simulation.settings
        start, end = chosen.t_start or 0.0, chosen.times[-1] if chosen.times else chosen.t_end
        with Progress(start, end, enabled=not quiet, color=not no_color) as progress:
            record = simulation.run(take, progress, interruption)
        entered = time.perf_counter()
        if writer is not None and extremes.samples:
            writer.finish(record)
    now = time.perf_counter()
    seconds = {
        "load": load_seconds,
        **record.seconds,
        "write": writing + now - entered,
        "total": now - began,
    }
    written = output if extremes.samples else None
    result = summary.summarize(record, extremes, simulation.initial, written, seconds)
    if json:
        typer.echo(summary.to_json(result))
    elif not quiet:
        stream = sys.stderr if output == "-" else sys.stdout
        print(summary.format_summary(result, loaded.name), file=stream)
    if record.status == "completed":
        return 0
    print(f"error: {record.message}", file=sys.stderr)
    if output is not None:
        kept = f"kept {extremes.samples} samples in {output}" if written else "nothing written"
        print(f"   note: {kept}", file=sys.stderr)
    return INTERRUPTED_STATUS if record.status == "interrupted" else FAILED_STATUS


def times_of(text: str | None) -> tuple[float, ...] | None:
    """Return the numbers of --times.

    Raises
    ------
    UsageError
        They are none.
    """
    if text is None:
        return None
    try:
        return tuple(float(x) for x in text.split(","))
    except ValueError:
        raise UsageError(
            f"--times {text!r} is not a list of numbers, as in --times 0.5,1,2"
        ) from None
