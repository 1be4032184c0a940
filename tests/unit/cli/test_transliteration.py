"""Formulas in encodings without Greek letters, powers and dots."""

from __future__ import annotations

import codecs

import pytest

from lagcli.cli.streams import replacement

codecs.register_error("test-plain", replacement)


@pytest.mark.parametrize(
    ("encoding", "text", "plain"),
    [
        ("ascii", "½ m ẋ² + x⁻¹ θ̇₁₂", "1/2 m x'^2 + x^-1 theta'_12"),
        ("ascii", "∂L/∂q̇ᵢ = Σ λ, λ ⊥ y ≥ −1 …", "dL/dq'_i = Sigma lambda, lambda _|_ y >= -1 ..."),
        ("ascii", "xᵢ₋₁ → Ω ẍ φ̈", "x_i-1 -> Omega x'' phi''"),
        ("ascii", "García 漢", "Garcia ?"),
        ("cp1252", "½ m ẋ² García, λ ± 1°", "½ m x'² García, lambda ± 1°"),
        ("cp437", "α m ẍ − λ", "α m x'' - lambda"),
    ],
)
def test_what_an_encoding_lacks_is_written_plainly(encoding: str, text: str, plain: str) -> None:
    assert text.encode(encoding, "test-plain").decode(encoding) == plain


def test_only_writing_is_replaced() -> None:
    with pytest.raises(UnicodeDecodeError):
        b"\xff".decode("utf-8", "test-plain")
