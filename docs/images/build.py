"""Make the pictures that the pages show beside their commands. Run by `make gallery`.

The page of `lagcli play` needs Chromium and Playwright; its picture is left as it is without them.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from PIL import Image

from lagcli.cli.app import run as command

HERE = Path(__file__).parent
MODELS = HERE.parents[1] / "models"
CRANK = MODELS / "slider_crank.yaml"
FIT = """
fit:
  data: {file: run.csv}
  observe:
    phi: {column: enc, sigma: 5e-4}
    lambda.guide: {column: load_cell, sigma: 0.05}
  parameters: {m: {min: 0.1 kg}, c: {min: 0}, phi': {}}
"""
COLORS = 64  # of a plot
WINDOW = {"width": 1280, "height": 720}


def make(*arguments: str | os.PathLike[str]) -> None:
    """Run a command of lagcli."""
    status = command([*map(os.fspath, arguments)])
    if status:
        raise SystemExit(f"lagcli {arguments[0]} ended with status {status}")


def plot(source: Path, name: str, *names: str) -> None:
    """Plot a file."""
    picture = HERE / f"{name}.png"
    make("plot", source, *names, "-o", picture, "--dpi", "100", "--force")
    small = Image.open(picture).convert("RGB").quantize(COLORS, dither=Image.Dither.NONE)
    small.save(picture, optimize=True)


def runs(folder: Path) -> None:
    """Plot a run, as pictures.md does."""
    make("simulate", CRANK, "-o", folder / "run.h5", "-q")
    plot(folder / "run.h5", "plot")


def modes(folder: Path) -> None:
    """Plot the modes of a chain, as linear-models.md does."""
    chain = MODELS / "chain.yaml"
    make("modes", chain, "--set", "N=5", "--equilibrium", "-o", folder / "modes.h5", "-q")
    plot(folder / "modes.h5", "modes")


def fit(folder: Path) -> None:
    """Plot a fit, as fit.md does, with noise from AWK."""
    changed = ("--set", "m=1.1", "--set", "c=0.2", "--t-end", "2", "--samples", "101")
    make("simulate", CRANK, *changed, "-o", folder / "exact.csv", "-q")
    noise = '1e-3 * (rand() + rand() + rand() - 1.5) "," $8 + 0.1*(rand() + rand() + rand() - 1.5)'
    program = f'BEGIN {{srand(1); print "t,enc,load_cell"}} NR > 1 {{print $1 "," $2 + {noise}}}'
    with open(folder / "run.csv", "wb") as file:
        subprocess.run(["awk", "-F,", program, folder / "exact.csv"], stdout=file, check=True)
    model = folder / "fitting.yaml"
    model.write_text(CRANK.read_text(encoding="utf-8") + FIT, encoding="utf-8")
    make("fit", model, "-o", folder / "fit.h5", "-q")
    plot(folder / "fit.h5", "fit")


def play(folder: Path) -> None:
    """Photograph the page of play.md."""
    chromium = shutil.which("chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        chromium = None
    if chromium is None:
        print("no picture of the page of lagcli play: Chromium or Playwright is not installed")
        return
    arguments = [sys.executable, "-m", "lagcli", "play", str(CRANK), "--no-browser"]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as server:
        try:
            assert server.stdout is not None
            address = None
            while address is None:
                address = re.search(rb"http://\S+", server.stdout.readline())
            with sync_playwright() as driver:
                browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
                page = browser.new_page(viewport=WINDOW)
                page.goto(address[0].decode())
                page.wait_for_selector("canvas")
                page.wait_for_timeout(2500)
                page.screenshot(path=folder / "play.png")
                browser.close()
        finally:
            server.terminate()
    Image.open(folder / "play.png").convert("RGB").quantize(128).save(
        HERE / "play.png", optimize=True
    )


def main() -> None:
    """Make all of them."""
    steps: tuple[Callable[[Path], None], ...] = (runs, modes, fit, play)
    with tempfile.TemporaryDirectory() as folder:
        for step in steps:
            print(step.__name__)
            step(Path(folder))


if __name__ == "__main__":
    main()
