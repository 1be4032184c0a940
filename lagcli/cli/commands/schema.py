"""`lagcli schema`: the JSON Schema of model files."""

import json
import sys

from lagcli.cli.options import Force, Output, Quiet


def schema(output: Output = None, force: Force = False, quiet: Quiet = False) -> None:
    """Print the JSON Schema (draft-07) of model files, for editors.

    An editor with YAML support then completes keys, describes them and marks unknown ones. The
    first line of the files that `lagcli new` writes names the schema as lagcli.schema.json.
    """
    from lagcli.cli.streams import visible_json
    from lagcli.model.loader import json_schema
    from lagcli.results.atomic import whole_file

    text = json.dumps(json_schema(), indent=2, ensure_ascii=False) + "\n"
    if output in (None, "-"):
        sys.stdout.write(visible_json(text))
        return
    with whole_file(output, force) as file:
        file.write(text.encode())
    if not quiet:
        print(f"written: {output}", file=sys.stderr)
