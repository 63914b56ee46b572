"""What a command does to nodes, as scripts judge it: what can be taken back, and what is played in a rehearsal."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple


class Effect(Enum):
    """What a command, or a word of the DVT, does to nodes; its own file says which."""

    READS = "looks, listens, or works on files: no node is another one afterwards"
    SELECTS = "says which node, or which device, the lines after it are about"
    CHANGES = "changes what a node holds; `undo` reverts it"
    KEEPS = "keeps what a node holds: no `undo` reverts it"
    BRINGS_BACK = "brings back what a node kept: no `undo` reverts it"
    COMMANDS = "does to a node what its history does not hold, such as NMT commands"
    RUNS = "runs other lines"


class Final(NamedTuple):
    """What one line does that no `undo` reverts, in its own words; *brings_back* says that it loads what is kept."""

    words: str
    brings_back: bool = False


def final_write(name: str, index: int | None) -> Final | None:
    """What *name* does that no `undo` reverts where it writes to *index*: storing, or restoring, by its object."""
    from dvtcli.device.store_parameters import RESTORE, SIGNATURES

    return Final(f"{name} to 0x{index:04X}", index == RESTORE) if index in SIGNATURES else None
