"""A folder in which the examples of a page are run."""

import shutil
from pathlib import Path

import pytest
from documented import Examples

MODELS = Path(__file__).parents[2] / "models"


@pytest.fixture
def examples(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Examples:
    """Run examples in a folder of their own, which has the models."""
    shutil.copytree(MODELS, tmp_path / "models")
    monkeypatch.chdir(tmp_path)
    return Examples(tmp_path, capsys)
