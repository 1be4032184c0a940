"""Memory and size of the event log: bytes per entry, of falling discs that strike each other.

Each pair of discs is a contact, so that the rows grow with the square of their number; an entry
stores what changes and should grow with the number of coordinates only.
"""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import numpy as np

import lagcli

MODEL = """
name: discs
coordinates: [x[1..N], y[1..N]]
parameters: {N: 5, m: 1 kg, R: 0.05 m, g: 9.81 m/s^2, e: 0.8}
T: sum(m/2*(x[p]'^2 + y[p]'^2), p = 1..N)
V: sum(m*g*y[p], p = 1..N)
constraints:
  floor[p = 1..N]: {expr: y[p] >= R, restitution: e}
  hit[i = 2..N, j = 1..i-1]: {expr: "(x[i] - x[j])^2 + (y[i] - y[j])^2 >= 4*R^2", restitution: e}
initial:
  x[p = 1..N]: 0.12*p
  y[p = 1..N]: 0.1 + 0.02*p
  x[p = 1..N]': 0.5*sin(3.3*p)
  y[1..N]': 0
simulation: {t_end: 1, samples: 11}
"""


def main() -> None:
    """Print a line for each number of discs."""
    print("discs  rows  entries  bytes of the log per entry: memory  file  whole arrays")
    for count in (5, 10, 15):
        run = lagcli.simulate(lagcli.load_text(MODEL, set={"N": str(count)}))
        log = run.events
        assert log is not None
        sparse = (*log.mode_changes[1:], *log.nonzero_impulses[1:])
        arrays = (log.time, log.q, log.before, log.after, log.loss, log.supplied, log.work)
        memory = sum(np.asarray(x).nbytes for x in (*arrays, *sparse))
        with tempfile.TemporaryDirectory() as folder:
            path, without = Path(folder, "run.h5"), Path(folder, "without.h5")
            lagcli.write(run, path)
            lagcli.write(dataclasses.replace(run, events=None), without)
            size = path.stat().st_size - without.stat().st_size
        whole = memory + log.modes.nbytes + log.impulse.nbytes
        each = (f"{x / max(len(log), 1):8.0f}" for x in (memory, size, whole))
        print(f"{count:5}  {len(log.rows):4}  {len(log):7} ", *each)


if __name__ == "__main__":
    main()
