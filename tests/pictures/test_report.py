"""Reports: what stands on the page, what is rejected, and how large pages are."""

import base64
import json
import re
import warnings
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from peak_memory import peak
from shipped import PATHS, every_model

import lagcli
from lagcli.cli.app import run as cli
from lagcli.errors import FileError, LagcliError
from lagcli.pictures.curves import Curve
from lagcli.pictures.page import number, unit
from lagcli.pictures.report import report
from lagcli.pictures.report.report_page import highlighted
from lagcli.pictures.report.run_plots import Plot, gather
from lagcli.pictures.selection import chosen, elided
from lagcli.trajectory.extremes import Extreme

MODELS = Path(__file__).parents[2] / "models"
MB = 1_000_000
#: Elements that have no end tag.
VOID = {"meta", "wbr", "input", "br", "path", "img"}


class Outline(HTMLParser):
    """Checks that tags are closed in order, and gathers what the page says."""

    def __init__(self):
        super().__init__()
        self.open, self.text, self.tables, self.attributes = [], [], [], []

    def handle_starttag(self, tag, attributes):
        self.attributes += [(tag, *pair) for pair in attributes]
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.tables.append([])
        elif tag in ("td", "th") and self.tables:
            self.tables[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"script", "style"} & set(self.open):
            self.text.append(data)
        if self.tables and {"td", "th"} & set(self.open):
            self.tables[-1][-1] += data


def read(path):
    outline = Outline()
    outline.feed(path.read_text(encoding="utf-8"))
    assert not outline.open
    return outline


def data_of(path):
    """Return the numbers of a page: its JSON, with the arrays in place."""
    text = path.read_text(encoding="utf-8")
    found = json.loads(
        re.search(r'<script type="application/json" id="data">(.*?)</script>', text)[1]
    )
    arrays = [np.frombuffer(base64.b64decode(x), dtype="<f8") for x in found["arrays"]]
    for plot in found["plots"]:
        plot["time"] = arrays[plot["time"]]
        for series in plot["series"]:
            series["values"] = arrays[series["values"]]
    return found


def sampled(run, samples):
    """Return the fields of a run with some of its samples."""
    fields = dict(vars(run))
    for name, value in fields.items():
        if isinstance(value, np.ndarray) and not name.startswith("scale"):
            fields[name] = value[samples]
    return fields | {"outputs": {name: value[samples] for name, value in run.outputs.items()}}


def series_of(path, name):
    """Return times and values of the curve of a name."""
    for plot in data_of(path)["plots"]:
        for series in plot["series"]:
            if series["name"] == name:
                return plot["time"], series["values"]
    raise AssertionError(f"there is no curve {name}")


@pytest.mark.parametrize("name", every_model())
def test_every_shipped_model(name, tmp_path):
    model = lagcli.load(PATHS[name])
    trajectory = lagcli.simulate(model, samples=60)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = report(trajectory, tmp_path / "report.html")
    page = read(tmp_path / "report.html")
    text = " ".join(" ".join(page.text).split())
    assert model.name in text
    assert trajectory.model_sha256 in text
    assert made.size < 1.5 * MB
    for name in trajectory.constraints[:3]:
        general = re.sub(r"\[.*\]", "[i]", name)
        assert any(re.search(rf"{re.escape(x)} ?:", text) for x in (name, general))
    assert data_of(tmp_path / "report.html")["scene"] is not None
    loaded = [a for a in page.attributes if a[1] in ("src", "style") or a[1].startswith("on")]
    assert all(a[1] == "src" and a[2].startswith("data:image/") for a in loaded)
    assert all(a[2].startswith("#") for a in page.attributes if a[1] == "href")


@pytest.fixture(scope="module")
def crank(result, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    report(result("slider_crank"), path, title="Slider <crank> & co.")
    return path


@pytest.fixture(scope="module")
def run(result):
    return lagcli.read(result("slider_crank"))


def test_curves_are_those_of_the_run(crank, run):
    time, values = series_of(crank, "lambda.guide")
    assert np.array_equal(time, run.time)
    assert np.array_equal(values, run.multipliers[:, 0])
    assert np.array_equal(series_of(crank, "phi_dot")[1], run.v[:, 0])
    assert np.array_equal(
        series_of(crank, "Qc.guide.psi")[1], run.constraint_force_of("guide")[:, 1]
    )
    assert np.array_equal(series_of(crank, "rod_tension")[1], run.outputs["rod_tension"])
    assert np.array_equal(series_of(crank, "energy_total")[1], run.energy_total)
    scaled = run.residual_position[:, 0] / run.scale_position[0]
    assert np.array_equal(series_of(crank, "residual_position.guide")[1], scaled)


def test_applied_forces_are_there_where_there_are_some(crank, reports):
    text = crank.read_text(encoding="utf-8")
    assert "<h3>Applied forces</h3>" in text
    assert 'aria-label="Q_φ = τ − c r (r φ̇ sin φ + l ψ̇ sin ψ) sin φ"' in text
    assert "Applied forces" not in reports("pendulum_cartesian").read_text(encoding="utf-8")


def test_conserved_quantities_are_there_with_their_proofs(result, tmp_path):
    report(result("bead_on_rotating_hoop"), tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    plots, system = text.split('id="system"')
    assert "<h3>Conserved quantities, with proofs</h3>" in system
    assert 'aria-label="h − Ω ∂L/∂φ̇ = ½ m (ṙ² + r² θ̇² + r² φ̇² sin² θ)' in system
    assert 'aria-label="Ω − Ω = 0"' in system
    assert "<h3>Conserved quantities</h3>" in plots
    report(result("car_axis"), tmp_path / "none.html")
    assert "Conserved" not in (tmp_path / "none.html").read_text(encoding="utf-8")


def test_title_and_text_are_escaped(crank):
    text = crank.read_text(encoding="utf-8")
    assert '<h1 translate="no">Slider &lt;crank&gt; &amp; co.</h1>' in text
    assert "<title>Slider &lt;crank&gt; &amp; co.</title>" in text


def test_extremes_are_those_of_the_run(crank, run):
    rows = {row[0].split()[-1]: row for row in read(crank).tables if len(row) == 6}
    guide, multipliers = rows["guide"], run.multipliers[:, 0]
    shown = [float(x.replace("−", "-")) for x in guide[2:]]
    low, high = multipliers.argmin(), multipliers.argmax()
    expected = [multipliers[low], run.time[low], multipliers[high], run.time[high]]
    assert shown == pytest.approx(expected, rel=1e-5)


def test_it_says_how_the_run_was_made(crank, run):
    rows = {row[0]: row[1:] for row in read(crank).tables if row}
    assert rows["Version"] == [
        f"run by lagcli {lagcli.__version__}, page by lagcli {lagcli.__version__}"
    ]
    assert rows["Model"] == [f"sha256 {run.model_sha256}"]
    assert "rtol = 1e-09" in rows["Options"][0]
    assert f"{run.counts['steps']} steps" in rows["Counts"][0]
    assert rows["τ"] == ["torque on the crank", "0", "N m"]
    assert rows["g"] == ["", "9.81", "m/s²"]
    moved = run.initial_correction["psi'"]
    assert [float(x) for x in rows["ψ."][:2]] == pytest.approx(moved, rel=1e-7)


def test_the_model_is_on_the_page_as_it_is(crank, run):
    text = crank.read_text(encoding="utf-8")
    shown = re.search(r"<pre.*?><code>(.*?)</code></pre>", text, re.DOTALL)[1]
    assert unescape(re.sub(r"<[^>]*>", "", shown)) == run.model.rstrip("\n")


def test_the_policy_lets_nothing_in(crank):
    text = crank.read_text(encoding="utf-8")
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)[1]
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe" not in policy
    assert "http" not in policy
    # the license of what is embedded goes along
    assert "The MIT License (MIT)" in text
    assert "Copyright (c) 2022 Leon Sorokin" in text


def test_powers_that_are_rounding_are_left_out(crank, reports):
    names = [s["name"] for p in data_of(crank)["plots"] for s in p["series"]]
    assert "power_constraint" not in names
    assert "power_applied" not in names
    # where no power is more than rounding, next to a joule in three seconds
    sleigh = data_of(reports("chaplygin_sleigh"))["plots"]
    assert not [s["name"] for p in sleigh for s in p["series"] if s["name"].startswith("power")]
    names = [
        s["name"] for p in data_of(reports("driven_slider_crank"))["plots"] for s in p["series"]
    ]
    assert "power_constraint" in names


def test_a_failed_run_is_reported(tmp_path):
    model = lagcli.load(MODELS / "slider_crank.yaml")
    path = tmp_path / "run.h5"
    assert (
        cli(["simulate", str(MODELS / "slider_crank.yaml"), "--max-steps", "50", "-o", str(path)])
        == 3
    )
    made = report(path, tmp_path / "report.html")
    assert "failed" in made.notes[0]
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    banner = text.index('<div class="status bad" role="alert">')
    assert text.index("<h1 ") < banner < text.index("<main")
    assert "The run failed" in text
    assert "stopped after 50 steps" in text
    assert model.name in text


def test_a_run_without_samples_is_a_page_without_plots(tmp_path, result):
    whole = lagcli.read(result("slider_crank"))
    fields = sampled(whole, slice(0))
    fields |= {"status": "interrupted", "message": "interrupted at the start"}
    report(type(whole)(**fields), tmp_path / "report.html")
    text = " ".join(read(tmp_path / "report.html").text)
    assert "It has no samples" in text
    assert "interrupted at the start" in text
    assert data_of(tmp_path / "report.html")["plots"] == []


def test_a_model_without_a_view_is_shown_by_its_plots(tmp_path, result):
    text = lagcli.read(result("bead_on_rotating_hoop")).model
    model = lagcli.load_text(text[: text.index("view:")])
    report(lagcli.simulate(model, samples=20), tmp_path / "report.html")
    assert data_of(tmp_path / "report.html")["scene"] is None
    assert '<aside id="motion"' not in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_large_system_is_abridged_and_marked(tmp_path):
    model = lagcli.load(MODELS / "chain.yaml", set={"N": 120})
    report(lagcli.simulate(model, t_end=0.02, samples=5), tmp_path / "report.html")
    page = read(tmp_path / "report.html")
    text = " ".join(" ".join(page.text).split())
    assert "240 coordinates, 120 constraints" in text
    assert "12 of 240 curves are drawn" in text
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    equations = html.split('<dl class="equations">')[1].split("</dl>")[0]
    # those of x and y: at both ends and between
    assert equations.count("<dt>") == 6
    assert equations.count("<span>i = 2, …, N−1</span>") == 2
    assert 'aria-label="V = Σ(j=1..N) mⱼ g yⱼ"' in html
    assert "holonomic, scleronomic; i = 2, …, N, multiplier" in text
    assert "The forces of the 120 single constraints are omitted" in text
    assert "y 120" in " ".join(" ".join(row) for row in page.tables) or "y120" in text.replace(
        " ", ""
    )
    assert (tmp_path / "report.html").stat().st_size < MB


@pytest.mark.slow
def test_long_runs_keep_their_peaks(tmp_path, result):
    """Needles one sample wide in a run of 200 000 samples are there, exactly."""
    whole = lagcli.read(result("pendulum_cartesian"))
    rng = np.random.default_rng(5)
    count = 200_000
    nearest = np.minimum(np.arange(count) * len(whole.time) // count, len(whole.time) - 1)
    fields = sampled(whole, nearest)
    fields["time"] = np.linspace(0, 10, count)
    needles = rng.choice(count, 40, replace=False)
    fields["multipliers"] = fields["multipliers"].copy()
    fields["multipliers"][needles, 0] = rng.choice([-1, 1], 40) * rng.uniform(1e4, 2e4, 40)
    run = type(whole)(**fields)
    # from a file, in blocks, and from memory, in one piece
    lagcli.write(run, tmp_path / "run.h5")
    for source in (tmp_path / "run.h5", run):
        report(source, tmp_path / "report.html", force=True)
        assert (tmp_path / "report.html").stat().st_size < 4 * MB
        time, values = series_of(tmp_path / "report.html", "lambda.rod")
        assert len(time) < count / 4
        assert np.all(np.diff(time) > 0)
        assert values.min() == run.multipliers.min()
        assert values.max() == run.multipliers.max()
        kept = np.isin(fields["multipliers"][needles, 0], values)
        assert kept.mean() > 0.9  # of two needles of one sign in one interval the higher one
        # every sample that is shown is one of the run
        places = np.searchsorted(run.time, time)
        assert np.array_equal(run.multipliers[places, 0], values)
    assert "of the 200000 samples" in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_many_short_blocks_keep_no_more_than_few_long_ones():
    """Wide systems are read in blocks of few samples, each of which keeps its own extremes."""
    count, width = 60_000, 12
    rng = np.random.default_rng(2)
    time = np.linspace(0, 1, count)
    values = rng.standard_normal((count, width))

    class Blocks:
        record, coordinates, constraints = SimpleNamespace(events=None, display={}), (), ()

        def __init__(self, length):
            self.count, self.length = count, length

        def blocks(self, fields):
            for start in range(0, count, self.length):
                part = slice(start, start + self.length)
                yield {"time": time[part], "q": values[part]}

    sizes = []
    for length in (40, count):
        curves = [Curve(f"q{i}", "q", (i,), "coordinates", "", f"q{i}") for i in range(width)]
        plot, extremes = Plot("", "", curves), {curve: Extreme() for curve in curves}
        gather(Blocks(length), [plot], extremes)
        assert np.array_equal(plot.values.min(axis=0), values.min(axis=0))
        assert np.array_equal(plot.values.max(axis=0), values.max(axis=0))
        assert [x.high for x in extremes.values()] == values.max(axis=0).tolist()
        assert [x.low_time for x in extremes.values()] == time[values.argmin(axis=0)].tolist()
        assert np.all(np.diff(plot.time) > 0)
        sizes.append(plot.values.size + plot.time.size)
    assert max(sizes) <= 40_000
    assert min(sizes) > 10_000


@pytest.mark.slow
def test_a_million_samples(tmp_path, capfd):
    """Below 6 MB, in seconds, and in memory that does not grow with the samples."""
    run, page = tmp_path / "run.h5", tmp_path / "report.html"
    model = str(MODELS / "andrews_squeezer.yaml")
    assert cli(["simulate", model, "--samples", "1000000", "-o", str(run), "--quiet"]) == 0
    assert peak("report", str(run), "-o", str(page), seconds=30) < 700
    assert page.stat().st_size < 6 * MB
    whole = lagcli.read(run)
    for i, name in enumerate(whole.constraints):
        values = series_of(page, f"lambda.{name}")[1]
        assert values.min() == whole.multipliers[:, i].min()
        assert values.max() == whole.multipliers[:, i].max()


# what is rejected


def test_csv_needs_its_model(tmp_path, capsys):
    model, bare = str(MODELS / "pendulum_cartesian.yaml"), str(tmp_path / "bare.csv")
    page = str(tmp_path / "report.html")
    assert cli(["simulate", model, "--samples", "9", "-o", bare, "--quiet"]) == 0
    assert cli(["report", bare, "-o", page]) == 2
    assert "contains no model" in capsys.readouterr().err
    assert not Path(page).exists()
    assert cli(["report", bare, "-o", page, "--model", model]) == 0
    assert "The file does not say how the run ended" in Path(page).read_text(encoding="utf-8")
    with_model = str(tmp_path / "whole.csv")
    assert cli(["simulate", model, "--samples", "9", "-o", with_model, "--meta", "--quiet"]) == 0
    assert cli(["report", with_model, "-o", page, "--force", "--title", "By hand"]) == 0
    assert '<h1 translate="no">By hand</h1>' in Path(page).read_text(encoding="utf-8")


def test_exit_statuses_and_messages(tmp_path, result, capsys):
    run, page = str(result("pendulum_cartesian")), tmp_path / "report.html"
    assert cli(["report", run, "-o", str(page)]) == 0
    said = capsys.readouterr()
    assert re.fullmatch(r".*report\.html: \d+ samples, \d+ kB\n", said.out)
    assert not said.err
    before = page.read_bytes()
    assert cli(["report", run, "-o", str(page)]) == 4
    assert "--force" in capsys.readouterr().err
    assert page.read_bytes() == before
    assert cli(["report", run, "-o", str(page), "--force", "--quiet"]) == 0
    assert not capsys.readouterr().out
    assert cli(["report", run]) == 2
    assert cli(["report", run, "-o", str(tmp_path / "report.docx")]) == 2
    assert "name it" in capsys.readouterr().err
    assert cli(["report", run, "-o", "-"]) == 2
    assert "written to a file" in capsys.readouterr().err
    assert cli(["report", str(tmp_path / "none.h5"), "-o", str(page), "--force"]) == 4
    assert cli(["report", run, "-o", str(tmp_path / "no" / "report.html")]) == 4
    assert "mkdir" in capsys.readouterr().err


def test_another_model_is_rejected(tmp_path, result):
    with pytest.raises(LagcliError):
        report(
            result("pendulum_cartesian"),
            tmp_path / "report.html",
            model=str(MODELS / "slider_crank.yaml"),
        )
    assert not list(tmp_path.iterdir())


def test_a_damaged_file_leaves_no_page(tmp_path, result):
    whole = result("pendulum_cartesian").read_bytes()
    (tmp_path / "cut.h5").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileError):
        report(tmp_path / "cut.h5", tmp_path / "report.html")
    assert not (tmp_path / "report.html").exists()


# how things are written


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (-5.158361, "−5.15836"),
        (2.37e-9, "2.37·10⁻⁹"),
        (1.5e12, "1.5·10¹²"),
        (float("nan"), "–"),
        (float("-inf"), "−∞"),
        (None, "–"),
    ],
)
def test_numbers(value, text):
    assert number(value) == text


@pytest.mark.parametrize(("symbol", "shown"), [("rad", "rad"), ("1", ""), ("kg*m^2", "kg m²")])
def test_units(symbol, shown):
    assert unit(symbol) == shown


def test_of_families_the_first_and_the_last_are_chosen():
    names = [f"x[{i}]" for i in range(1, 41)] + [f"y[{i}]" for i in range(1, 41)] + ["angle"]
    places = chosen(names, 12)
    shown = [names[i] for i in places]
    assert {"x[1]", "x[40]", "y[1]", "y[40]", "angle"} <= set(shown)
    assert len(shown) <= 12
    assert elided(places, shown, "⋮").count("⋮") == 2
    assert chosen(names[:5], 12) == [0, 1, 2, 3, 4]
    assert len(chosen([f"p{i}" for i in range(500)], 12)) == 12


def test_yaml_is_highlighted_without_losing_a_sign():
    text = "# a: b <c>\nname: 'x # no' # yes\nlist: {a: 1.5e-3, \"b\": [2, m/2*x'^2]}\nphi': 0\n"
    shown = highlighted(text)
    assert unescape(re.sub(r"<[^>]*>", "", shown)) == text.rstrip("\n")
    assert '<span class="yaml-comment"># a: b &lt;c&gt;</span>' in shown
    assert '<span class="yaml-text">&#x27;x # no&#x27;</span>' in shown
    assert '<span class="yaml-comment"># yes</span>' in shown
    assert '<span class="yaml-key">phi&#x27;</span>' in shown
    assert '<span class="yaml-number">1.5e-3</span>' in shown


def test_families_are_in_index_form(reports):
    html = reports("pendulum_chain").read_text(encoding="utf-8")
    equations = html.split('<dl class="equations">')[1].split("</dl>")[0]
    assert equations.count("<dt>") == 1
    assert "<span>i = 1, …, N</span>" in equations
    definitions = html.split("<h3>Definitions</h3>")[1].split("<details")[0]
    assert 'aria-label="Xᵢ = Xᵢ₋₁ + l sin(θᵢ)/N"' in definitions
    # the first member is where the family is fixed
    assert definitions.count('role="math"') == 4


def test_contacts_are_inequalities_with_their_remarks(reports):
    text = reports("woodpecker").read_text(encoding="utf-8")
    listed = text.split("<h3>Constraints</h3>")[1].split("<h3>")[0]
    assert 'aria-label="r_M − r₀ − h_M φ_M ≥ 0"' in listed
    assert 'aria-label="−h_M δφ_M ≥ 0"' in listed
    assert "<mtext>\u00a0and\u00a0</mtext>" in text
    for remark in ("coefficient of restitution", "sticks", "slips"):
        assert f"<span>{remark}</span>" in text


def test_names_in_messages_are_code_and_rates_have_a_unit(reports):
    text = reports("particle_on_sphere").read_text(encoding="utf-8")
    assert "<code>ground</code> stopped the run" in text
    rows = text.split("<caption>Coordinates and initial values</caption>")[1].split("</table>")[0]
    assert "Unit of the rate" in rows
    assert "<td >rad/s</td>" in rows


def test_no_heading_stands_twice(reports):
    text = reports("heavy_top").read_text(encoding="utf-8")
    found = re.findall(r"<(?:h[1-4]|caption)>(.*?)</", text)
    assert len(found) == len(set(found)), sorted(found)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("particle_on_sphere", "2 − 1 = 1 degree of freedom, with 1 constraint active at"),
        ("bouncing_ball", "1 − 0 = 1 degree of freedom, with 0 constraints active at"),
        ("slider_crank", "2 − 1 = 1 degree of freedom."),
    ],
)
def test_degrees_of_freedom_are_those_of_what_is_active(name, sentence, tmp_path):
    run = lagcli.simulate(lagcli.load(PATHS[name]), t_end=0.05, samples=3)
    made = report(run, tmp_path / "a.html")
    text = " ".join(re.sub("<[^>]*>", "", Path(made.output).read_text(encoding="utf-8")).split())
    assert f": {sentence}" in text
