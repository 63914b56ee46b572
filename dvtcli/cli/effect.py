"""The effect of a command on nodes, by which scripts decide on undo and rehearsal."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple


class Effect(Enum):
    """The effect of a command, or of a DVT word, on nodes; declared in its own file."""

    READS = "looks, listens, or works on files: no node is another one afterwards"
    SELECTS = "says which node, or which device, the lines after it are about"
    CHANGES = "changes what a node holds; `undo` reverts it"
    KEEPS = "keeps what a node holds: no `undo` reverts it"
    BRINGS_BACK = "brings back what a node kept: no `undo` reverts it"
    COMMANDS = "does to a node what its history does not hold, such as NMT commands"
    RUNS = "runs other lines"


class Final(NamedTuple):
    """The part of a line that no `undo` reverts, in words; *brings_back*: the line loads stored values."""

    words: str
    brings_back: bool = False


def final_write(name: str, index: int | None) -> Final | None:
    """Return the part of *name* that no `undo` reverts if it writes *index*: a store or restore."""
    from dvtcli.device.store.store_parameters import RESTORE, SIGNATURES

    return Final(f"{name} to 0x{index:04X}", index == RESTORE) if index in SIGNATURES else None
