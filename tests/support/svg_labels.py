"""Labels of plots as text: matplotlib writes formulas letter by letter, and as comments."""

import re

_COMMENT = re.compile(r"<!-- .*? -->")


def with_whole_labels(svg: str) -> str:
    """Return a picture whose comments, the labels with formulas, are without dollar signs."""
    return _COMMENT.sub(lambda m: m[0].replace("$", ""), svg)
