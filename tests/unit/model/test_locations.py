from lagcli.model.loader import load_text
from lagcli.model.locations import declarations_in, lines_of

TEXT = """
coordinates: [x, "y[1..2]"]
parameters: {m: 1}
T: m/2*(x'^2 + y[1]'^2 + y[2]'^2)
constraints:
  rod[i = 1..2]: x + y[i] = 1
events:
  end: {when: x >= 2, stop: true}
initial: {x: 1, "y[1..2]": 0, x': 0, "y[1..2]'": 0}
"""


def test_names_of_a_message_are_found_in_the_file():
    model = load_text(TEXT, "a.yaml")
    assert declarations_in(model, "`rod[2]` and `end`, but not `m`, rod[1] or `--set`") == [
        "`rod[2]` is declared in a.yaml:6",
        "`end` is declared in a.yaml:8",
    ]
    assert declarations_in(model, "`x`, `x`: `y[1]`") == [
        "`x` is declared in a.yaml:2",
        "`y[1]` is declared in a.yaml:2",
    ]


def test_members_of_a_family_have_one_line():
    model = load_text(TEXT, "a.yaml")
    assert lines_of(model, ["rod[1]", "rod[2]"]) == "a.yaml:6"
    assert lines_of(model, ["rod[1]", "x"]) == "a.yaml:2, 6"
    assert lines_of(model, ["other"]) == ""
