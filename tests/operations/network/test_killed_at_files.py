"""`apply` of three nodes with stores, ended before any file of its own is renamed or removed: one way for all of them.

Not at a frame, as elsewhere, but between two files: the journal of one node is there and that of the next is not yet,
or not any more. Whoever comes after finds every node as it was, or every node as the file says.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from dvtcli.operations.changes.recover_change import recover
from tests.faults.matrix import Snapshot
from tests.harness.sample import heavy, part
from tests.operations.network.bench import Chain, Heard
from tests.operations.network.killed import Watched, afterwards, in_own_process
from tests.operations.network.test_network_faults import OPERATIONAL, STEPS, storing
from tests.surroundings import HOMES

_listeners: list[Callable[[Path], None]] = []


def _received(event: str, arguments: tuple[Any, ...]) -> None:
    if event in ("os.rename", "os.remove") and _listeners:
        _listeners[-1](Path(os.fsdecode(arguments[0])))


@contextmanager
def at_files(below: Path, act: Callable[[int], None]) -> Iterator[list[str]]:
    """Call *act* with their number so far before a file *below* a folder is renamed or removed; their names."""
    names: list[str] = []

    def received(path: Path) -> None:
        if below not in path.parents:
            return
        names.append(path.name)
        _listeners.append(lambda _path: None)  # what *act* does with files is not meant
        try:
            act(len(names))
        finally:
            _listeners.pop()

    _listeners.append(received)
    try:
        yield names
    finally:
        _listeners.remove(received)


def listening(home: Path, act: Callable[[], None]) -> str:
    """What went wrong in *act*, in a process of its own: a hook stays in its process for good.

    While a line of it runs between two steps of `settrace`, no other thread can begin to be measured; so none is.
    """

    def with_a_hook() -> None:
        threading.settrace(None)  # type: ignore[arg-type]
        sys.settrace(None)
        sys.addaudithook(_received)
        act()

    return in_own_process(home.parent / "what went wrong", with_a_hook)


def network(home: Path, name: str, bus: type[Heard] = Heard) -> Chain:
    """The traction chain, whose files are in a folder of that *name*."""
    (home.parent / name).mkdir()
    home.mkdir(exist_ok=True)
    return Chain(home.parent / name, bus=bus)


def recovered(after: Chain, *ends: dict[int, Snapshot]) -> None:
    """Recover what waits; every node is as in one of *ends* then, and nothing waits any more."""
    with after.session(node=None) as session:
        recover(session)
    held = after.held()
    assert held in ends, [[held[node_id] == end[node_id] for node_id in held] for end in ends]
    if held == ends[0]:
        assert after.states() == OPERATIONAL
    assert after.plan().interrupted == ()


@pytest.mark.counted
def test_no_node_is_left_alone_wherever_apply_ends(home: Path, pytestconfig: pytest.Config) -> None:
    """Before as many of its files as `--kills` says."""
    assert listening(home, lambda: _wherever_apply_ends(home, pytestconfig)) == ""


def _wherever_apply_ends(home: Path, pytestconfig: pytest.Config) -> None:
    chain = network(home, "counted")
    with at_files(home.parent, lambda _number: None) as names:
        chain.apply(storing(chain.folder))
    most, done = len(names), chain.held()
    chain = network(home, "files")
    before, file = chain.held(), storing(chain.folder)
    chosen = part(range(1, most + 1), pytestconfig.getoption("--kills"), pytestconfig, "files")
    wrong: dict[int, str] = {}

    def look(after: Chain) -> None:
        recovered(after, before, done)
        after.apply(file)
        assert after.held() == done

    def at_file(number: int) -> None:
        if number in chosen and (failed := afterwards(chain, home, look)):
            wrong[number] = failed

    with at_files(home.parent, at_file) as names:
        chain.apply(file)
    assert wrong == {}
    assert len(names) == most


@pytest.mark.counted
def test_nor_wherever_the_recover_after_it_ends(home: Path, pytestconfig: pytest.Config) -> None:
    """`apply` ends at a write, one for three of `--kills`, then `recover` before each of its files."""
    assert listening(home, lambda: _wherever_recover_ends(home, pytestconfig)) == ""


def _wherever_recover_ends(home: Path, pytestconfig: pytest.Config) -> None:
    chain = network(home, "files", Watched)
    assert isinstance(chain.bus, Watched)
    before = chain.held()
    count = max(1, pytestconfig.getoption("--kills") // 3)
    chosen = part(range(1, len(STEPS) + 1), count, pytestconfig, "recover files")
    wrong: dict[int, str] = {}

    def look(after: Chain) -> None:
        own_home, failed = after.folder.parent / home.name, dict[int, str]()

        def at_file(number: int) -> None:
            if said := afterwards(after, own_home, lambda last: recovered(last, before)):
                failed[number] = said

        with at_files(own_home.parent, at_file) as names:
            recovered(after, before)
        assert names, "what waited was a file"
        assert failed == {}

    def on_write(number: int) -> None:
        if number in chosen and (failed := afterwards(chain, home, look)):
            wrong[number] = failed

    chain.bus.on_write = on_write
    chain.apply()
    assert wrong == {}


@heavy
def test_recover_finds_the_journals_of_another_folder(home: Path) -> None:
    """Killed with one `--journal`, recovered with another one: each node's lock notes where its journal is."""
    chain = network(home, "files", Watched)
    assert isinstance(chain.bus, Watched)
    before, failed = chain.held(), list[str]()

    def look(after: Chain) -> None:
        own = after.journals()
        assert len(own) == len(before)
        after.folder = home.parent / "another"
        recovered(after, before)
        assert not any(one.exists() for one in own)

    def on_write(number: int) -> None:
        if number == len(STEPS) // 2:
            failed.append(afterwards(chain, home, look))

    chain.bus.on_write = on_write
    chain.apply()
    assert failed == [""]


def test_recover_finds_all_that_it_needs_in_the_journals_folder(home: Path) -> None:
    """Killed with one state folder, recovered with another one and the same `--journal`: no lock notes anything."""
    chain = network(home, "files", Watched)
    assert isinstance(chain.bus, Watched)
    before, failed = chain.held(), list[str]()

    def look(after: Chain) -> None:
        for name in HOMES:
            os.environ[name] = str(home.parent / "elsewhere")
        recovered(after, before)
        assert after.journals() == []

    def on_write(number: int) -> None:
        if number == len(STEPS) // 2:
            failed.append(afterwards(chain, home, look))

    chain.bus.on_write = on_write
    chain.apply()
    assert failed == [""]
