"""Install a wheel in an empty environment and use it there, outside the checkout.

Of a folder, the wheel that fits this machine is taken. With --tests, tests run there too, with no
program on the path but those of the environment: nothing may need a compiler.

    python tests/support/try_wheel.py [--tests] dist
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import urllib.parse
import urllib.request
from pathlib import Path

ROOT = Path(__file__).parents[2]

#: Tests that need neither the checkout's modules nor the core's sources.
TESTS = [
    "tests/physics/test_closed_forms.py",
    "tests/physics/test_contact_models.py",
    "tests/physics/test_convergence.py",
    "tests/physics/test_event_times.py",
    "tests/physics/test_identities.py",
    "tests/physics/test_stiff.py",
    "tests/physics/test_taylor.py",
    "tests/property/test_property_tapes.py",
    "tests/unit/results",
]
#: Where programs of an environment are.
PROGRAMS = "Scripts" if sys.platform == "win32" else "bin"


def fitting(folder: Path) -> Path:
    """Return the wheel of a folder that an installation on this machine would take."""
    from packaging.tags import sys_tags
    from packaging.utils import parse_wheel_filename

    wheels = {path: parse_wheel_filename(path.name)[3] for path in folder.glob("*.whl")}
    for tag in sys_tags():
        for path, tags in wheels.items():
            if tag in tags:
                return path
    sys.exit(f"no wheel in {folder} fits this machine: {[path.name for path in wheels]}")


class Environment:
    """An environment that contains a wheel, with the extra `pictures`.

    Parameters
    ----------
    place : Path
        An empty folder.
    wheel : Path
    """

    def __init__(self, place: Path, wheel: Path):
        self.place, self.programs = place, place / "venv" / PROGRAMS
        self.variables = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
        self.variables["PATH"] = str(self.programs)
        subprocess.run([sys.executable, "-m", "venv", place / "venv"], check=True)
        self.install(f"{wheel.resolve()}[pictures]")

    def install(self, *what: str) -> None:
        """Install packages; none of them may be compiled."""
        self.run("python", "-m", "pip", "install", "-q", "--only-binary=:all:", *what)

    def command(self, name: str, *arguments: str) -> list[str]:
        """Return a command with the path of its program."""
        print("$", name, *arguments, flush=True)
        return [shutil.which(name, path=str(self.programs)) or name, *arguments]

    def run(self, name: str, *arguments: str) -> str:
        """Run a command; return what it prints."""
        return subprocess.run(
            self.command(name, *arguments),
            cwd=self.place,
            env=self.variables,
            check=True,
            stdout=subprocess.PIPE,
            encoding="utf-8",
        ).stdout


def main(path: Path, tests: bool) -> None:
    """Stop at the first command that fails."""
    wheel = fitting(path) if path.is_dir() else path
    # servers and files that are still open on Windows keep their folder
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        place = Path(name).resolve()
        environment = Environment(place, wheel)
        run = environment.run
        run("lagcli", "new", "slider_crank.yaml", "--from", "slider_crank")
        where = run("python", "-c", "import lagcli; print(lagcli.__file__)").strip()
        assert Path(where).resolve().is_relative_to(place), where
        version = wheel.name.split("-")[1]
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
        assert Path(where).with_name("py.typed").exists()
        write_page(environment)
        serve(environment)
        if tests:
            run_tests(environment)
    print(f"{wheel.name} works in an empty environment")


def write_page(environment: Environment) -> None:
    """Write a page that simulates, with the core inside."""
    environment.run("lagcli", "export", "slider_crank.yaml", "-o", "page.html")
    assert (environment.place / "page.html").stat().st_size > 300_000


def run_tests(environment: Environment) -> None:
    """Run tests of the checkout, copied without its package."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    environment.install(*project["optional-dependencies"]["test"])
    for name in ("tests", "models", "docs"):
        shutil.copytree(ROOT / name, environment.place / name)
    shutil.copy(ROOT / "pyproject.toml", environment.place)
    subprocess.run(
        environment.command("python", "-m", "pytest", "-q", "-p", "no:cacheprovider", *TESTS),
        cwd=environment.place,
        env=environment.variables,
        check=True,
    )


def fetch(url: str) -> str:
    """Return what a server answers; raise if that is an error."""
    with urllib.request.urlopen(url, timeout=20) as answer:
        text: str = answer.read().decode()
    return text


def serve(environment: Environment) -> None:
    """Fetch the page of `lagcli play` and all files that it names."""
    server = subprocess.Popen(
        environment.command("lagcli", "play", "slider_crank.yaml", "--no-browser"),
        cwd=environment.place,
        env=environment.variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
    )
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
    options = sys.argv[1:]
    main(Path(options[-1]), "--tests" in options)
