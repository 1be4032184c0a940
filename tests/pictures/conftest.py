"""A real browser without a network, and results of the shipped models."""

import shutil
import subprocess
import time
from pathlib import Path

import pytest
from patience import PATIENCE

import lagcli
from lagcli.pictures.report import report

MODELS = Path(__file__).parents[2] / "models"
ARGUMENTS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]
VIEWPORT = {"width": 800, "height": 640}
#: The frames of a page come when a test requests them, at the times that it says.
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


class Tab:
    """A page of a browser that shows files; what they say on the console and ask of a network."""

    def __init__(self, browser, stepped, **options):
        self.context = browser.new_context(viewport=VIEWPORT, **options)
        self.context.set_offline(True)
        self.said = []
        self.page = page = self.context.new_page()
        page.set_default_timeout(1000 * PATIENCE)
        page.on("console", lambda message: self.said.append(message.text))
        page.on("pageerror", lambda error: self.said.append(str(error)))
        page.on("request", lambda request: self._note(request.url))
        if stepped:
            page.add_init_script(STEPPED)

    def _note(self, url):
        if not url.startswith(("file:", "data:", "blob:", "about:")):
            self.said.append(url)

    def show(self, path, **media):
        self.page.set_viewport_size(VIEWPORT)
        self.page.emulate_media(**media)
        self.page.goto(Path(path).resolve().as_uri())


@pytest.fixture(scope="session")
def tabs(browser):
    """Return a tab that the tests share, since one costs more than a page in it."""
    opened = {}

    def of(stepped):
        if stepped not in opened:
            opened[stepped] = Tab(browser, stepped)
        return opened[stepped]

    yield of
    for tab in opened.values():
        tab.context.close()


@pytest.fixture
def visit(browser, tabs):
    """Open a page from a file, without a network; any word on the console fails the test.

    `color_scheme` and `reduced_motion` are what the reader prefers, `stepped` gives the frames to
    the test, which asks for them with `step`; other options are those of a tab of its own, which a
    second page of a test has too.
    """
    used, own = [], []

    def open_page(
        path, *, color_scheme="light", reduced_motion="no-preference", stepped=False, **options
    ):
        tab = tabs(stepped)
        if options or tab in used:
            tab = Tab(browser, stepped, **options)
            own.append(tab)
        used.append(tab)
        tab.show(path, media="null", color_scheme=color_scheme, reduced_motion=reduced_motion)
        return tab.page

    yield open_page
    for tab in used:
        if tab in own:
            tab.context.close()
        else:
            tab.page.goto("about:blank")
    said = [word for tab in used for word in tab.said]
    for tab in used:
        tab.said.clear()
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


@pytest.fixture(scope="session")
def reports(result, tmp_path_factory):
    """Return the report of a shipped model, made once."""
    folder = tmp_path_factory.mktemp("reports")

    def of(name):
        path = folder / f"{name}.html"
        if not path.exists():
            report(result(name), path)
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
