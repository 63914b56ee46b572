"""Print the script for Tab completion in a shell."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.runner_interface import root

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts

_SHELLS = ("bash", "zsh", "fish", "powershell")
#: A colon is a letter of an object (6C01:01), which bash would take for the end of a word.
_BASH_WORDS = "COMP_WORDBREAKS=${COMP_WORDBREAKS//:}"
#: changes of click's scripts, by shell
_CHANGES = {
    "fish": (
        ("complete --no-files", "complete --no-files --keep-order"),  # the usual objects first
        ('string split ","', 'string split --max 1 ","'),  # descriptions have commas
    ),
    # words found by a part of a name have no common beginning: zsh would delete the part, and list nothing
    "zsh": (
        (
            "        compadd -U -V unsorted -a completions\n    fi\n",
            "        compadd -U -V unsorted -a completions\n    fi\n"
            "    if (( compstate[nmatches] > 1 )) && [[ ${compstate[unambiguous]:l} != ${PREFIX:l}* ]]; then\n"
            "        compstate[insert]= compstate[list]='list force'\n"
            "    fi\n",
        ),
    ),
}


@click.command("completion", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE, needs_settings=False)
@click.argument("shell", type=click.Choice(_SHELLS), metavar="|".join(_SHELLS))
@click.pass_context
def command(ctx: click.Context, /, shell: str) -> Facts:
    """Print a script for SHELL. When the shell reads it, Tab completes commands, options, PDOs and objects.

    Objects come from `--eds` or `--sim` on the line, or from dvtcli.toml; no bus is opened.

    \b
    completion bash          ~/.bashrc: eval "$(dvtcli completion bash)"
    completion zsh           ~/.zshrc: eval "$(dvtcli completion zsh)"
    completion fish          ~/.config/fish/config.fish: dvtcli completion fish | source
    completion powershell    $PROFILE: dvtcli completion powershell | Out-String | Invoke-Expression
    """
    from click.shell_completion import get_completion_class

    from dvtcli.operations.results import Facts

    found = get_completion_class(shell)
    if found is None:
        from importlib.metadata import version

        raise click.UsageError(
            f"click {version('click')} has no completion for {shell}; newer versions have: pip install -U click"
        )
    script = found(root(ctx), {}, "dvtcli", "_DVTCLI_COMPLETE").source()
    for old, new in _CHANGES.get(shell, ()):
        script = script.replace(old, new)
    lines = [*script.splitlines(), *([_BASH_WORDS] if shell == "bash" else [])]
    return Facts("completion", (("shell", shell), ("script", "\n".join(lines))), tuple(lines))
