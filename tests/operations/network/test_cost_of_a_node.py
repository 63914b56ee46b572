"""What one more node costs does not grow with their number: in calls of functions, which no machine makes slower.

The bus among it: who waits for an answer is told of it, and only nodes that a frame concerns hear it.
"""

from __future__ import annotations

import re
import sys
import threading
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import CodeType, FrameType
from typing import TypeVar

import pytest

from dvtcli.device.change import lock, private_file
from dvtcli.device.change.journal import JournalFolder
from tests.operations.network.test_many_nodes import many

pytestmark = pytest.mark.drawn(1, "cost of a node")

T = TypeVar("T")
FEW, MANY = 2, 6
#: how many more calls of one function a node may cost where there are many, of some 90,000 in all: what looks at every
#: other node's PDOs would be more
MOST_GROWN = 40
#: what compiles a pattern: once in a process, whenever it is first used
_COMPILER = str(Path(re.__file__).parent)


def calls(work: Callable[[], T]) -> Counter[CodeType]:
    """The functions that *work* calls, in whatever thread, and how often."""
    counted: Counter[CodeType] = Counter()

    def count(frame: FrameType, event: str, _argument: object) -> None:
        if event == "call" and not frame.f_code.co_filename.startswith(_COMPILER):
            counted[frame.f_code] += 1

    threading.setprofile(count)
    sys.setprofile(count)
    try:
        work()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return counted


def costs(folder: Path, count: int) -> dict[str, Counter[CodeType]]:
    """The calls of a plan, and of its `apply`, for *count* nodes."""
    folder.mkdir()
    chain, file = many(folder, count)
    file.write_text(f"# {folder}\n{file.read_text('utf-8')}", "utf-8")  # a text that nobody in this process has read
    return {"plan": calls(lambda: chain.plan(file)), "apply": calls(lambda: chain.apply(file))}


def test_nodes_cost_the_same_however_many_there_are(tmp_path: Path) -> None:
    few, many_ = costs(tmp_path / "few", FEW), costs(tmp_path / "many", MANY)
    for what, counted in many_.items():
        grown = {code: number / MANY - few[what][code] / FEW for code, number in counted.items()}
        worst = sorted(((round(by), code.co_qualname, code.co_filename) for code, by in grown.items()), reverse=True)
        assert worst[0][0] <= MOST_GROWN, (what, worst[:3])
        assert counted.total() / MANY <= few[what].total() / FEW, (what, worst[:3])


def test_a_store_writes_no_more_journals_where_there_are_many(tmp_path: Path) -> None:
    written = {}
    for count in (FEW, MANY):
        (folder := tmp_path / str(count)).mkdir()
        chain, file = many(folder, count, store=True)
        counted = calls(partial(chain.apply, file))
        written[count] = sum(number for code, number in counted.items() if code is JournalFolder.write.__code__) / count
    assert written[MANY] <= written[FEW] + 0.5, written


def test_a_change_has_one_journal_a_node_for_all_its_parts(tmp_path: Path) -> None:
    chain, file = many(tmp_path, FEW)
    counted = calls(partial(chain.apply, file))
    assert sum(number for code, number in counted.items() if code is JournalFolder.write.__code__) == FEW
    synced = {code.co_qualname: number for code, number in counted.items() if code.co_filename == private_file.__file__}
    assert synced["to_disk"] + synced["sync_folder"] <= 11 * FEW + 3  # one of them is the number of the change


def test_a_lock_says_once_which_journal_is_in_hand(tmp_path: Path) -> None:
    chain, file = many(tmp_path, FEW)
    counted = calls(partial(chain.apply, file))
    written = {code.co_qualname: number / FEW for code, number in counted.items() if code.co_filename == lock.__file__}
    assert written["_write_over"] <= 3, "when it is taken, when a change begins, and when it ends"
