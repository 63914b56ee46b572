"""How far the work on a node has come, in words. Does not know who is told."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.pdo import Pdo

if TYPE_CHECKING:
    from dvtcli.device.change.progress import Progress
    from dvtcli.device.read_progress import ReadProgress


def step_progress(progress: Progress) -> tuple[str, int, int]:
    """What to say of a step that was taken: words, and how many of how many were."""
    from dvtcli.device.change.failed_change import step_text

    text = f"node {progress.node}: step {progress.done} of {progress.total}  {step_text(progress.step)}"
    is_last = progress.done == progress.total
    return f"{text}; reading back" if is_last else text, progress.done, progress.total


def look_progress(looking: ReadProgress) -> tuple[str, int, int]:
    """What to say of an object that is read: words, and how many of how many PDOs were."""
    pdo = Pdo.at(looking.index)
    whose = "" if pdo is None else f" of {pdo.label}"
    parts = f", PDO {looking.done + 1} of {looking.total}" if looking.total else ""
    text = f"node {looking.node}: reading 0x{looking.index:04X}:{looking.sub_index:02X}{whose}{parts}"
    return text, looking.done, looking.total
