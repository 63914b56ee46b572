"""What a command does to nodes, as scripts judge it: what can be taken back, and what is played in a rehearsal."""

from __future__ import annotations

from enum import Enum


class Effect(Enum):
    """What a command, or a word of the DVT, does to nodes; its own file says which."""

    READS = "looks, listens, or works on files: no node is another one afterwards"
    SELECTS = "says which node, or which device, the lines after it are about"
    CHANGES = "changes what a node holds; `undo` reverts it"
    FINAL = "keeps what a node holds, or brings back what was kept: no `undo` reverts it"
    COMMANDS = "does to a node what its history does not hold, such as NMT commands"
    RUNS = "runs other lines"
