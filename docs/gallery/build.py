"""Make the gallery: of each shipped model a picture, its report and its animation, and two indexes.

Run by `make gallery`. What is small is kept in the repository (`README.md`, the pictures, the
animation of the README); `index.html` and the pages that it leads to are made again.
"""

from __future__ import annotations

import os
from html import escape
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

import lagcli
from lagcli.cli.app import run as command
from lagcli.model.model import Model
from lagcli.model.reading import shipped_models
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.drawing import SceneDrawing
from lagcli.pictures.scene.view_evaluator import scene_of

HERE = Path(__file__).parent
MODELS = HERE.parents[1] / "models"
PAGES = HERE / "pages"

SIZE = (480, 360)
#: Around the mechanism in a picture of the gallery, pixels; the least ratio of its sides.
MARGIN, LEAST_RATIO = 14, 0.6
#: Frames and colours of a film.
FRAMES, COLORS = 90, 32
#: Columns of the index in Markdown.
COLUMNS = 4
#: The part of the run after which the picture is taken.
MOMENT = 0.45
#: The animation that the README shows.
SHOWN = "slider_crank"

INTRODUCTION = """# Gallery

The shipped models, each at one moment of its run. Constraint forces are orange, velocities blue,
and recent paths light blue. Each picture leads to its model. To animate a model, or to make its
report:

```sh
lagcli simulate models/four_bar.yaml -o run.h5
lagcli animate run.h5 -o run.html
lagcli report run.h5 -o report.html
```

`make gallery` builds this page, and `docs/gallery/index.html`, whose pictures move when you point
at them and lead to the reports of the models.

"""


class Cropped(NamedTuple):
    """A drawing of a run, and the part of its pictures that the mechanism needs."""

    drawing: SceneDrawing
    box: tuple[int, int, int, int]

    def at(self, part: float) -> Image.Image:
        """Return the picture after a part of the run."""
        time = self.drawing.scene.time
        frame = self.drawing.frame(time[0] + part * (time[-1] - time[0]))
        return Image.fromarray(frame).crop(self.box)


def drawn(run: RunFile) -> Cropped:
    """Return the drawing of a run."""
    scene = scene_of(run)
    assert scene is not None, f"{run.name}: every shipped model has a view"
    drawing, (width, height) = SceneDrawing(scene, *SIZE, annotated=False), SIZE
    if scene.dimension == 3:
        return Cropped(drawing, (0, 0, width, height))
    ends = drawing.camera.project(np.array(scene.bounds).T)[:, :2]
    (left, low), (right, high) = ends[0] - MARGIN, ends[1] + MARGIN
    # a picture that is not too high or too wide for its cell, around the middle
    size = max(right - left, LEAST_RATIO * (high - low)), max(high - low, 0.4 * (right - left))
    half = [min(x, most) / 2 for x, most in zip(size, SIZE, strict=True)]
    x, y = width / 2, height / 2
    box = (x - half[0], y - half[1], x + half[0], y + half[1])
    return Cropped(drawing, tuple(map(round, box)))  # type: ignore[arg-type]


def picture(run: RunFile) -> Image.Image:
    """Return the picture of a run."""
    return drawn(run).at(MOMENT)


def make(*arguments: str | os.PathLike[str]) -> None:
    """Run a command of lagcli, which replaces files and says nothing."""
    status = command([*map(os.fspath, arguments), "--force", "--quiet"])
    if status:
        raise SystemExit(f"lagcli {arguments[0]} ended with status {status}")


def main() -> None:
    """Make all of it."""
    PAGES.mkdir(exist_ok=True)
    models: dict[str, Model] = {}
    for path in shipped_models().values():
        name = path.stem
        print(name)
        models[name] = lagcli.load(path)
        result = PAGES / f"{name}.h5"
        make("simulate", path, "-o", result)
        picture(RunFile(result)).save(HERE / f"{name}.png", optimize=True)
        film(RunFile(result), PAGES / f"{name}.gif")
        make("animate", result, "-o", PAGES / f"{name}.html")
        make("report", result, "-o", PAGES / f"{name}-report.html")
    options = ("--size", "480x320", "--to", "2", "--fps", "20")
    make("animate", PAGES / f"{SHOWN}.h5", "-o", HERE / f"{SHOWN}.gif", *options)
    (HERE / "README.md").write_text(INTRODUCTION + table(models), encoding="utf-8")
    (HERE / "index.html").write_text(index(models), encoding="utf-8")


def film(run: RunFile, path: Path) -> None:
    """Write the motion of a run, with the crop of its picture."""
    cropped = drawn(run)
    frames = [cropped.at(part).quantize(COLORS) for part in np.linspace(0, 1, FRAMES)]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=60, loop=0)


def alt(name: str, model: Model) -> str:
    """Return what a picture shows, in words."""
    return escape(f"{model.title or name}: {model.description.rstrip('.')}")


def table(models: dict[str, Model]) -> str:
    """Return the index in Markdown: a grid."""
    place, cells = shipped_models(), []
    for name, model in models.items():
        link = f"../../models/{place[name].relative_to(MODELS).as_posix()}"
        picture = f'<img src="{name}.png" width="200" alt="{alt(name, model)}">'
        cells.append(f"[{picture}]({link})<br>[{name}]({link})")
    cells += [""] * (-len(cells) % COLUMNS)
    rows = [
        f"| {' | '.join(cells[start : start + COLUMNS])} |"
        for start in range(0, len(cells), COLUMNS)
    ]
    empty = "|" + "   |" * COLUMNS
    return "\n".join([empty, "|" + "---|" * COLUMNS, *rows, ""])


def index(models: dict[str, Model]) -> str:
    """Return the index in HTML."""
    items = [
        f"""<li><a href="pages/{name}-report.html"><span class="picture"><img src="{name}.png"
alt="{alt(name, model)}"><img class="moving" loading="lazy" data-src="pages/{name}.gif"
alt=""></span><h2>{escape(model.title or name)}</h2></a><p>{escape(model.description)}</p>
<p><a href="pages/{name}-report.html">report</a> ·
<a href="pages/{name}.html">animation</a></p></li>"""
        for name, model in models.items()
    ]
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>lagcli: gallery</title>
<style>
:root {{ color-scheme: light dark; }}
body {{ background: light-dark(#fff, #16191d); color: light-dark(#1b1b1b, #ececec);
  font: 1rem/1.45 system-ui, sans-serif; max-width: 80rem; margin: 0 auto; padding: 1rem; }}
ul {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(17rem, 1fr)); gap: 1.5rem;
  list-style: none; padding: 0; }}
.picture {{ display: block; position: relative; background: #fff; border-radius: 6px;
  border: 1px solid #8888; aspect-ratio: 4 / 3; overflow: hidden; }}
.picture img {{ position: absolute; inset: 0; width: 100%; height: 100%; object-fit: contain; }}
.moving {{ visibility: hidden; background: #fff; }}
a:hover .moving[src], a:focus-visible .moving[src] {{ visibility: visible; }}
a {{ color: inherit; }}
a:focus-visible {{ outline: 3px solid #0072b2; outline-offset: 2px; }}
h2 {{ font-size: 1rem; margin: 0.4rem 0 0; }}
p {{ margin: 0.1rem 0; }}
@media (prefers-reduced-motion: reduce) {{ .moving, .hint {{ display: none; }} }}
@media (scripting: none) {{ .hint {{ display: none; }} }}
@media print {{ :root {{ color-scheme: light; }} .hint, .moving {{ display: none; }} }}
</style>
</head>
<body>
<h1>lagcli: gallery</h1>
<p class="hint">Point at a picture, or move to it by the Tab key, to see it move; each leads to its
report.</p>
<ul>
{"".join(items)}
</ul>
<script>
// a film is fetched when it is looked at, and begins again each time
for (const link of document.querySelectorAll("a:has(.moving)")) {{
  const film = link.querySelector(".moving");
  const play = () => {{ film.src = film.dataset.src; }};
  const stop = () => film.removeAttribute("src");
  link.addEventListener("pointerenter", play);
  link.addEventListener("focus", play);
  link.addEventListener("pointerleave", stop);
  link.addEventListener("blur", stop);
}}
</script>
</body>
</html>
"""


if __name__ == "__main__":
    main()
