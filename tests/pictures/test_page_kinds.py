"""What every kind of page keeps: contrast, keyboard, stillness, phones, paper, no scripts."""

from __future__ import annotations

import zipfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from page_checks import CONTRAST, FIRST, FOCUSED, GRAPHICS, MOVING, PAPER, REACHABLE, TEXTS
from programs import program
from serving import serving

import lagcli
from lagcli.cli.app import run
from lagcli.live.course import course
from lagcli.pictures.animation.animate import animate
from lagcli.pictures.report import notebook, report

ROOT = Path(__file__).parents[2]
MODELS = ROOT / "models"
CRANK = str(MODELS / "slider_crank.yaml")
PENDULUM = str(MODELS / "pendulum_cartesian.yaml")
#: Width of A4 between its margins, CSS pixels.
PAPER_WIDTH = 680
#: A free body: no constraints, no view.
FALLING = """\
name: falling
coordinates: {h: m, w: m}
parameters: {g: 9.81 m/s^2, m: 1 kg}
T: m*(h'^2 + w'^2)/2
V: m*g*h
initial: {h: 1, h': 1, w: 0, w': 2}
simulation: {t_end: 1, samples: 51}
"""


class Kinds:
    """Pages of all kinds, made when they are asked for."""

    def __init__(self, folder, result, reports):
        self.folder, self.result, self.reports = folder, result, reports

    def analysis(self, command, *arguments):
        """Return the page of an analysis."""
        file, page = self.folder / f"{command}.h5", self.folder / f"{command}.html"
        assert run([command, *arguments, "-o", str(file), "--quiet", "--force"]) == 0
        report(file, page, force=True)
        return page

    def run(self):
        return self.reports("bouncing_ball")

    def sensitivities(self):
        page = self.folder / "sensitivities.html"
        made = lagcli.simulate(lagcli.load(CRANK), t_end=0.3, samples=31, sensitivity=["l", "m"])
        report(made, page, modes="start")
        return page

    def sweep(self):
        vary = ["--vary", "l=0.25,0.3", "--vary", "m=1,2", "--keep", "trajectories"]
        few = ["--t-end", "0.1", "--samples", "5", "--jobs", "1"]
        return self.analysis("sweep", CRANK, *vary, *few, "--measure", "peak=max(lambda.guide)")

    def fit(self):
        made = lagcli.simulate(lagcli.load(PENDULUM), t_end=0.5, samples=26)
        rows = [f"{t!r},{x!r}\n" for t, x, _ in np.c_[made.time, made.q].tolist()]
        (self.folder / "run.csv").write_text("t,x\n" + "".join(rows))
        model = self.folder / "fitted.yaml"
        wanted = (
            "fit:\n  data: {file: run.csv}\n  observe: {x: {sigma: 1e-3}}\n  parameters: {g: {}}\n"
        )
        model.write_text(Path(PENDULUM).read_text(encoding="utf-8") + wanted)
        return self.analysis("fit", str(model))

    def branch(self):
        hoop = str(MODELS / "bead_on_rotating_hoop.yaml")
        return self.analysis("equilibrium", hoop, "--along", "Omega=2:4")

    def modes(self):
        chain = str(MODELS / "chain.yaml")
        return self.analysis("modes", chain, "--set", "N=2", "--equilibrium")

    def linear(self):
        return self.analysis("linearize", CRANK, "--input", "tau")

    def comparison(self):
        return self.analysis("compare", PENDULUM, "--t-end", "0.1")

    def animation(self):
        page = self.folder / "animation.html"
        animate(self.result("slider_crank"), page)
        return page

    def spatial_animation(self):
        page = self.folder / "spatial.html"
        animate(self.result("heavy_top"), page)
        return page

    def curves(self):
        """Return the animation of a model without a view."""
        page = self.folder / "curves.html"
        animate(lagcli.simulate(lagcli.load_text(FALLING)), page)
        return page

    def live(self):
        return self.written("live", lagcli.live_page(lagcli.load("bouncing_ball")))

    def course(self):
        models = [lagcli.load(name) for name in ("slider_crank", "woodpecker")]
        return self.written("index", course(models)["index.html"])

    def gallery(self):
        folder = ROOT / "docs" / "gallery"
        models = {path.stem: lagcli.load(path) for path in sorted(MODELS.glob("*.yaml"))}
        index = program(folder / "build.py").index(models)
        return self.written("gallery", index.replace(' src="', f' src="{folder.as_uri()}/'))

    def notebook(self):
        """Return a notebook as Jupyter shows it: the outputs on a page."""
        model = lagcli.load(CRANK)
        results = (
            notebook.model_html(model),
            notebook.trajectory_html(lagcli.read(self.result("slider_crank"))),
            notebook.analysis_html(lagcli.equilibrium(lagcli.load(PENDULUM))),
        )
        head = "<!doctype html><meta name='viewport' content='width=device-width'><title>x</title>"
        style = "<style>body { background: #fff; font: 14px sans-serif }</style>"
        return self.written("notebook", head + style + "\n".join(results))

    def fmu(self):
        """Return the documentation within an FMU."""
        assert run(["export", CRANK, "-o", str(self.folder / "x.fmu"), "-q", "--force"]) == 0
        with zipfile.ZipFile(self.folder / "x.fmu") as files:
            return self.written("fmu", files.read("documentation/index.html").decode())

    def written(self, name, text):
        path = self.folder / f"{name}.html"
        path.write_text(text, encoding="utf-8")
        return path


#: Kinds of pages, and whether scripts fill them; what does not need any is complete without.
KINDS = {
    "run": True,
    "sensitivities": True,
    "sweep": False,
    "fit": False,
    "branch": False,
    "modes": False,
    "linear": False,
    "comparison": False,
    "animation": True,
    "spatial_animation": True,
    "curves": True,
    "play": True,
    "live": True,
    "course": False,
    "gallery": False,
    "notebook": False,
    "fmu": False,
}
#: Kinds of text alone.
TEXT_ALONE = ("course", "fmu", "linear")


PHONE = {"width": 390, "height": 844}
#: On paper, nothing follows the sizes of what contains it.
PRINTING = """
  const Observer = window.ResizeObserver;
  window.ResizeObserver = class extends Observer {
    constructor(call) { super((...changes) => window.printing || call(...changes)); }
  };
"""


@pytest.fixture(scope="module")
def kinds(tmp_path_factory, result, reports):
    return Kinds(tmp_path_factory.mktemp("kinds"), result, reports)


@pytest.fixture
def address(kinds):
    """Return the address of a page of a kind."""
    servers = []

    def of(kind):
        if kind == "play":
            servers.append(serving(CRANK))
            return next(servers[-1])
        return getattr(kinds, kind)().resolve().as_uri()

    yield of
    for server in servers:
        next(server, None)


@pytest.fixture(scope="module")
def tab(browser):
    """A tab for all kinds, whose reader prefers that nothing moves."""
    context = browser.new_context(viewport=PHONE, reduced_motion="reduce")
    context.add_init_script(PRINTING)
    yield context.new_page()
    context.close()


@pytest.fixture
def sheet(tab):
    """The tab, light and narrow: there all is in one column."""
    tab.set_viewport_size(PHONE)
    tab.emulate_media(media="null", color_scheme="light")
    return tab


@pytest.fixture(scope="module")
def plain(browser):
    """A tab without JavaScript."""
    context = browser.new_context(viewport=PHONE, java_script_enabled=False)
    yield context.new_page()
    context.close()


#: Whether a page shows what it has at first: a live one has drawn its first run.
SHOWN = "typeof page !== 'object' || (page.number > 0 && page.drawn === page.number)"


def settle(page):
    """Wait until charts have taken another width, and pictures other colours."""
    page.evaluate(
        """new Promise((done) => requestAnimationFrame(() =>
          requestAnimationFrame(() => setTimeout(done, 30))))"""
    )


def unfolded(page):
    closed = "document.querySelectorAll('details:not([open])')"
    page.evaluate(f"{closed}.forEach((d) => {{ d.open = true; d.dataset.was = 'closed'; }})")
    settle(page)


def folded(page):
    closed = "document.querySelectorAll('[data-was=closed]')"
    page.evaluate(f"{closed}.forEach((d) => {{ d.open = false; }})")
    settle(page)


def contrast(page):
    """Return texts and graphics that are too faint, in light and dark."""
    found = []
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        settle(page)
        found += [(scheme, x) for x in (*page.evaluate(CONTRAST), *page.evaluate(GRAPHICS))]
    page.emulate_media(color_scheme="light")
    return found


def focused(page):
    """Return what the Tab key reaches in each frame, from the beginning of a page, and its end."""
    for frame in reversed(page.frames):  # the page itself last: it keeps the focus
        frame.evaluate(FIRST)
    for _ in range(sum(frame.evaluate(REACHABLE) for frame in page.frames)):
        page.keyboard.press("Tab")
    for _ in range(40):  # what scrolls is reached, too
        page.keyboard.press("Tab")
        found = [frame.evaluate(FOCUSED) for frame in page.frames]
        if found[0]["ended"]:
            break
    return [x["reached"] for x in found], found[0]["ended"]


def keyboard(page):
    """Return what the keyboard does not reach in order, what is unnamed or has no visible focus."""
    frames, ended = focused(page)
    wrong = [] if ended else ["trap"]
    for frame, found in zip(page.frames, frames, strict=True):
        for x in found:
            said = x["tag"], x["name"]
            wrong += [("unnamed", *said, x["place"])] * (not x["name"])
            wrong += [("no size", *said)] * (not x["width"])
            # within a frame, an element of it has the focus
            wrong += [("focus not seen", *said)] * (not x["outlined"] and x["tag"] != "IFRAME")
        for before, at in pairwise(found):
            above = at["top"] < before["top"] - 60
            wrong += [("order", at["name"])] * (above or at["place"] <= before["place"])
        reachable = frame.evaluate(REACHABLE)
        if len(found) < reachable:
            wrong.append(("not reached", reachable - len(found)))
    return wrong


def played(page):
    """Return what Space and arrows do wrong, where nothing has the focus."""
    player = "document.querySelector('.player').player"
    if not page.evaluate("Boolean(document.querySelector('.player')?.player)"):
        return []
    page.evaluate("document.activeElement.blur(); scrollTo(0, 0)")
    states = []
    for key in ("Space", "Space", "ArrowRight", "ArrowRight", "ArrowLeft"):
        page.keyboard.press(key)
        states.append(page.evaluate(f"[{player}.playing, {player}.time]"))
    (first, _), (second, a), (_, b), (_, c), (_, d) = states
    right = first and not second and a < b < c and d < c
    return [] if right else [("keys", states)]


def narrow(page):
    """Return what is wider than a phone, overlaps or is cut off."""
    found = []
    for width in (320, 390):
        page.set_viewport_size({"width": width, "height": 844})
        page.evaluate("scrollTo(0, 0)")
        settle(page)
        scrolled = page.evaluate("document.documentElement.scrollWidth")
        found += [("wide", width, scrolled)] * (scrolled > width)
    return found + page.evaluate(TEXTS)


def paper(page):
    """Return what should not be on paper."""
    page.emulate_media(media="null", color_scheme="dark")
    settle(page)
    page.evaluate("window.printing = true; dispatchEvent(new Event('beforeprint'))")
    page.set_viewport_size({"width": PAPER_WIDTH, "height": 960})
    page.emulate_media(media="print", color_scheme="dark")
    settle(page)
    found = [*page.evaluate(PAPER), *page.evaluate(CONTRAST)]
    page.evaluate("window.printing = false; dispatchEvent(new Event('afterprint'))")
    page.emulate_media(media="null", color_scheme="light")
    return found


def without_script(page, scripted, text_alone):
    """Return what is missing where scripts do not run."""
    text = page.locator("body").inner_text()
    shown = page.locator("img:visible, svg:visible").evaluate_all(
        "all => all.some((e) => e.clientWidth > 120 && (e.naturalWidth ?? 1) > 0)"
    )
    found = [] if shown or text_alone else ["no picture"]
    if scripted and "JavaScript" not in text:
        found.append("no sentence")
    if page.evaluate("document.documentElement.scrollWidth > innerWidth"):
        found.append("wide")
    return found


#: Kinds that have the parts of others.
ALIKE = ("sensitivities", "branch", "modes", "linear", "comparison", "spatial_animation")


@pytest.mark.parametrize(
    "kind", [pytest.param(x, marks=[pytest.mark.slow] * (x in ALIKE)) for x in KINDS]
)
def test_what_every_page_keeps(kind, address, sheet, plain, until):
    place = address(kind)
    page, wrong = sheet, {}
    page.goto(place)
    until(page, SHOWN)
    settle(page)
    wrong["moves"] = [x for frame in page.frames for x in frame.evaluate(MOVING)]
    wrong["keys"] = played(page)
    wrong["keyboard"] = keyboard(page)
    unfolded(page)
    wrong["phone"] = narrow(page)
    wrong["contrast"] = contrast(page)
    folded(page)
    wrong["paper"] = paper(page)
    page.goto("about:blank")
    plain.goto(place)
    wrong["without scripts"] = without_script(plain, KINDS[kind], kind in TEXT_ALONE)
    plain.goto("about:blank")
    said = [f"{check}: {each}" for check, found in wrong.items() for each in found]
    assert not said, "\n".join(said)


HEAD = "<!doctype html><meta name='viewport' content='width=device-width'><title>x</title>"
STILL = f"""{HEAD}<style>:root {{ color-scheme: light dark }} p {{ max-width: 20rem }}
@media print {{ :root {{ color-scheme: light }} button {{ display: none }} }}</style>
<p>JavaScript</p><button>a</button><button>b</button><svg width=200 height=9></svg>"""
#: What a check finds in a page with one defect.
BROKEN = {
    "faint text": (contrast, "<p style='color: #999'>x</p>", "2.85 P x"),
    "dark text": (contrast, "<p style='color: #222'>x</p>", "1.18 P x"),
    "faint slider": (
        contrast,
        "<input type=range aria-label=x style='accent-color: #ddd'>",
        "slider",
    ),
    "faint field": (contrast, "<input aria-label=x style='border: 1px solid #ddd'>", "edge"),
    "faint shape": (contrast, "<svg><path d='M0 0h9v9z' fill='#ccc'/></svg>", "svg"),
    "faint picture": (
        contrast,
        "<img src='data:image/svg+xml;base64,"
        "PHN2ZyB4bWxucz0iaHR0cDovL3d3dy53My5vcmcvMjAwMC9zdmciPjxwYXRoIGQ9Ik0wIDBoOSIgc3Ryb2tlPSIjZGRkIi8+PC9zdmc+'>",
        "line of a picture",
    ),
    "no name": (keyboard, "<figure tabindex=0><img alt=x></figure>", "unnamed"),
    "no ring": (keyboard, "<button style='outline: none'>x</button>", "focus not seen"),
    "faint ring": (
        keyboard,
        "<button style='outline: 2px solid #ddd'>x</button>",
        "focus not seen",
    ),
    "other order": (
        keyboard,
        "<div style='display: flex; flex-direction: column-reverse; gap: 9rem'>"
        "<button>x</button><button>y</button></div>",
        "order",
    ),
    "trap": (keyboard, "<button onkeydown='return false'>x</button><button>y</button>", "trap"),
    "dead keys": (
        played,
        "<div class=player></div><script>"
        "document.querySelector('.player').player = { playing: false, time: 0 }</script>",
        "keys",
    ),
    "animation": (
        lambda page: page.evaluate(MOVING),
        "<style>@keyframes x { to { left: 9px } } b { animation: x 9s infinite }</style><b>x</b>",
        "animation",
    ),
    "moving canvas": (
        lambda page: page.evaluate(MOVING),
        "<canvas></canvas><script>const c = document.querySelector('canvas').getContext('2d');"
        "let i = 0; setInterval(() => c.fillRect(i++, 0, 1, 9), 9)</script>",
        "canvas",
    ),
    "too wide": (narrow, "<div style='width: 400px'>x</div>", "wide"),
    "overlap": (narrow, "<p>words</p><p style='margin-top: -2em'>others</p>", "overlap"),
    "dark paper": (paper, "<style>body { background: #16191d; color: #fff }</style>x", "dark"),
    "button on paper": (paper, "<button>x</button>", "control"),
    "folded": (paper, "<details><summary>x</summary>y</details>", "folded"),
    "distorted": (
        paper,
        "<canvas width=90 height=10 style='width: 90px; height: 90px'>",
        "distorted",
    ),
    "cut off": (
        paper,
        "<div style='overflow: auto'><table width=900><td>x</table></div>",
        "cut off",
    ),
    "no picture": (lambda page: without_script(page, False, False), "x", "no picture"),
    "no sentence": (lambda page: without_script(page, True, True), "x", "no sentence"),
}


@pytest.mark.parametrize("defect", BROKEN)
def test_a_defect_is_found(defect, sheet):
    check, body, found = BROKEN[defect]
    style = "<style>:root { color-scheme: light dark }</style>" if defect == "dark text" else ""
    sheet.set_content(HEAD + style + body)
    assert found in str(check(sheet))


def test_a_page_without_defects_passes(sheet):
    sheet.set_content(STILL)
    checks = (contrast, keyboard, played, narrow, paper, lambda page: page.evaluate(MOVING))
    assert not any(check(sheet) for check in checks)
    assert not without_script(sheet, True, False)
