"""Options that several commands share."""

from __future__ import annotations

import click

force = click.option("--force", is_flag=True, help="Write into an output folder (or over a file) that exists.")
jobs = click.option("-j", "--jobs", type=click.IntRange(min=1), help="Images worked on at once.  [default: all processors]")
as_json = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
