"""`camcal schema`."""

from __future__ import annotations

import click

from camcal.cli import options
from camcal.cli.console import say, say_wrapped

KINDS = ("board", "camera", "synth", "views")


@click.command(cls=options.Command, epilog="Example: camcal schema board -o board.schema.json")
@click.argument("kind", type=click.Choice(KINDS), metavar=f"[{'|'.join(KINDS)}]")
@click.option("-o", "--output", metavar="FILE", help="File to write.  [default: standard output]")
@options.force
@options.help_option
def schema(*, kind: str, output: str | None, force: bool) -> None:
    """Print the JSON Schema of a YAML file, with which editors complete and check it.

    KIND is the file it is for: a board, a camera, the views of a run, or a scene for `camcal synth`. Editors with a YAML
    language server take it from a first line such as

    # yaml-language-server: $schema=board.schema.json
    """
    from camcal.workflows.schema import schema as make_schema

    content = make_schema(kind, output, force=force)
    if output is None:
        say(content.rstrip("\n"))
    else:
        say_wrapped(f"{output}: begin a {kind} file with the line")
        say(f"# yaml-language-server: $schema={output}")
