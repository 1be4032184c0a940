"""One module for each program of the table; each has METHODS and imports its program lazily."""

from comparison.methods import Method
from comparison.peers import by_hand, by_tape, casadi, exudyn, heyoka, ours, pydy, sundae

METHODS: tuple[Method, ...] = (
    *ours.METHODS,
    *by_hand.METHODS,
    *casadi.METHODS,
    *sundae.METHODS,
    *heyoka.METHODS,
    *exudyn.METHODS,
    *pydy.METHODS,
)
#: Those that take models without a geometry.
OF_PORTED: tuple[Method, ...] = (ours.DEFAULT, *by_tape.METHODS)
