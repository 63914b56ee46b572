"""What a proof of a store and one of a restore share: the restart, what is compared, and what failures in it say."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.device.change.pending import COMMUNICATION, EVERYTHING
from dvtcli.device.snapshot import Snapshot
from dvtcli.device.store_parameters import Signed, word_of
from dvtcli.domain.hint import Action, Hint, as_hint
from dvtcli.domain.proof import POWER
from dvtcli.domain.several import join_some
from dvtcli.errors import DvtcliError, Interrupted

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.pdo import Pdo, PdoConfig

#: What to do where a proof shows nothing of PDOs, or of some objects.
RESTORE_ALL = Hint(Action.PROVE_RESTORE, {"what": "all"}, "takes and compares them")
AGAIN = as_hint("once more: what refuses to be read for a moment is read then")


@dataclass(frozen=True, slots=True)
class Restart:
    """A way to make a node forget its RAM, *by* one of `domain.proof`: *run* returns once its boot-up was heard."""

    by: str
    run: Callable[[], None]
    communication: bool = False

    @property
    def certain(self) -> bool:
        """Whether RAM had no power, so that nothing can be in it that was not stored."""
        return self.by == POWER


@contextmanager
def acknowledged(node: Node, signed: Signed) -> Iterator[None]:
    """A block that proves what *signed*; a failure in it must not read as if nothing had been written."""
    try:
        yield
    except DvtcliError as failed:
        _say_acknowledged(node, signed, failed)
        raise
    except KeyboardInterrupt as torn:
        stopped = Interrupted("stopped at once", node=node.node_id, state="unknown")
        stopped.exit_code = node.cancellation.exit_code
        _say_acknowledged(node, signed, stopped)
        raise stopped from torn


def _say_acknowledged(node: Node, signed: Signed, failed: DvtcliError) -> None:
    word = word_of(signed.index)
    failed.details.insert(0, (word, f"0x{signed.place} acknowledged it before; it is not proved"))
    said = f"0x{signed.place} acknowledged the {word}, which is not proved; read back what node {node.node_id} holds"
    if failed.state == "left_changed":
        failed.state_text = f"LEFT CHANGED: see above; {said}"
    else:
        failed.state, failed.state_text = "unknown", f"unknown: {said}"


def uncovered_group(sub_index: int) -> str:
    """Why a proof shows nothing of the group *sub_index* of 0x1010 or 0x1011; empty where it covers PDOs."""
    if sub_index in (EVERYTHING, COMMUNICATION):
        return ""
    return f"PDOs are what is compared, and nobody says that group {sub_index} has them"


def unread_of(held: Snapshot, signed: Signed, after: Mapping[Pdo, PdoConfig] | None = None) -> str:
    """What of *held* could not be compared, since it could not be read at that moment; empty where all could.

    Of the PDOs *after* a restart that is what they told neither before it.
    """
    objects = held.unread_of_group(signed.sub_index)
    untold = [
        f"0x{index:04X}:{sub_index:02X} cannot be read"
        for pdo, config in (after or {}).items()
        for index, sub_index in config.untold
        if pdo in held.pdos and (index, sub_index) in held.pdos[pdo].untold
    ]
    unread = join_some([*untold, *filter(None, [objects])])
    return unread and f"not compared: {unread}"
