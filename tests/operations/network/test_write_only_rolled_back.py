"""Write-only values of a network file after a fault: nobody says that they are as they were."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.cli.commands.bench import Bench, beside
from tests.small_eds import U8, U16, plain, var

#: a readable value on node 5, a write-only value on node 6; and both on node 6
FILE = """a:
  node_id: 5
  dcf: device.eds
  sdo:
    - {object: "2051:00", value: 7}
b:
  node_id: 6
  dcf: device.eds
  sdo:
    - {object: "2050:00", value: 1}
"""
BOTH = FILE + '    - {object: "2051:00", value: 8}\n'
#: what a device refuses for a reason of its own
REFUSED = "refuse@1=0x06060000"


@pytest.fixture(autouse=True)
def device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An EDS with a write-only object."""
    monkeypatch.chdir(tmp_path)
    eds = plain()
    eds.variable(0x2050, var("Trim", U8, None, "wo"))
    eds.variable(0x2051, var("Limit", U16, 0))
    Path("device.eds").write_text(eds.text())


def bench(*faults: str) -> Bench:
    """Nodes 5 and 6 on a bus of others, so that changes are remembered and journals kept."""
    dictionary = read_eds(Path("device.eds")).dictionary
    devices = [StrictDevice(dictionary, load_family("generic"), node_id) for node_id in (5, 6)]
    return Bench((), {"yes": True}, beside(devices, *faults))


def trim(bench: Bench) -> bytes:
    """The write-only value of node 6, as the device holds it."""
    (node,) = [node for node in bench.session.bus.nodes if node.device.node_id == 6]
    return node.device._memory.read(0x2050, 0)


def limits(bench: Bench) -> list[bytes]:
    return [bench.session.node(node_id).sdo.upload(0x2051, 0) for node_id in (5, 6)]


@pytest.mark.parametrize("file", [FILE, BOTH])
def test_what_was_acknowledged_is_left_changed(file: str) -> None:
    Path("net.yaml").write_text(file)
    with bench(f"5:{REFUSED}") as network:
        ran = network.run("apply net.yaml")
        assert (ran.code, trim(network), limits(network)) == (7, b"\x01", [bytes(2)] * 2), ran
        assert "LEFT CHANGED: 2050:00 of node 6" in ran.stderr
        assert "every node is unchanged" not in ran.stderr
        assert "2050:00 of node 6 is as it was" not in ran.stderr
        assert "set it by hand: its old value is unknown" in ran.stderr
        assert "node 5: as before, read back equal" in ran.stderr


@pytest.mark.parametrize("file", [FILE, BOTH])
def test_neither_undo_nor_recover_calls_it_equal(file: str) -> None:
    Path("net.yaml").write_text(file)
    with bench(f"5:{REFUSED}") as network:
        assert network.run("apply net.yaml").code == 7
        undone = network.run("undo --all")
        undone.failed(2, "nothing to undo")
        recovered = network.run("recover --json")
        found = recovered.document
        assert (recovered.code, found["verified"], found["readable"]) == (0, False, False), recovered
        assert "nothing to recover" in network.run("recover").stdout
        assert (trim(network), limits(network)) == (b"\x01", [bytes(2)] * 2)


def test_recover_names_what_stays() -> None:
    Path("net.yaml").write_text(BOTH)
    with bench(f"5:{REFUSED}") as network:
        assert network.run("apply net.yaml").code == 7
        ran = network.run("recover")
        assert "2050:00 of node 6 NOT rolled back: the earlier values are not known" in ran.stdout, ran
        assert "equal" not in ran.stdout


@pytest.mark.parametrize(
    ("file", "said"),
    [
        (FILE, "`undo` cannot revert 2050:00 (write-only)."),
        (BOTH, "`undo` cannot revert 2050:00 (write-only), `undo --all` reverts the rest."),
    ],
)
def test_an_apply_says_what_undo_reverts_and_undo_reverts_that(file: str, said: str) -> None:
    Path("net.yaml").write_text(file)
    with bench() as network:
        ran = network.run("apply net.yaml")
        assert "In RAM only on node 5: `store` keeps it, `undo --all` reverts it." in ran.stdout, ran
        assert f"In RAM only on node 6: `store` keeps it, {said}" in ran.stdout
        undone = network.run("undo --all")
        assert (undone.code, trim(network), limits(network)) == (0, b"\x01", [bytes(2)] * 2), undone
        assert "2050:00 of node 6 NOT rolled back: the earlier values are not known" in undone.stdout


def test_an_undo_of_write_only_values_alone_is_refused() -> None:
    Path("net.yaml").write_text(FILE.replace("2051", "2050"))
    with bench() as network:
        assert network.run("apply net.yaml").code == 0
        undone = network.run("undo --all")
        undone.failed(2, "is write-only: its old value is not known")


@pytest.mark.parametrize("file", [FILE, BOTH])
def test_what_was_refused_is_not_said_to_be_read(file: str) -> None:
    Path("net.yaml").write_text(file)
    with bench(f"6:{REFUSED}") as network:
        ran = network.run("apply net.yaml")
        assert (ran.code, trim(network), limits(network)) == (1, bytes(1), [bytes(2)] * 2), ran
        nodes = "nodes 5 and 6" if file == BOTH else "node 5"
        assert f"rolled back: the changes are reverted on {nodes}, read back equal" in ran.stderr
        assert "2050:00 of node 6 was refused, but its value cannot be read" in ran.stderr


@pytest.mark.parametrize(("fault", "held"), [("lose-response@1", b"\x01"), ("silent@1", b"\0")])
def test_without_an_answer_nobody_knows_whether_it_was_written(fault: str, held: bytes) -> None:
    Path("net.yaml").write_text(FILE)
    with bench(f"6:{fault}") as network:
        ran = network.run("apply net.yaml")
        assert (ran.code, trim(network)) == (5, held), ran
        assert "state   unknown: the changes are reverted on node 5, read back equal" in ran.stderr
        assert "2050:00 of node 6 cannot be read: it may have been written" in ran.stderr
