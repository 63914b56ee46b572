"""Law 2 for commands: one that says it only reads asks, by however many steps, for nothing that sends."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial

from tests.house.laws.askers import ASKED_BY, is_sender
from tests.house.laws.source_tree import SourceTree
from tests.house.laws.uses import ALL, Top, Uses

#: commands that only read, but for what stands here, with why that is no change of a node, or who consents
MAY_READ_AND_SEND: dict[str, dict[str, str]] = {
    "faults": {"device/error_history.py": "--clear empties the history, which is said, and no `undo` reverts it"},
    "gateway": {"": "what its clients ask for, under consent"},
    "help": {"": "names the DVT's words, each with its function, and calls none"},
    "alias": {"": "refuses an alias with the name of a DVT word in a file that is not trusted, and calls none"},
    "import": {"device/quirks.py": "the order of old firmware, over a file"},
    "monitor": {
        "cli/monitor/actions.py": "its keys, at a terminal only, ask as `nmt` and `send` do",
        "cli/monitor/transmit_list.py": "what was agreed to there",
        "operations/frames/transmit_rows.py": "reads the mapping of a PDO by its name",
    },
    "pdo": {"operations/changes/change.py": "`pdo edit` shows its plan, and `undo` reverts it"},
    "sync": {"operations/pdos/produce_sync.py": "SYNC changes nothing that a node holds"},
    "verify": {"operations/pdos/look_at_frames.py": "the same, and the NMT state rolls back to what it was"},
}
#: what carries plans out by a method of the node, which imports do not show
_CARRIES_OUT = ("operations/changes/change.py", "change_result")
_ROOM = "cli/commands/"


def who_only_reads_sends_nothing(tree: SourceTree) -> Iterator[str]:
    """Nothing that sends is reached by name from a command whose effect is NONE."""
    uses = Uses(tree)
    for file in tree.house.files:
        name = file.removeprefix(_ROOM).removesuffix(".py")
        if file.startswith(_ROOM) and re.search(r"effect=Effect\.NONE\b", tree.house.files[file]):
            may = tuple(MAY_READ_AND_SEND.get(name, ()))
            reached = uses.reached((file, ALL), partial(_may_or_ends, may))
            for top in reached:
                if _sends(top) and not top[0].startswith(may):
                    yield f"{file} says it only reads, and asks for {_way(reached, top)}"


def _may_or_ends(may: tuple[str, ...], top: Top) -> bool:
    return top[0].startswith(may) or _is_end(top)


def _is_end(top: Top) -> bool:
    """Whether nothing more is to be found behind it: it sends, or is known to send nothing."""
    return _sends(top) or top[0] in ASKED_BY


def _sends(top: Top) -> bool:
    return is_sender(top) or top == _CARRIES_OUT


def _way(reached: dict[Top, Top | None], top: Top) -> str:
    steps = []
    one: Top | None = top
    while one is not None:
        steps.append(":".join(one))
        one = reached[one]
    return " < ".join(steps)
