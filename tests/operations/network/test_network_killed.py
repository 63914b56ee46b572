"""SIGKILL in the middle of `apply`: `recover` brings every node back, however far it had come.

Real processes: the nodes are served by one, dvtcli runs in another that is killed, and dvtcli's own reads see what is
left.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest

from tests.posix import SIGKILL
from tests.process import Ran, run
from tests.simulator.serve.killing import Killable, killable
from tests.simulator.serve.served import own_environment, state_folder

NODES = (1, 3)
FILE = """
a:
  node_id: 1
  tpdo:
    1: {cob_id: 0x6A1, mapping: [606C:00], event_timer: 30}
b:
  node_id: 3
  heartbeat_producer: 700
  rpdo:
    1: {cob_id: 0x6A1, enabled: true, mapping: [60FF:00]}
"""

pytestmark = [pytest.mark.long, pytest.mark.drawn(3, "killed networks")]


def is_download(frame: can.Message) -> bool:
    """Whether *frame* asks one of the nodes for an SDO download."""
    return frame.arbitration_id in (0x601, 0x603) and frame.data[0] >> 5 == 1


def is_save(frame: can.Message) -> bool:
    """Whether *frame* asks one of the nodes to store."""
    return frame.arbitration_id in (0x601, 0x603) and bytes(frame.data[1:4]) == b"\x10\x10\x01" and is_download(frame)


@pytest.fixture
def nodes(tmp_path: Path) -> Iterator[Killable]:
    with killable(tmp_path, "generic@1", "generic@3") as made:
        yield made


def held(nodes: Killable) -> list[object]:
    """Every PDO of both nodes, and a heartbeat time."""
    shown = [nodes.dvtcli("-n", str(node_id), "pdo", "--all", "--json") for node_id in NODES]
    shown.append(nodes.dvtcli("-n", "3", "read", "1017", "--json"))
    return [json.loads(one.stdout).get("pdos", one.stdout) for one in shown]


def killed(nodes: Killable, text: str, at: int, which: Callable[[can.Message], bool]) -> int:
    """Apply a file of *text* and kill that at the *at*-th of the frames that *which* tells; the exit code."""
    (nodes.folder / "net.yaml").write_text(text)
    return nodes.killed(["--yes", "apply", str(nodes.folder / "net.yaml")], at, which)


def as_printed(nodes: Killable, said: str, words: str, *more: str) -> Ran:
    """What the command between marks in *said* that ends with *words* does as it is printed, with *more* behind it."""
    (command,) = {found for found in re.findall(r"`dvtcli ([^`]+)`", said) if found.endswith(words)}
    return run([*shlex.split(command), *more], env=own_environment(nodes.folder))


def journals(nodes: Killable) -> list[Path]:
    return sorted((state_folder(nodes.folder) / "journals").glob("*"))


@pytest.mark.parametrize("kill_at", [1, 4, 8, 12])
def test_every_node_is_recovered(nodes: Killable, kill_at: int) -> None:
    before = held(nodes)
    assert killed(nodes, FILE, kill_at, is_download) == -SIGKILL
    refused = nodes.dvtcli("--yes", "apply", str(nodes.folder / "net.yaml"))
    assert refused.returncode == 6
    assert "recover" in refused.stderr
    next_line = " recover`, since a change of node"
    assert next_line in nodes.dvtcli("plan", str(nodes.folder / "net.yaml")).stdout
    (nodes.folder / "same.yaml").write_text("nodes: {a: {node_id: 1}}\n", "utf-8")
    same = nodes.dvtcli("diff", str(nodes.folder / "same.yaml"))
    assert (same.returncode, next_line in same.stdout) == (0, True)
    recovered = as_printed(nodes, refused.stderr, "-n 1 recover", "--yes")
    assert recovered.returncode == 0, recovered.stderr
    assert held(nodes) == before, "the change was one of both nodes"
    assert journals(nodes) == []
    assert nodes.dvtcli("--yes", "apply", str(nodes.folder / "net.yaml")).returncode == 0
    assert nodes.dvtcli("diff", str(nodes.folder / "net.yaml")).returncode == 0


def test_a_kill_while_nodes_store_is_said_and_goes_back_or_on(nodes: Killable) -> None:
    before = held(nodes)
    assert killed(nodes, "defaults: {store: true}\n" + FILE, 2, is_save) == -SIGKILL
    recovered = as_printed(nodes, nodes.dvtcli("recover").stderr, "recover --yes")
    assert recovered.returncode == 0, recovered.stderr
    assert "had started: node 1 stored the values that were rolled back; `dvtcli " in recovered.stderr
    assert "-n 1 store` accepts its present values" in recovered.stderr
    assert "had started: node 3 may have stored the values that were rolled back" in recovered.stderr
    assert "node 1 may have" not in recovered.stderr
    assert held(nodes) == before
    same = nodes.folder / "same.yaml"
    same.write_text("defaults: {store: true}\nnodes: {a: {node_id: 1}, b: {node_id: 3}}\n", "utf-8")
    assert "not stored yet: TPDO1" in nodes.dvtcli("plan", str(same)).stdout
    assert "Stored, as acknowledged by nodes 1 and 3" in nodes.dvtcli("--yes", "apply", str(same)).stdout
    assert "not stored yet" not in nodes.dvtcli("plan", str(same)).stdout
    assert nodes.dvtcli("nmt", "reset-node", "all", "--yes").returncode == 0
    assert held(nodes) == before


@pytest.mark.parametrize("kill_at", [2, 7])
def test_both_ends_of_a_link_are_recovered(nodes: Killable, kill_at: int) -> None:
    assert nodes.dvtcli("-n", "1", "map", "tpdo1", "6041", "606C").returncode == 0
    assert nodes.dvtcli("-n", "3", "map", "rpdo1", "60FF", "--off").returncode == 0
    line = ["link", "1:tpdo1", "3:rpdo1", "--heartbeat", "300"]
    before = held(nodes)
    assert nodes.killed(["--yes", *line], kill_at, is_download) == -SIGKILL
    assert nodes.dvtcli("recover", "--yes").returncode == 0
    assert held(nodes) == before
    assert journals(nodes) == []
    assert nodes.dvtcli("--yes", *line).returncode == 0
    again = nodes.dvtcli("--yes", *line, "--json")
    assert json.loads(again.stdout)["writes"] == 0


def test_stores_that_a_kill_cut_short_are_finished(nodes: Killable) -> None:
    assert killed(nodes, "defaults: {store: true}\n" + FILE, 2, is_save) == -SIGKILL
    planned = nodes.dvtcli("plan", str(nodes.folder / "net.yaml"))
    assert " apply /" not in planned.stdout.partition("Next: dvtcli ")[2]
    assert "recover --finish` stores on the rest of them, `" in planned.stderr
    assert "recover` rolls all its changes back" in planned.stderr
    asked = nodes.dvtcli("recover")
    assert asked.returncode == 6
    assert "stored: node 1; unknown: node 3" in asked.stderr
    assert "recover --finish --yes` continues" in asked.stderr
    assert "recover --yes` rolls back" in asked.stderr
    assert nodes.dvtcli("recover", "--finish", "--dry-run").returncode == 0
    assert len(journals(nodes)) == 3, "a dry run leaves them"
    finished = as_printed(nodes, asked.stderr, "recover --finish --yes")
    assert finished.returncode == 0, finished.stderr
    assert "is complete: node 3 stored" in finished.stdout
    assert journals(nodes) == []
    assert nodes.dvtcli("nmt", "reset-node", "all", "--yes").returncode == 0
    assert nodes.dvtcli("diff", str(nodes.folder / "net.yaml")).returncode == 0


def test_what_is_not_verified_any_more_is_not_stored(nodes: Killable) -> None:
    assert killed(nodes, "defaults: {store: true}\n" + FILE, 1, is_save) == -SIGKILL
    bus = nodes.attach()
    bus.send(can.Message(arbitration_id=0, data=[0x81, 3], is_extended_id=False))  # node 3 loses what it did not store
    finished = nodes.dvtcli("recover", "--finish", "--yes")
    assert finished.returncode == 6
    assert "the values of node 3 differ from those verified" in finished.stderr
    assert len(journals(nodes)) == 3


def test_where_not_every_node_was_verified_nothing_is_finished(nodes: Killable) -> None:
    assert killed(nodes, "defaults: {store: true}\n" + FILE, 4, is_download) == -SIGKILL
    assert nodes.dvtcli("recover", "--finish", "--yes").returncode == 2
    assert nodes.dvtcli("recover", "--yes").returncode == 0
