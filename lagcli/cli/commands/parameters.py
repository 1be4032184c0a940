"""`lagcli parameters`: the parameters of a model."""

from lagcli.cli.options import ModelPath, SetParameter, assignments


def parameters(model: ModelPath, set: SetParameter = None) -> int:
    """Print the parameters of a model with their values in SI."""
    from lagcli.model.loader import load

    for name, value in load(model, assignments("--set", set)).parameter_values.items():
        print(f"{name} = {value:g}")
    return 0
