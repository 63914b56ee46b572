"""The registry of commands; imports a command on first use."""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.catalogue import command_names, meant, task_rows, task_sections, unknown_command
from dvtcli.cli.global_options import VARIABLES, by_variable, global_options, one_pair_each, taken
from dvtcli.cli.runner_interface import CommandGroup, runners

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation


#: a context's key for the words of the line, from the command on
WORDS = "dvtcli.words"
_FIRST_OPTIONS = (
    "  -i NAME -c NAME -b BIT/S  the bus, by python-can's names",
    "  -n ID                     the node; several: 1,3,5-9, or all",
    "  --sim WHAT                a simulated node: a family, or drive.eds",
    "  --dry-run                 work on a twin of the node; write nothing to the bus",
)
_MORE = "All options: dvtcli help --all    A command's options: dvtcli help COMMAND"


class Registry(CommandGroup):
    """The set of commands in `catalogue.COMMANDS`."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.params.extend(global_options(hidden=False))

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse *args* up to the command."""
        one_pair_each(args)
        return super().parse_args(ctx, args)

    def list_commands(self, _ctx: click.Context) -> list[str]:
        """Return the commands' names without importing any."""
        return command_names()

    def get_command(self, _ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command *cmd_name*, imported now, or None."""
        if cmd_name not in command_names():
            return _dvt_word(cmd_name)
        command = import_module(f"dvtcli.cli.commands.{cmd_name}").command
        assert isinstance(command, click.Command)  # noqa: S101 - the house's convention, also tested
        return command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Find the command; suggest the nearest name for an unknown command."""
        ctx.meta[WORDS] = tuple(args)
        args = meant(args)
        if self.get_command(ctx, args[0]) is None:
            raise click.UsageError(unknown_command(args[0]), ctx)
        return super().resolve_command(ctx, args)

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write one screen: all commands by task, and the options to begin with."""
        self.format_usage(ctx, formatter)
        self.format_help_text(ctx, formatter)
        formatter.write(
            "\n".join(["", "Commands, by task:", *task_rows(), "", *_FIRST_OPTIONS, self.epilog or "", _MORE, ""])
        )

    def long_help(self, ctx: click.Context) -> str:
        """Return the help of every command and of all global options."""
        formatter = ctx.make_formatter()
        super().format_help(ctx, formatter)
        return formatter.getvalue().rstrip("\n")

    def format_commands(self, _ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands by task with their one-line helps, without importing any."""
        for task, rows in task_sections():
            with formatter.section(task):
                formatter.write_dl(rows)

    def invoke(self, ctx: click.Context) -> Any:
        """Apply the global options before the command, then run it."""
        session: Conversation = ctx.obj
        given = taken(ctx.params, ctx)
        if session.started and given:
            raise click.UsageError("options belong after the command", ctx)
        if not session.started:
            said = {name: value for name, value in given.items() if by_variable(ctx, name)}
            session.read_settings(said)
            session.start({name: value for name, value in given.items() if name not in said})
            if any(name.startswith(VARIABLES) for name in os.environ):
                from dvtcli.cli.usage_errors import unknown_variables

                for unknown in unknown_variables(os.environ):
                    session.output.note(unknown)
        return super().invoke(ctx)


def _dvt_word(name: str) -> click.Command | None:
    """Return the DVT word *name* as a command; None if unknown."""
    from dvtcli.cli.dvt.words import word_command

    return word_command(name)


def _root() -> Registry:
    @click.group(
        cls=Registry,
        name="dvtcli",
        invoke_without_command=True,
        context_settings={"help_option_names": ["-h", "--help"], "terminal_width": _help_width()},
        epilog="Try it without hardware: dvtcli --sim gen4 pdo",
    )
    @click.version_option(package_name=None, version=_version(), prog_name="dvtcli", message="%(prog)s %(version)s")
    @click.pass_context
    def root(ctx: click.Context) -> Any:
        """Configure the PDOs of CANopen devices; never leave one half configured.

        Without a command: the prompt at a terminal, a script from a pipe.
        """
        if ctx.invoked_subcommand is not None:
            return None
        return runners(ctx).without_command(ctx.obj)

    assert isinstance(root, Registry)  # noqa: S101 - for the type checker
    return root


def _help_width() -> int:
    """The width click gives its help texts, found without importing shutil as click would."""
    try:
        columns = int(os.environ.get("COLUMNS", "0")) or os.get_terminal_size(1).columns
    except (ValueError, OSError):
        columns = 80
    return max(min(columns, 80) - 2, 50)


def _version() -> str:
    from dvtcli.version import __version__

    return __version__


REGISTRY = _root()
