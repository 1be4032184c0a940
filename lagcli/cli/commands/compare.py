"""`lagcli compare`: one motion by several formulations, methods and tolerances, or two models."""

from typing import Annotated

import typer

from lagcli.cli import completion
from lagcli.cli.operating_point import check_target, print_analysis
from lagcli.cli.options import (
    Force,
    Json,
    ModelPath,
    PresetName,
    Quiet,
    SetInitial,
    SetParameter,
    assignments,
    with_settings,
)
from lagcli.cli.quantities import real
from lagcli.errors import UsageError
from lagcli.files import refuse_same_file
from lagcli.settings.settings import SettingsOverrides


@with_settings("t_end", "samples")
def compare(
    model: ModelPath,
    other: Annotated[
        str | None,
        typer.Argument(
            help="Another model of the same system.",
            metavar="[OTHER]",
            autocompletion=completion.models,
        ),
    ] = None,
    formulation: Annotated[
        list[str] | None,
        typer.Option(
            "--formulation",
            metavar="NAME,…",
            help="projection, baumgarte, index1, ggl, maggi, second. Repeatable.",
        ),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option("--method", metavar="NAME,…", help="Integration methods. Repeatable."),
    ] = None,
    rtol: Annotated[
        list[str] | None,
        typer.Option("--rtol", metavar="R,…", help="Relative tolerances. Repeatable."),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Write the comparison: .json or .h5; lagcli plot draws the curves of a .h5.",
        ),
    ] = None,
    set: SetParameter = None,
    set_initial: SetInitial = None,
    preset: PresetName = None,
    *,
    settings: SettingsOverrides,
    json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Compare formulations, methods and tolerances, or two models.

    Shows drift, energy balance, differences of q and λ, steps and time. With a second model, shows
    the differences of the quantities that both have, and explains those of the multipliers.
    """
    from lagcli.analysis.compare.comparison import compare as find
    from lagcli.analysis.compare.description import (
        describe_comparison,
        describe_models,
        format_comparison,
    )
    from lagcli.analysis.compare.two_models import compare_models
    from lagcli.analysis.output.files import ANALYSIS_SUFFIXES, write_content
    from lagcli.model.loader import load

    check_target(model, output, ANALYSIS_SUFFIXES, force)
    chosen = [_names(x) for x in (formulation, method, rtol)]
    if other is not None:
        refuse_same_file(other, output)
        if any(chosen):
            raise UsageError(
                "--formulation, --method and --rtol are for one model; two models are compared"
                " with the settings of the first"
            )
    parameters, initial = assignments("--set", set), assignments("--set-initial", set_initial)
    loaded = load(model, parameters, initial, preset=preset)
    if other is None:
        content = describe_comparison(
            find(loaded, settings, chosen[0], chosen[1], [_number(x) for x in chosen[2]])
        )
    else:
        second = load(other, parameters, initial, preset=preset)
        found = compare_models(loaded, second, settings)
        content = describe_models(found, loaded.name, second.name)
    if output is not None:
        write_content(content, {}, loaded, output, force)
    print_analysis(content, lambda: format_comparison(content), output, json, quiet)


def _names(given: list[str] | None) -> list[str]:
    return [name for text in given or () for name in text.split(",") if name]


def _number(text: str) -> float:
    try:
        return real(text)
    except ValueError:
        raise UsageError(f"--rtol {text!r} is not a number; give --rtol 1e-6,1e-9") from None
