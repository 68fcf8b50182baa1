"""`camcal schema`: the JSON Schema of a kind of YAML file."""

from __future__ import annotations

from pathlib import Path

from camcal.formats.json_schema import schema_text
from camcal.formats.output import claim_file, write_atomically


def schema(kind: str, output: str | Path | None = None, *, force: bool = False) -> str:
    """Return the JSON Schema (draft 2020-12) of a kind of YAML file, with which editors complete and check such files.

    Parameters
    ----------
    kind : str
        board, camera, synth or views.
    output : path, optional
        Where to write it; without it nothing is written.
    force : bool
        Whether an existing file is replaced.

    Returns
    -------
    str
        JSON.

    Raises
    ------
    InputError
        If there is no such kind, or the file cannot be written.

    Examples
    --------
    >>> import json
    >>> json.loads(schema("views"))["title"]
    "camcal's views.yaml"
    """
    content = schema_text(kind)
    if output is not None:
        write_atomically(claim_file(output, force=force), content)
    return content
