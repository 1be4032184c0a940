"""The options of a run, which several commands share; one for each field of Settings."""

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lagcli.errors import UsageError

if TYPE_CHECKING:
    from lagcli.model.model import Settings


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


StartTime = Annotated[float | None, typer.Option(help="Start time, s. [default: 0]")]
EndTime = Annotated[float | None, typer.Option(help="End time, s. [default: 10]")]
SampleCount = Annotated[
    int | None, typer.Option(help="Number of samples, both ends included. [default: 1001]")
]
Spacing = Annotated[
    float | None, typer.Option(help="Spacing of the samples, s, in place of --samples.")
]
SampleTimes = Annotated[
    str | None, typer.Option(metavar="T1,T2,…", help="The sample times themselves, s.")
]
RelativeTolerance = Annotated[
    float | None, typer.Option(help="Relative tolerance. [default: 1e-9]")
]
AbsoluteTolerance = Annotated[
    float | None,
    typer.Option(
        help="Absolute tolerance, for all coordinates and velocities. [default: by their size]"
    ),
]
MethodOption = Annotated[
    Method | None,
    typer.Option(
        help="Integration method: auto is DOP853, and Rodas5P or Radau where the motion proves"
        " stiff; Taylor takes power series; RK45, RK23, BDF, LSODA are SciPy's. [default: auto]"
    ),
]
FormulationOption = Annotated[
    Formulation | None,
    typer.Option(
        help="How the constraints are kept: projected after each step, by Baumgarte's"
        " stabilization, or not at all, which shows the drift. [default: projection]"
    ),
]
Alpha = Annotated[float | None, typer.Option(help="Baumgarte's α, 1/s. [default: from the step]")]
Beta = Annotated[float | None, typer.Option(help="Baumgarte's β, 1/s. [default: α]")]
EngineOption = Annotated[
    EngineName | None, typer.Option(help="Engine. [default: compiled, for its methods]")
]
LargestStep = Annotated[float | None, typer.Option(help="Largest step, s.")]
MostSteps = Annotated[
    int | None, typer.Option(help="Give a run up after so many steps. [default: 10000000]")
]
Timeout = Annotated[
    float | None, typer.Option(help="Give a run up after so many seconds of wall time.")
]
ThroughSingular = Annotated[
    bool, typer.Option("--through-singular", help="Pass singular configurations.")
]


def settings_of(times: str | None, **options: Any) -> "Settings":
    """Return the Settings that options ask for.

    Raises
    ------
    UsageError
        The times are no list of numbers.
    """
    from lagcli.model.model import Settings

    values: dict[str, Any] = {
        k: x.value if isinstance(x, StrEnum) else x for k, x in options.items()
    }
    return Settings(times=_times(times), **values)


def _times(text: str | None) -> tuple[float, ...] | None:
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
