"""Every command of camcal, imported."""

from __future__ import annotations

import click

from camcal.cli import cli

_LOADED = {name: cli.get_command(click.Context(cli), name) for name in cli.list_commands(click.Context(cli))}
COMMANDS = {name: command for name, command in _LOADED.items() if command is not None}
"""Commands by the names that a user calls them."""
