"""The base of all commands: click's, with global options, negative numbers, and a displayed answer."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from dvtcli.cli.global_options import NEGATIVE_MARK, global_options, one_pair_each, taken

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.each_node import Ending
    from dvtcli.errors import DvtcliError
    from dvtcli.operations.results import Result
    from dvtcli.operations.session.session import Session, SessionNodes


class Effect(Enum):
    """The effect of a command, or of a DVT word, on nodes; declared in its own file."""

    NONE = "reads, listens, or works on files: no node changes"
    SELECTS = "selects the node or the device for the lines after it"
    CHANGES = "changes values of a node; `undo` reverts it"
    KEEPS = "stores values of a node: `undo` cannot revert it"
    BRINGS_BACK = "restores stored values of a node: `undo` cannot revert it"
    COMMANDS = "acts on a node without a change of values, such as NMT commands"
    RUNS = "runs other lines"


#: effects without a change of nodes; lines run by others count by themselves
_LOOKING = (Effect.NONE, Effect.SELECTS, Effect.RUNS)
_NEGATIVE = re.compile(r"-(?:\d|0x|\.\d).*", re.IGNORECASE)


class DvtCommand(click.Command):
    """A command that also accepts the global options, and negative numbers as values.

    *effect* is the effect on nodes. If the effect depends on a line's parameters, *final* returns the part that no undo
    reverts, and *stores* the possible stores beside changes. *needs_settings*: refuse to run with a malformed settings
    file. *formats* are extra answer formats (`sarif`). If *each* returns true for a line's parameters, the line runs
    for each node of `-n 1,3,5` or `-n all`: *ahead* checks all nodes first and raises an error if a node cannot run,
    *ending* makes an error from all outcomes after a failure.
    """

    def __init__(
        self,
        *args: Any,
        effect: Effect,
        final: Callable[[Mapping[str, Any]], Final | None] | None = None,
        stores: Callable[[Mapping[str, Any]], Final | None] = lambda _params: None,
        needs_settings: bool = True,
        formats: Sequence[str] = (),
        each: Callable[[Mapping[str, Any]], bool] = lambda _params: False,
        ahead: Callable[[Session, Sequence[int], Mapping[str, Any]], None] | None = None,
        ending: Ending | None = None,
        **kwargs: Any,
    ) -> None:
        super().__init__(*args, **kwargs)
        self.effect, self.needs_settings, self._final = effect, needs_settings, final
        self.stores, self.formats, self._each = stores, formats, each
        self._ahead, self._ending = ahead, ending
        self.params.extend(global_options(hidden=True))

    def final(self, params: Mapping[str, Any]) -> Final | None:
        """Return the part of a line with *params* that no undo reverts, None if none."""
        if self._final is not None:
            return self._final(params)
        keeps = self.effect in (Effect.KEEPS, Effect.BRINGS_BACK)
        return Final(self.name or "", self.effect is Effect.BRINGS_BACK) if keeps else None

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse *args*, with `-1500` and `-0x10` as values."""
        one_pair_each(args)
        marked = [NEGATIVE_MARK + arg if _NEGATIVE.fullmatch(arg) else arg for arg in args]
        try:
            return super().parse_args(ctx, marked)
        except click.BadParameter as wrong:  # click's own types quote what was typed, with the mark
            said = wrong.message.replace(repr(NEGATIVE_MARK)[1:-1], "").replace(NEGATIVE_MARK, "")
            if said == wrong.message:
                raise
            raise click.BadParameter(said, wrong.ctx, wrong.param, wrong.param_hint) from wrong

    def format_epilog(self, _ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the common global options."""
        formatter.write_paragraph()
        formatter.write_text("Also: --dry-run --json --force --yes --timeout S -q -v (help options)")

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command with its line's own global options."""
        session: Conversation = ctx.obj
        run = super().invoke
        changes = self.effect is Effect.CHANGES
        session.only_looks, session.may_have_changed = self.effect is Effect.NONE, False
        session.begin_line(is_noted=changes or self.effect in _LOOKING, tells_state=changes or bool(self.formats))
        with session.line(taken(ctx.params)):
            self._require_format(session.output.format)
            if self.needs_settings:
                session.require_settings()
            for text in _notation_notes(ctx.params.values()):
                session.output.note(text)
            if self._each(ctx.params) and _of_several(session, ctx):
                from dvtcli.cli.each_node import on_each_node

                go_on, look = self.effect in _LOOKING, self._ahead
                ahead = None if look is None else (lambda node_ids: look(session, node_ids, ctx.params))
                return on_each_node(
                    session,
                    lambda: run(ctx),
                    lambda answer: _deliver(session, answer),
                    go_on=go_on,
                    ahead=ahead,
                    ending=self._ending,
                )
            return _deliver(session, run(ctx))

    def _require_format(self, name: str) -> None:
        """Refuse a format that the answer does not have, before anything is done."""
        from dvtcli.operations.user.options import FORMATS, SPECIAL_FORMATS

        if name in SPECIAL_FORMATS and name not in self.formats:
            from dvtcli.errors import UsageError

            raise UsageError(
                f"{self.name} does not answer in {name}", hint=f"--format {' | '.join((*FORMATS, *self.formats))}"
            )


def of_line(ctx: click.Context) -> DvtCommand:
    """Return the command of a parsed line."""
    assert isinstance(ctx.command, DvtCommand)  # noqa: S101 - the registry has no other
    return ctx.command


def _notation_notes(values: Iterable[Any]) -> Iterator[str]:
    """Iterate over remarks on the notation of typed words."""
    for value in values:
        if type(value) is tuple:
            yield from _notation_notes(value)
        elif note := getattr(value, "notation_note", None):
            yield note


def _of_several(session: SessionNodes, ctx: click.Context) -> bool:
    """Whether -n names several nodes, no node was selected since, and the line names no node."""
    base = session.base
    several = base.every_node or len(base.nodes) > 1
    return several and session.selected is None and not _names_node(ctx.params.values())


def _names_node(values: Iterable[Any]) -> bool:
    """Whether a word of the line names its node (`3:6041`)."""
    return any(
        _names_node(value) if type(value) is tuple else getattr(value, "node_id", None) is not None for value in values
    )


def _deliver(session: Conversation, result: Any) -> Any:
    """Show a command's answer; an int is an exit code, None shows nothing."""
    session.may_have_changed |= not getattr(result, "changed_nothing", False)
    if result is None or isinstance(result, int):
        return result
    session.output.result(result)
    failure: DvtcliError | None = getattr(result, "failure", None)
    if failure is not None and session.output.format in result.formats:  # a case of its own
        return _code(result)
    if failure is None and (session.in_script or session.output.json):  # it must be said which line it was
        failure = getattr(result, "failure_of_line", None)
    if failure is None and session.output.json:  # a program finds the reason of each exit code in one place
        failure = getattr(result, "failure_of_document", None)
    if failure is not None:
        raise failure
    return _code(result)


def _code(result: Result) -> int:
    return result.exit_code


class Final(NamedTuple):
    """The part of a line that no `undo` reverts, in words; *brings_back*: the line loads stored values."""

    words: str
    brings_back: bool = False


def final_write(name: str, index: int | None) -> Final | None:
    """Return the part of *name* that no `undo` reverts if it writes *index*: a store or restore."""
    from dvtcli.device.store.store_parameters import SIGNATURES
    from dvtcli.domain.objects import RESTORE_PARAMETERS

    return Final(f"{name} to 0x{index:04X}", index == RESTORE_PARAMETERS) if index in SIGNATURES else None
