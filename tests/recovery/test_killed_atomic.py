"""SIGKILL in the middle of `run --atomic`: `recover` takes every line back, of every node, however far it had come.

Real processes: the nodes are served by one, dvtcli runs in another that is killed, and canopen reads what is left.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import can
import canopen
import pytest

from tests.harness.sample import heavy
from tests.posix import SIGKILL
from tests.simulator.serve.killing import Killable, killable
from tests.simulator.serve.served import state_folder

NODES = (1, 3)
#: both nodes, one PDO twice, an object of its own, a swap of CAN-IDs, and a mapping entry behind the count
LINES = (
    "map 1:tpdo1 606C --cob-id 0x6A1",
    "map 3:tpdo2 6041 606C --cob-id 0x6A2 --timer 40",
    "set 1:tpdo1 --timer 70",
    "write 1017 700",
    "set 3:tpdo2 --off --cob-id 0x6A3",
    "set 3:tpdo1 --cob-id 0x6A2",
    "clear 1:tpdo2",
    "write 1A01:1 0x606C0020",
)

pytestmark = pytest.mark.long
#: how many SDO downloads they take, at least
STEPS = 22
#: what a script does after its last change
AFTERWARDS = ["read 1009"]


def held(nodes: Killable) -> dict[int, dict[tuple[int, int], bytes]]:
    """What the nodes hold of their first TPDOs and of their heartbeat time, by canopen."""
    bus = nodes.attach()
    network = canopen.Network(bus=bus)
    network.notifier = can.Notifier(bus, network.listeners, 0.1)
    try:
        return {node_id: _held(network.add_node(node_id, canopen.ObjectDictionary())) for node_id in NODES}
    finally:
        network.notifier.stop()


def _held(node: canopen.RemoteNode) -> dict[tuple[int, int], bytes]:
    node.sdo.RESPONSE_TIMEOUT = 10
    places = [(0x1800 + pdo, sub) for pdo in range(3) for sub in (1, 2, 3, 5)] + [(0x1017, 0), (0x1A01, 1)]
    for index in (0x1A00, 0x1A01, 0x1A02):
        places += [(index, sub) for sub in range(node.sdo.upload(index, 0)[0] + 1)]
    return {place: node.sdo.upload(*place) for place in places}


def is_download(frame: can.Message) -> bool:
    """Whether *frame* asks one of the nodes for an SDO download."""
    return frame.arbitration_id in (0x601, 0x603) and frame.data[0] >> 5 == 1


def is_upload_of(index: int) -> Callable[[can.Message], bool]:
    """What tells the requests for an upload of the object at *index*."""
    head = bytes([0x40, index & 0xFF, index >> 8])
    return lambda frame: frame.arbitration_id in (0x601, 0x603) and bytes(frame.data[:3]) == head


def killed(
    nodes: Killable,
    lines: Sequence[str],
    at: int,
    which: Callable[[can.Message], bool] = is_download,
    words: Sequence[str] = ("--atomic",),
) -> int:
    """Run *lines* and kill that at the *at*-th of the frames that *which* tells; the exit code."""
    script = nodes.folder / "x.dvt"
    script.write_text("\n".join(lines))
    return nodes.killed(["-n", "1", "--yes", "run", str(script), *words], at, which)


def waiting(nodes: Killable) -> list[int]:
    """Node-IDs of the journals that wait."""
    folder = state_folder(nodes.folder) / "journals"
    ids = sorted(int(path.stem.rpartition("-")[2]) for path in folder.glob("*.json"))
    if not ids:
        assert not list(folder.glob("*")), "nothing else is left there either"
    return ids


@pytest.fixture
def nodes(tmp_path: Path) -> Iterator[Killable]:
    with killable(tmp_path, "generic@1", "generic@3") as made:
        yield made


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Kills spread over the steps of the script, as many as `--kills` says."""
    if "kill_at" in metafunc.fixturenames:
        count = metafunc.config.getoption("--kills")
        metafunc.parametrize("kill_at", sorted({1 + number * STEPS // count for number in range(count)}))


@pytest.mark.counted
def test_every_line_of_every_node_is_recovered(nodes: Killable, kill_at: int) -> None:
    before = held(nodes)
    assert killed(nodes, [*LINES, *AFTERWARDS], kill_at) == -SIGKILL
    left, ids = held(nodes), waiting(nodes)
    assert left != before
    assert ids == [node_id for node_id in NODES if left[node_id] != before[node_id]]
    recovered = nodes.dvtcli("recover", "--yes", "--json")
    assert recovered.returncode == 0, recovered.stderr
    document = json.loads(recovered.stdout)
    assert [one["node"] for one in document.get("nodes", [document])] == ids
    assert document["verified"] is True
    assert held(nodes) == before
    assert waiting(nodes) == []
    assert nodes.dvtcli("undo").returncode == 2, "what was rolled back is not remembered as a change"


def test_a_kill_between_two_lines_is_said_and_recovered_from_either_node(nodes: Killable) -> None:
    before = held(nodes)
    lines = [*LINES[:3], "read 1009", LINES[4]]
    assert killed(nodes, lines, 1, is_upload_of(0x1009)) == -SIGKILL
    assert waiting(nodes) == [1, 3]
    script = nodes.folder / "x.dvt"
    for node_id in NODES:
        refused = nodes.dvtcli("-n", str(node_id), "set", "tpdo3", "--timer", "9")
        assert refused.returncode == 6
        assert f"{script} was interrupted, which changed" in refused.stderr
        assert "recover` rolls all its changes back, on all nodes" in refused.stderr
    both = nodes.dvtcli("-n", "1,3", "read", "1000").stderr
    assert both.count("was interrupted, which changed nodes 1 and 3: `dvtcli ") == both.count("interrupted") == 1
    tried = nodes.dvtcli("-n", "3", "recover", "--dry-run", "--json")
    assert (tried.returncode, json.loads(tried.stdout)["dry_run"]) == (0, True)
    assert waiting(nodes) == [1, 3]
    recovered = nodes.dvtcli("-n", "3", "recover", "--yes")
    assert recovered.returncode == 0, recovered.stderr
    assert f"{script} was interrupted: all its changes are to be rolled back, on nodes 1 and 3" in recovered.stderr
    assert "which changed" not in recovered.stderr, "recover does not say that recover is needed"
    assert all(f"of node {node_id} rolled back" in recovered.stdout for node_id in NODES)
    assert held(nodes) == before
    assert waiting(nodes) == []


@heavy
def test_a_script_that_is_complete_leaves_nothing_to_recover(nodes: Killable) -> None:
    before = held(nodes)
    done = nodes.dvtcli("-n", "1", "run", "-", "--atomic", stdin="\n".join(LINES))
    assert done.returncode == 0, done.stderr
    after = held(nodes)
    assert after != before
    assert waiting(nodes) == []
    failing = "\n".join(["set 1:tpdo3 --timer 5", "set 3:tpdo3 --timer 5", "read 5FFF"])
    assert nodes.dvtcli("-n", "1", "run", "-", "--atomic", stdin=failing).returncode == 1
    assert held(nodes) == after
    assert waiting(nodes) == [], "what was rolled back leaves nothing to recover either"
    assert nodes.dvtcli("-n", "1", "set", "tpdo1", "--timer", "6").returncode == 0


def test_a_kill_while_it_stores_says_that_it_may_be_stored(nodes: Killable) -> None:
    before = held(nodes)
    lines = [*LINES[:2], "store", *AFTERWARDS]
    assert killed(nodes, lines, 1, is_upload_of(0x1010)) == -SIGKILL
    assert waiting(nodes) == [1, 3]
    recovered = nodes.dvtcli("recover", "--yes")
    assert recovered.returncode == 0, recovered.stderr
    assert "x.dvt:3 store had started: node 1 may have stored the values that were rolled back" in recovered.stderr
    assert held(nodes) == before
    assert killed(nodes, lines, 1, is_upload_of(0x1009)) == -SIGKILL
    assert nodes.dvtcli("recover", "--yes").stdout.startswith("nothing to recover"), (
        "what is stored cannot be rolled back"
    )
    assert held(nodes) != before


def test_what_a_kill_leaves_of_the_journals_of_a_complete_script_counts_no_longer(nodes: Killable) -> None:
    """Journals are removed one by one: their end is a single step all the same."""
    lines = [*LINES[:3], *AFTERWARDS]
    assert killed(nodes, lines, 1, is_upload_of(0x1009)) == -SIGKILL
    assert waiting(nodes) == [1, 3]
    (marker,) = (state_folder(nodes.folder) / "journals").glob("*.whole")
    marker.unlink()
    held_now = held(nodes)
    recovered = nodes.dvtcli("recover", "--yes", "--json")
    assert (recovered.returncode, json.loads(recovered.stdout)["recovered"]) == (0, False)
    assert held(nodes) == held_now
    assert nodes.dvtcli("-n", "3", "set", "tpdo3", "--timer", "9").returncode == 0


def test_a_script_that_is_not_atomic_leaves_the_line_in_hand_alone(nodes: Killable) -> None:
    before = held(nodes)
    assert killed(nodes, ["set 1:tpdo3 --timer 9", LINES[1]], 4, words=()) == -SIGKILL
    assert waiting(nodes) == [3]
    assert nodes.dvtcli("recover", "--yes").returncode == 0
    after = held(nodes)
    assert after[3] == before[3]
    assert after[1] != before[1]
    assert nodes.dvtcli("-n", "1", "undo").returncode == 0, "the line that was complete is remembered"
    assert held(nodes) == before
