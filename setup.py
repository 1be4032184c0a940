"""Builds the core's library and copies what the package takes from beside it."""

import platform
import sys
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

ROOT = Path(__file__).parent
sys.path.insert(0, str(ROOT / "building"))
from core_library import MACOS, CannotCompile, build, core  # noqa: E402

#: What is copied into the package from beside it: folders there, and the files by folder here.
COPIED = {
    "models": (Path("models"), ("yaml", "csv")),
    "schemas": (Path("docs") / "schemas", ("json",)),
}


class BuildPackage(build_py):
    """Compiles the core, and puts the shipped models and the schemas of JSON into the package; an
    editable install uses those of the checkout."""

    def run(self) -> None:
        """Build the package."""
        super().run()
        package = ROOT if self.editable_mode else Path(self.build_lib)
        try:
            build(core.library_in(package / core.CORE.relative_to(core.CORE.parents[2])))
        except CannotCompile as error:
            raise SystemExit(f"error: {error}") from None
        if not self.editable_mode:
            self._leave_out_old_module()
            for name, (source, kinds) in COPIED.items():
                folder = Path(self.build_lib) / "lagcli" / name
                self.mkpath(str(folder))
                for path in sorted(path for kind in kinds for path in source.rglob(f"*.{kind}")):
                    self.copy_file(str(path), str(folder / path.name))

    def _leave_out_old_module(self) -> None:
        """Remove the core for pages where it was compiled from other sources."""
        module = Path(self.build_lib) / "lagcli" / "live" / "assets" / "core.wasm"
        if module.exists() and core.fingerprint().encode() not in module.read_bytes():
            print("core.wasm is that of other sources; the package gets none (`make wasm`)")
            module.unlink()


class PlatformWheel(bdist_wheel):
    """A wheel for every Python of a platform: the library knows none of Python."""

    def get_tag(self) -> tuple[str, str, str]:
        """Return the tags of interpreter, binary interface and platform."""
        platform_tag = super().get_tag()[2]
        if sys.platform == "darwin":  # a universal Python too compiles for this machine alone
            platform_tag = f"macosx_{MACOS.replace('.', '_')}_{platform.machine()}"
        return "py3", "none", platform_tag


class WithLibrary(Distribution):
    """A distribution that is not for every platform."""

    def has_ext_modules(self) -> bool:
        """Return whether there is something compiled."""
        return True


setup(
    distclass=WithLibrary,
    cmdclass={"build_py": BuildPackage, "bdist_wheel": PlatformWheel},
)
