"""Programs of the documentation, as modules."""

from importlib.util import module_from_spec, spec_from_file_location


def program(path):
    """Return a program as a module."""
    spec = spec_from_file_location(path.stem, path)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
