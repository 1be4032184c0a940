"""Install a wheel in an empty environment and use it there, outside the checkout."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import urllib.parse
import urllib.request
from pathlib import Path

ROOT = Path(__file__).parents[2]


def main(wheel: str) -> None:
    """Stop at the first command that fails."""
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
        environment["PATH"] = f"{place / 'venv' / 'bin'}{os.pathsep}{os.environ['PATH']}"

        def run(*command: str) -> str:
            print("$", *command, flush=True)
            return subprocess.run(
                command, cwd=place, env=environment, check=True, stdout=subprocess.PIPE, text=True
            ).stdout

        run(sys.executable, "-m", "venv", "venv")
        run("python", "-m", "pip", "install", "-q", f"{Path(wheel).resolve()}[pictures]")
        run("lagcli", "new", "slider_crank.yaml", "--from", "slider_crank")
        where = run("python", "-c", "import lagcli; print(lagcli.__file__)").strip()
        assert where.startswith(str(place)), where
        version = Path(wheel).name.split("-")[1]
        assert run("lagcli", "--version") == f"lagcli {version}\n"
        assert "four_bar" in run("lagcli", "models")
        assert "λ" in run("lagcli", "derive", "slider_crank")
        run("lagcli", "simulate", "slider_crank.yaml", "-o", "run.h5")
        run("lagcli", "info", "run.h5")
        for suffix in ("png", "html"):
            command = "plot" if suffix == "png" else "report"
            run("lagcli", command, "run.h5", "-o", f"run.{suffix}")
        run("lagcli", "animate", "run.h5", "-o", "animation.html")
        assert (place / "run.html").stat().st_size > 100_000  # scripts and styles are inside
        assert (place / where).with_name("py.typed").exists()
        serve(place, environment)
    print(f"{Path(wheel).name} works in an empty environment")


def fetch(url: str) -> str:
    """Return what a server answers; raise if that is an error."""
    with urllib.request.urlopen(url, timeout=20) as answer:
        text: str = answer.read().decode()
    return text


def serve(place: Path, environment: dict[str, str]) -> None:
    """Fetch the page of `lagcli play` and all files that it names."""
    command = ("lagcli", "play", "slider_crank.yaml", "--no-browser")
    print("$", *command, flush=True)
    server = subprocess.Popen(
        command, cwd=place, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True,
    )  # fmt: skip
    try:
        assert server.stdout
        url = next(word for line in server.stdout for word in line.split() if "://" in word)
        page = fetch(url)
        assets = [a for a in re.findall(r'(?:href|src)="([^":]+)"', page) if "." in a]
        assert {"play.css", "play.js"} <= set(assets), page[:2000]
        for asset in assets:
            assert fetch(urllib.parse.urljoin(url, asset)), asset
    finally:
        server.terminate()
        server.wait(timeout=20)


if __name__ == "__main__":
    main(sys.argv[1])
