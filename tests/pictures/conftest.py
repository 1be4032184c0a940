"""A real browser without a network, and results of the shipped models."""

import shutil
import subprocess
import time
from pathlib import Path

import pytest

import lagcli

MODELS = Path(__file__).parents[2] / "models"
ARGUMENTS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]


@pytest.fixture(scope="session")
def browser():
    """Chromium, as Debian has it."""
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("chromium is not installed")
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=chromium, args=ARGUMENTS)
        yield started
        started.close()


@pytest.fixture
def visit(browser):
    """Open a page from a file, without a network; any word on the console fails the test."""
    contexts, said = [], []

    def open_page(path, **options):
        context = browser.new_context(viewport={"width": 800, "height": 640}, **options)
        contexts.append(context)
        context.set_offline(True)
        page = context.new_page()
        page.set_default_timeout(10_000)
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: said.append(request.url) if asks(request) else None)
        page.goto(Path(path).resolve().as_uri())
        return page

    def asks(request):
        return not request.url.startswith(("file:", "data:", "blob:"))

    yield open_page
    for context in contexts:
        context.close()
    assert not said


@pytest.fixture
def until():
    """Wait until an expression is true in a page, which may not evaluate texts itself."""

    def wait(page, expression, seconds=10):
        end = time.monotonic() + seconds
        while not page.evaluate(expression):
            assert time.monotonic() < end, expression
            page.wait_for_timeout(20)

    return wait


@pytest.fixture(scope="session")
def result(tmp_path_factory):
    """Return the result file of a shipped model, simulated once."""
    folder = tmp_path_factory.mktemp("results")

    def of(name, **settings):
        path = folder / f"{name}{''.join(f'-{k}{v}' for k, v in settings.items())}.h5"
        if not path.exists():
            trajectory = lagcli.simulate(lagcli.load(MODELS / f"{name}.yaml"), **settings)
            lagcli.write(trajectory, path)
        return path

    return of


@pytest.fixture
def probe():
    """Return what ffprobe says of a film."""
    if shutil.which("ffprobe") is None:
        pytest.skip("ffprobe (ffmpeg) is not installed")

    def of(path):
        command = [
            *("ffprobe", "-v", "error", "-select_streams", "v", "-count_frames"),
            *("-show_entries", "stream=width,height,codec_name,pix_fmt,nb_read_frames,duration"),
            *("-of", "default=noprint_wrappers=1", str(path)),
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
        return dict(line.split("=", 1) for line in done.stdout.split())

    return of
