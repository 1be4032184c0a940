"""Text of a new model file: commented, with all common keys, and ready to run."""

from __future__ import annotations

from collections.abc import Sequence

_HEADER = """\
# yaml-language-server: $schema=lagcli.schema.json
# The line above is for editors; `lagcli schema -o lagcli.schema.json` writes the schema.
"""

_PENDULUM = """\
name: {name}
title: Pendulum         # heading of derivations and pages
description: Point mass on a massless rod, in x and y.

coordinates:            # the unknowns, with their SI units
  x: m
  y: {{unit: m, description: upward}}

parameters:             # values with units; change one by --set l=2
  m: 1 kg
  g: 9.81 m/s^2
  l: {{value: 1 m, description: length of the rod}}

definitions:            # abbreviations for expressions
  r: sqrt(x^2 + y^2)

T: m/2*(x'^2 + y'^2)    # kinetic energy; x' is the velocity of x
V: m*g*y                # potential energy

# Q: {{x: -c*x'}}         # other forces, by coordinate or along a definition

constraints:            # each has its multiplier: lambda.rod
  rod: x^2 + y^2 = l^2

initial:                # a value for every coordinate and every velocity
  x: 0.6 m
  y: {{guess: -0.8 m}}    # a guess is moved onto the constraints
  x': 0 m/s
  y': {{guess: 0 m/s}}

outputs:                # additional columns of the result
  tension: {{expr: -2*lambda.rod*r, unit: N, description: force in the rod}}

simulation: {{t_end: 10, samples: 501}}

view:                   # the drawing, for `lagcli animate` and `lagcli report`
  points:
    O: [0, 0]
    A: [x, y]
  rods: [O-A]
  grounds: [O]
  trails: [A]
  vectors:
    rod: {{at: A, force: rod}}
"""

_GENERAL = """\
name: {name}
title: Masses on springs
description: Masses on springs; a start for a model in {listed}.

coordinates:            # the unknowns; to give units: {{x: m, phi: {{unit: rad, description: …}}}}
  [{listed}]

parameters:             # change one by --set k=20
  m: 1
  k: 10

# definitions:          # abbreviations for expressions

T: {kinetic}
V: {potential}

# Q: {{{first}: -c*{first}'}}     # other forces, by coordinate or along a definition

# constraints:          # each has its multiplier: lambda.NAME
#   NAME: {constraint}

initial:                # a value for every coordinate and every velocity
{initial}

outputs:                # additional columns of the result
  force: -k*{first}

simulation: {{t_end: 10, samples: 501}}

# view:                 # the drawing, for `lagcli animate` and `lagcli report`
#   points: {{O: [0, 0], A: [{first}, 0]}}
#   springs: [O-A]
"""


def new_model(name: str, coordinates: Sequence[str] = ()) -> str:
    """Return the text of a new model file.

    Parameters
    ----------
    name : str
        The name of the model.
    coordinates : sequence of str, optional
        Its coordinates; by default it is a pendulum in x and y.

    Returns
    -------
    str
    """
    if not coordinates:
        return _HEADER + _PENDULUM.format(name=name)
    first, last = coordinates[0], coordinates[-1]
    values = [f"  {q}: 1" for q in coordinates] + [f"  {q}': 0" for q in coordinates]
    return _HEADER + _GENERAL.format(
        name=name,
        listed=", ".join(coordinates),
        first=first,
        kinetic="m/2*(" + " + ".join(f"{q}'^2" for q in coordinates) + ")",
        potential="k/2*(" + " + ".join(f"{q}^2" for q in coordinates) + ")",
        constraint=f"{first} = {last}" if first != last else f"{first} = 0",
        initial="\n".join(values),
    )
