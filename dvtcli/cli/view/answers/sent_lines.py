"""The text of frames that were sent, and of recordings that were played."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Line, Table
from dvtcli.domain.several import plural
from dvtcli.domain.typed_frame import frame_text
from dvtcli.operations.results.sent import FramesSent, Outcome, Replayed


def sent_lines(result: FramesSent, _width: int) -> Iterator[Line]:
    """How many frames were sent, and how late; under --dry-run that none was."""
    if not result.dry_run:
        yield outcome_text(result.outcome)
        return
    asked = [frame for frame in result.frames if frame.effects]
    yield f"dry run: nothing was sent; nodes act on {len(asked)} of {plural(len(result.frames), 'frame')}"
    for frame in asked:
        yield f"  {frame_text(frame.explained.frame)}: {frame.effects}"


def replayed_lines(result: Replayed, width: int) -> Iterator[Line]:
    """How many frames were sent, and how late, and what was left out; under --dry-run a table of what would be sent."""
    if result.dry_run:
        yield f"dry run: nothing was sent of {plural(result.outcome.wanted, 'frame')}"
        table = Table(("COB-ID", "WHAT", "FRAMES", "ASKED BECAUSE"), frozenset({2}), shrink=3, wraps=True)
        for row in result.frames:
            can_id = f"0x{row.can_id:0{8 if row.extended else 3}X}"
            what = f"{row.label}{f', node {row.node}' if row.node else ''}{', remote' if row.remote else ''}"
            table.add(can_id, what, str(row.count), row.effects)
        yield from table.lines(width)
    else:
        yield outcome_text(result.outcome)
    if result.left_out:
        yield f"left out: {', '.join(f'{reason} ({count})' for reason, count in result.left_out)}"


def outcome_text(outcome: Outcome) -> str:
    """How many frames were sent of how many, in what time, and how late they were."""
    said = outcome.counted
    said += " handed to the interface" if outcome.sent is None else " sent"
    if outcome.handed > 1:
        said += f" in {outcome.seconds:.2f} s"
    if outcome.late_s is not None and outcome.nearly_s is not None and outcome.handed > 1:
        said += f", at most {outcome.late_s * 1000:.1f} ms late (99 %: {outcome.nearly_s * 1000:.1f} ms)"
    return said
