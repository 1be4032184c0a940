"""lagcli compared with other programs on the same motions: times at equal error, in one table.

``python -m comparison`` (from ``tests/benchmark``, or `make bench`) measures and writes
``docs/benchmarks.md``.
"""
