"""Find the result of a script by running it on twins of the nodes; sends nothing to the bus."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import Effect, of_line
from dvtcli.cli.global_options import PREFIX
from dvtcli.cli.parse_line import parse
from dvtcli.cli.scripts.script_parse import MOST_BYTES, MOST_NESTED, ScriptLine, final, script_lines, script_of
from dvtcli.cli.usage_errors import usage_error
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.device.target_config import TargetConfig, unreadable_of
from dvtcli.errors import DRY_RUN, DvtcliError, UsageError
from dvtcli.files.input_file import read_input_head

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.device.node import Node

#: Effects of lines that matter for the resulting configuration.
_PLAYED = frozenset({Effect.SELECTS, Effect.CHANGES})


def rehearsed(session: Conversation, file: str, node_id: int | None = None) -> dict[int, TargetConfig]:
    """Return the configuration set by the script *file* for each node; *node_id* is selected at its beginning.

    Starts from the nodes' present values. Raises the errors of `run`, with FILE:LINE.
    """
    stage = session.on_twins()
    stage.scripts.append(file)
    stage.selected = stage.selected if node_id is None else node_id
    _play(stage, [file])
    configs = {node_id: _config(node) for node_id, node in sorted(stage.network.nodes.items())}
    return {node_id: target for node_id, target in configs.items() if target or target.unreadable}


def _config(twin: Node) -> TargetConfig:
    """Return the values set on *twin*, with each changed PDO as a whole at the script's end."""
    pdos = {pdo: twin.pdo(pdo) for pdo in twin.wanted}
    return TargetConfig(pdos, dict(twin.wanted_values), dict(twin.requested), unreadable=unreadable_of(twin))


def _play(stage: Conversation, sources: Sequence[str]) -> None:
    source = sources[-1]
    for line in script_lines(_data(source), source):
        place = f"{source}:{line.number}"
        try:
            if _play_line(stage, line, sources):
                break
        except click.ClickException as wrong:
            raise _placed(usage_error(wrong), place) from wrong
        except DvtcliError as wrong:
            raise _placed(wrong, place) from wrong


def _play_line(stage: Conversation, line: ScriptLine, sources: Sequence[str]) -> bool:
    """Run a line on the twins; returns whether the script ends here."""
    with parse(line.words, stage) as ctx:
        if ctx.command.name == "exit":
            return True
        if ctx.params.get(f"{PREFIX}dry_run"):
            return False
        _refuse_unknown(ctx)
        if (file := script_of(ctx)) is not None:
            _play_nested(stage, file, sources)
        elif of_line(ctx).effect in _PLAYED:
            ctx.command.invoke(ctx)
    return False


def _refuse_unknown(ctx: click.Context) -> None:
    """Raise UsageError for a line that loads stored or earlier values, known to the device only."""
    found = final(ctx)
    if found is not None and found.brings_back:
        raise UsageError(
            f"the result of the script is not known before it runs: {found.words} restores the stored values",
            hint="run it, then `save FILE.dvt` and compare with that",
        )


def _play_nested(stage: Conversation, file: str, sources: Sequence[str]) -> None:
    if file in sources or len(sources) > MOST_NESTED:
        raise UsageError(f"{file} runs itself: {' runs '.join([*sources, file])}", place=file)
    if file == "-" or file.lower().endswith(".tcl"):
        raise UsageError(f"{file}: the result of such a script is unknown before it runs")
    _play(stage, [*sources, file])


def _data(source: str) -> bytes:
    try:
        return read_input_head(source, MOST_BYTES + 1)
    except OSError as failed:
        raise UsageError(f"{source}: {failed.strerror}", place=source) from failed


def _placed(wrong: DvtcliError, place: str) -> DvtcliError:
    """Add the place in the script to *wrong*, innermost first, unless already present."""
    if ":" not in wrong.text or not wrong.text.startswith(place.rpartition(":")[0]):
        wrong.text, wrong.given = f"{place}: {error_text(wrong)}", {}
    wrong.state, wrong.state_text, wrong.rehearsed = "unchanged", None, True  # what was rolled back was a twin's
    wrong.details = [row for row in wrong.details if row[0] != DRY_RUN]
    return wrong
