"""`camcal synth`."""

from __future__ import annotations

import click

from camcal.cli import options
from camcal.cli.console import ConsoleReporter, say_wrapped


@click.command(cls=options.Command, epilog="Example: camcal synth webcam_720p -o data/")
@click.argument("config")
@click.option("-o", "--output", required=True, metavar="DIR", help="Folder for images and truth.")
@options.jobs
@options.force
@options.help_option
def synth(config: str, output: str, jobs: int | None, force: bool) -> None:
    """Render a board through a known camera, with the exact truth beside the images.

    CONFIG is a scenario file, or the name of a shipped one (webcam_720p, wide_action, industrial_5mp, phone_12mp,
    aprilgrid_rig, blur_noise). The truth is written in the files that `calibrate` writes: camera.yaml, views.yaml,
    corners.csv and board.yaml.
    """
    from camcal.workflows.synth import synth as render

    made = render(config, output, force=force, jobs=jobs, reporter=ConsoleReporter())
    views, board = made.scenario.views.count, made.scenario.board.spec
    say_wrapped(f"{made.folder}: {views} views of {board}, {made.corners} corners, with their truth.")
