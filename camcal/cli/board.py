"""`camcal board`."""

from __future__ import annotations

import click

from camcal.cli import options
from camcal.cli.console import say_wrapped


@click.command(cls=options.Command, epilog="Example: camcal board checkerboard:9x6:25mm -o board.pdf")
@click.argument("spec")
@click.option(
    "-o", "--output", required=True, metavar="FILE", help="Page to write: .pdf, .svg or .png; or .yaml, a board file."
)
@click.option("--paper", default="auto", show_default=True, metavar="a4|a3|letter|WxHmm", help="Paper size.")
@click.option("--landscape", is_flag=True, help="Turn the paper onto its long side.")
@click.option("--dpi", default=300, show_default=True, type=click.IntRange(min=1), help="Resolution of a PNG.")
@options.force
@options.help_option
def board(*, spec: str, output: str, paper: str, landscape: bool, dpi: int, force: bool) -> None:
    """Write a board as a page to print, true to scale.

    SPEC is a one-liner (checkerboard:9x6:25mm counts INNER corners; aprilgrid:6x6:30mm:0.3 gives tags, tag side and the
    spacing as a share of it), the name of a sample board, or a board file.
    """
    if output.lower().endswith((".yaml", ".yml")):
        from camcal.workflows.export_board import export_board

        export_board(spec, output, to="camcal", force=force)
        say_wrapped(f"{output}: the board {spec}; pass it with --board.")
        return
    from camcal.workflows.board import board as print_board

    page = print_board(spec, output, paper=paper, landscape=landscape, dpi=dpi, force=force)
    say_wrapped(f"{output}: {page.spec} on {page.width_mm:g} x {page.height_mm:g} mm.")
    say_wrapped(f"Print at 100 %, measure the ruler, and calibrate with --board {page.spec}")
