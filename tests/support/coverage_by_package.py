"""Print the coverage of each package from coverage.py's JSON report."""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path, PurePath

KEYS = ("num_statements", "covered_lines", "num_branches", "covered_branches")


def main(report: str) -> None:
    """Print statements and branches, and the share of both that tests reach."""
    packages: dict[str, Counter[str]] = {}
    for name, file in json.loads(Path(report).read_text("utf-8"))["files"].items():
        folder = PurePath(name).parent
        counts = {key: file["summary"][key] for key in KEYS}
        for package in {folder.as_posix().replace("/", "."), "total"}:
            packages.setdefault(package, Counter()).update(counts)
    print(f"{'package':<34}{'statements':>11}{'branches':>10}{'reached':>9}")
    for package, n in sorted(packages.items(), key=lambda item: (item[0] == "total", item[0])):
        there = n["num_statements"] + n["num_branches"]
        if not there:
            continue
        reached = (n["covered_lines"] + n["covered_branches"]) / there
        print(f"{package:<34}{n['num_statements']:>11}{n['num_branches']:>10}{reached:>9.1%}")
    print("Not measured: the core (C), and lines reached only in child processes.")


if __name__ == "__main__":
    main(sys.argv[1])
