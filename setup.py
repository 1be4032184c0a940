"""Builds the compiled engine's core; without a C compiler, lagcli runs on its reference engine."""

import os
import sys
from pathlib import Path

from Cython.Build import cythonize
from setuptools import Extension, setup
from setuptools.command.build_py import build_py

# a build is isolated from the directory that it is run in
sys.path.insert(0, str(Path(__file__).parent))
from lagcli.engine.core.headers import headers

CORE = Path("lagcli") / "engine" / "core"

for name, text in headers().items():
    header = CORE / name
    if not header.exists() or header.read_text(encoding="utf-8") != text:
        header.write_text(text, encoding="utf-8")

core = Extension(
    "lagcli.engine.core.binding",
    sources=[
        str(CORE / "binding.pyx"),
        *(str(path) for path in sorted(CORE.rglob("*.c")) if path.stem != "binding"),
    ],
    depends=[
        str(path) for suffix in ("h", "pxi", "pxd") for path in sorted(CORE.rglob(f"*.{suffix}"))
    ],
    include_dirs=[str(CORE)],
    # no -ffast-math: NaN and the order of operations mean something here; nor may a processor that
    # multiplies and adds at once change them, but for `make test-fma`. Nobody reads errno, and with
    # it no root is a vector's.
    # Jumps through tables cost the evaluator dearly where they cannot be predicted. What is
    # hidden from outside is called without a detour
    extra_compile_args=[
        "-O3",
        *os.environ.get("LAGCLI_CONTRACTION", "-ffp-contract=off").split(),
        "-fno-math-errno",
        "-fno-jump-tables",
        "-fvisibility=hidden",
    ],
)
extensions = cythonize([core], language_level=3)
for extension in extensions:
    # set here because cythonize drops it; with the variable, as in CI, a failed build is an error
    extension.optional = "LAGCLI_REQUIRE_CORE" not in os.environ


#: What is copied into the package from beside it: folders there, and the files by folder here.
COPIED = {
    "models": (Path("models"), ("yaml", "csv")),
    "schemas": (Path("docs") / "schemas", ("json",)),
}


class BuildWithData(build_py):
    """Puts the shipped models and the schemas of JSON into the package; an editable install uses
    those of the checkout."""

    def run(self) -> None:
        """Build the package, and copy the files into it."""
        super().run()
        if not self.editable_mode:
            for name, (source, kinds) in COPIED.items():
                folder = Path(self.build_lib) / "lagcli" / name
                self.mkpath(str(folder))
                for path in sorted(path for kind in kinds for path in source.rglob(f"*.{kind}")):
                    self.copy_file(str(path), str(folder / path.name))


setup(ext_modules=extensions, cmdclass={"build_py": BuildWithData})
