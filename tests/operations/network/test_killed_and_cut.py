"""SIGKILL, or a bus that is gone, at any request of a command that writes: before, after, or a journal for `recover`.

Real processes: the nodes are served by one, dvtcli runs in another that ends or loses its connection, others look.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import can
import pytest

from tests.operations.network.test_network_killed import journals
from tests.posix import SIGKILL
from tests.process import documents
from tests.simulator.serve.killing import Killable, killable
from tests.small_eds import plain, var

#: two drives, and a manager that downloads to others
DRIVES, MANAGER = ("generic@1", "generic@3"), 12
NET = """
defaults: {store: true}
a:
  node_id: 1
  tpdo: {1: {mapping: [606C:00], event_timer: 30}}
b:
  node_id: 3
  heartbeat_producer: 700
"""
SETTINGS = (
    ("-n", "1", "map", "tpdo1", "606C", "--timer", "30"),
    ("-n", "1", "set", "tpdo2", "--timer", "70", "--type", "255"),
    ("-n", "1", "write", "1017", "300"),
)


@dataclass(frozen=True)
class Work:
    """A command: its *words*, about how many requests it sends, what is done ahead, and the file that it writes."""

    words: tuple[str, ...]
    requests: int
    ahead: Callable[[Killable], None] = lambda _nodes: None
    makes: str = ""


def line(nodes: Killable, *words: str) -> None:
    ran = nodes.dvtcli("--yes", *words)
    assert ran.returncode == 0, ran


def kept(nodes: Killable, file: str) -> None:
    """What node 1 holds once it was set is in *file*, and it holds what it held before again."""
    for words in SETTINGS:
        line(nodes, *words)
    line(nodes, "-n", "1", "backup", str(nodes.folder / file))
    line(nodes, "undo", "--all")


def managed(nodes: Killable) -> None:
    """The manager downloads to node 1."""
    (nodes.folder / "one.yaml").write_text("a:\n  node_id: 1\n  tpdo: {1: {event_timer: 30}}\n")
    line(nodes, "apply", str(nodes.folder / "one.yaml"), "--to-manager", str(MANAGER))


#: the words stand for files of the test's own folder where they have a suffix
WORKS = {
    "apply --prove": Work(("apply", "--prove", "net.yaml"), 570),
    "apply x.dcf": Work(("-n", "1", "apply", "x.dcf"), 200, lambda nodes: kept(nodes, "x.dcf")),
    "clone": Work(("-n", "3", "clone", "x.jsonl"), 240, lambda nodes: kept(nodes, "x.jsonl")),
    "backup": Work(("-n", "1", "backup", "new.dcf"), 205, makes="new.dcf"),
    "import --from-manager": Work(("import", "new.yaml", "--from-manager", str(MANAGER)), 19, managed, "new.yaml"),
}


@pytest.fixture
def nodes(tmp_path: Path) -> Iterator[Killable]:
    manager = plain()
    manager.record(0x1F22, "Concise DCF", {sub: var(f"Node {sub}", 0xF) for sub in range(1, 4)})
    (tmp_path / "manager.eds").write_text(manager.text(), "utf-8")
    (tmp_path / "net.yaml").write_text(NET)
    with killable(tmp_path, *DRIVES, f"{tmp_path / 'manager.eds'}@{MANAGER}") as made:
        yield made


def words_of(nodes: Killable, work: Work) -> list[str]:
    return ["--yes", *(str(nodes.folder / word) if "." in word else word for word in work.words)]


def held(nodes: Killable) -> list[object]:
    """The PDOs and heartbeat times of both drives, and what the manager downloads."""
    lines = [f"{node_id}:{what}" for node_id in (1, 3) for what in ("1017",)]
    shown = [nodes.dvtcli("-n", node_id, "pdo", "--all", "--json") for node_id in ("1", "3")]
    shown += [nodes.dvtcli("read", one, "--json") for one in lines]
    shown.append(nodes.dvtcli("-n", str(MANAGER), "read", "1F22:1", "--json"))
    found = [json.loads(one.stdout) for one in shown]
    return [one.get("pdos", one.get("raw")) for one in found]


def is_request(frame: can.Message) -> bool:
    return 0x600 < frame.arbitration_id < 0x680


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Ends spread over the requests of each command, as many as `--kills` says."""
    if "end_at" in metafunc.fixturenames:
        count = metafunc.config.getoption("--kills")
        ends = [
            (name, 1 + (number * 2 + 1) * work.requests // (2 * count))
            for name, work in WORKS.items()
            for number in range(count)
        ]
        metafunc.parametrize(("name", "end_at"), ends)


def recovered(nodes: Killable) -> None:
    ran = nodes.dvtcli("recover", "--yes")
    assert ran.returncode == 0, ran
    assert journals(nodes) == []


def whole(nodes: Killable, work: Work) -> bool:
    """Whether the file that is made is there; it is whole then."""
    path = nodes.folder / work.makes
    if not work.makes or not path.exists():
        return False
    assert path.stat().st_size > 0
    check = ("compare", str(path)) if path.suffix == ".dcf" else ("check", str(path))
    ran = nodes.dvtcli("-n", "1", *check)
    assert ran.returncode in (0, 3), ran
    return True


@pytest.mark.drawn(5, "ends of commands")
def test_wherever_it_is_killed(nodes: Killable, name: str, end_at: int) -> None:
    work = WORKS[name]
    work.ahead(nodes)
    before = held(nodes)
    code = nodes.killed(words_of(nodes, work), end_at, is_request)
    assert code in (-SIGKILL, 0), (nodes.said, nodes.complaints)
    whole(nodes, work)
    if journals(nodes):
        recovered(nodes)
        assert held(nodes) == before
    now = held(nodes)
    again = nodes.dvtcli(*words_of(nodes, work))
    assert again.returncode == 0, again
    assert now in (before, held(nodes))
    if code == 0:
        assert now == held(nodes)


@pytest.mark.drawn(5, "ends of commands")
def test_wherever_it_loses_the_bus(nodes: Killable, name: str, end_at: int) -> None:
    work = WORKS[name]
    work.ahead(nodes)
    before = held(nodes)
    words = words_of(nodes, work)
    code = nodes.cut_off(["--json", *words], end_at, is_request)
    if code == 0:
        assert nodes.dvtcli(*words).returncode == 0
        return
    error = next(one for one in documents(nodes.said) if one["schema"] == "dvtcli.error/1")
    assert (error["exit_code"], code) == (code, 7 if error["state"] == "left_changed" else 5), error
    assert error["state"] != "unknown" or "--prove" in words, error
    if error["state"] in ("unchanged", "rolled_back"):
        assert (held(nodes), journals(nodes)) == (before, [])
    if code == 7:
        assert journals(nodes), error
        assert error["hint"].startswith("restore the bus first"), error
    if journals(nodes):
        recovered(nodes)
        assert held(nodes) == before
