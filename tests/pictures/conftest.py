"""A real browser without a network, and results of the shipped models."""

import shutil
import subprocess
import time
from pathlib import Path

import pytest
from patience import PATIENCE

import lagcli

MODELS = Path(__file__).parents[2] / "models"
ARGUMENTS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]
VIEWPORT = {"width": 800, "height": 640}
#: The frames of a page come when a test asks for them, at the times that it says.
STEPPED = """
(() => {
  const waiting = [];
  let now = 0;
  window.shownFrame = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (call) => waiting.push(call);
  const frame = () => { for (const call of waiting.splice(0)) call(1000 * now); };
  window.step = (seconds, length) => {
    frame();  // what has begun to play since the last one counts from here
    for (let left = Math.round(seconds / length); left > 0; left--) { now += length; frame(); }
  };
})();
"""


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


@pytest.fixture(scope="session")
def window(browser):
    """Tabs of one window, without a network."""
    context = browser.new_context(viewport=VIEWPORT)
    context.set_offline(True)
    yield context
    context.close()


@pytest.fixture
def visit(browser, window):
    """Open a page from a file, without a network; any word on the console fails the test.

    `color_scheme` and `reduced_motion` are what the reader prefers, `stepped` gives the frames to
    the test, which asks for them with `step`; other options are those of a context of its own.
    """
    opened, said = [], []

    def open_page(path, *, color_scheme=None, reduced_motion=None, stepped=False, **options):
        context = window
        if options:
            context = browser.new_context(viewport=VIEWPORT, **options)
            context.set_offline(True)
            opened.append(context)
        page = context.new_page()
        opened.append(page)
        page.set_default_timeout(1000 * PATIENCE)
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: said.append(request.url) if asks(request) else None)
        if color_scheme or reduced_motion:
            page.emulate_media(color_scheme=color_scheme, reduced_motion=reduced_motion)
        if stepped:
            page.add_init_script(STEPPED)
        page.goto(Path(path).resolve().as_uri())
        return page

    def asks(request):
        return not request.url.startswith(("file:", "data:", "blob:"))

    yield open_page
    for one in reversed(opened):
        one.close()
    assert not said


@pytest.fixture
def step():
    """Give a page that was opened `stepped` the frames of so many seconds."""

    def frames(page, seconds, length=1 / 64):
        page.evaluate("([seconds, length]) => step(seconds, length)", [seconds, length])

    return frames


@pytest.fixture
def until():
    """Wait until an expression is true in a page, which may not evaluate texts itself."""

    def wait(page, expression):
        end = time.monotonic() + PATIENCE
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
            trajectory = lagcli.simulate(lagcli.load(name), **settings)
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
