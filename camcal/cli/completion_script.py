"""`camcal completion`."""

from __future__ import annotations

import click

from camcal.cli import completion, options
from camcal.cli.console import say


@click.command("completion", cls=options.Command, epilog="Example: camcal completion bash")
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
@options.help_option
@click.pass_context
def completion_script(context: click.Context, shell: str) -> None:
    """Print a script that lets a shell complete commands, options, files and shipped names.

    \b
    bash  echo 'eval "$(camcal completion bash)"' >> ~/.bashrc
    zsh   echo 'eval "$(camcal completion zsh)"' >> ~/.zshrc
    fish  camcal completion fish > ~/.config/fish/completions/camcal.fish

    Then open a new shell. Bash needs version 4.4 or later; in zsh, compinit must have run before.
    """  # noqa: D301 - click's mark of a paragraph that is not wrapped
    from click.shell_completion import ShellComplete, get_completion_class

    script = get_completion_class(shell)
    if script is None:
        raise AssertionError(f"click has no completion for {shell}")
    # Not its own source(): bash's would ask the bash that is installed here, which need not be the one that reads this.
    say(ShellComplete.source(script(context.find_root().command, {}, "camcal", completion.VARIABLE)).rstrip("\n"))
