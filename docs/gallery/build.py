"""Make the gallery: of each shipped model a picture, its report and its animation, and two indexes.

Run by `make gallery`. What is small is kept in the repository (`README.md`, the pictures, the
animation of the README); `index.html` and the pages that it leads to are made again.
"""

from __future__ import annotations

import os
from html import escape
from pathlib import Path

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
#: The part of the run after which the picture is taken.
MOMENT = 0.45
#: The animation that the README shows.
SHOWN = "slider_crank"

INTRODUCTION = """# Gallery

The shipped models, each at one moment of its run. Constraint forces are orange, velocities blue,
and recent paths light blue. To animate a model:

```sh
lagcli simulate models/four_bar.yaml -o run.h5
lagcli animate run.h5 -o run.html
```

`make gallery` builds this page, and `docs/gallery/index.html` with the animations and reports of
all models.

"""


def picture(run: RunFile) -> Image.Image:
    """Return the picture of a run."""
    scene = scene_of(run)
    assert scene is not None, f"{run.name}: every shipped model has a view"
    time = scene.time[0] + MOMENT * (scene.time[-1] - scene.time[0])
    return Image.fromarray(SceneDrawing(scene, *SIZE).frame(time))


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
        make("animate", result, "-o", PAGES / f"{name}.html")
        make("report", result, "-o", PAGES / f"{name}-report.html")
    film = ("--size", "480x320", "--to", "2", "--fps", "20")
    make("animate", PAGES / f"{SHOWN}.h5", "-o", HERE / f"{SHOWN}.gif", *film)
    (HERE / "README.md").write_text(INTRODUCTION + table(models), encoding="utf-8")
    (HERE / "index.html").write_text(index(models), encoding="utf-8")


def table(models: dict[str, Model]) -> str:
    """Return the index in Markdown."""
    place = shipped_models()
    rows = [
        f'| <img src="{name}.png" width="240" alt=""> |'
        f" [{name}](../../models/{place[name].relative_to(MODELS).as_posix()})"
        f"<br>{model.description} |"
        for name, model in models.items()
    ]
    return "\n".join(["| | |", "|---|---|", *rows, ""])


def index(models: dict[str, Model]) -> str:
    """Return the index in HTML."""
    items = [
        f"""<li><a href="pages/{name}.html"><img src="{name}.png" width="{SIZE[0]}"
height="{SIZE[1]}" alt="Animation of {name}"></a>
<h2>{name}</h2><p>{escape(model.description)}</p>
<p><a href="pages/{name}.html">animation</a> ·
<a href="pages/{name}-report.html">report</a></p></li>"""
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
body {{ font: 1rem/1.45 system-ui, sans-serif; max-width: 75rem; margin: 0 auto; padding: 1rem; }}
ul {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(18rem, 1fr)); gap: 1.5rem;
  list-style: none; padding: 0; }}
img {{ width: 100%; height: auto; border-radius: 6px; border: 1px solid #8888; }}
h2 {{ font-size: 1rem; margin: 0.4rem 0 0; }}
p {{ margin: 0.1rem 0; }}
</style>
</head>
<body>
<h1>lagcli: gallery</h1>
<ul>
{"".join(items)}
</ul>
</body>
</html>
"""


if __name__ == "__main__":
    main()
