"""LSS with a slave that is not ours: durand's, beside a simulated node, in virtual time, so that none of it is late."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from dvtcli.domain.ports import Frame
from tests.cli.commands.bench import Bench
from tests.lss_nodes import unconfigured
from tests.virtual_time import VirtualTimeBus

durand = pytest.importorskip("durand", reason="durand, an LSS slave of others, is not installed: pip install '.[test]'")

ADDRESS = (0x2A, 0x1234, 0x10002, 0x89ABCDEF)
WORDS = "vendor=0x2A product=0x1234 revision=0x10002 serial=0x89ABCDEF"


class Network:
    """By what durand's nodes hear and speak, in durand's words."""

    def __init__(self, say: Callable[[Frame], None]) -> None:
        self._received_by: dict[int, Callable[[int, bytes], None]] = {}
        self._say = say

    def add_subscription(self, cob_id: int, callback: Callable[[int, bytes], None]) -> None:
        self._received_by[cob_id] = callback

    def remove_subscription(self, cob_id: int) -> None:
        del self._received_by[cob_id]

    def send(self, cob_id: int, msg: bytes) -> None:
        self._say(Frame(cob_id, bytes(msg)))

    def hear(self, frame: Frame) -> None:
        """Hand *frame* to the node."""
        if frame.can_id in self._received_by:
            self._received_by[frame.can_id](frame.can_id, frame.data)


class WithForeignNode(VirtualTimeBus):
    """A simulated node 3, and the *foreign* one without a node-ID, which hears what we send."""

    def __init__(self) -> None:
        from durand.scheduler import VirtualScheduler

        super().__init__([unconfigured(1, node_id=3)], simulated=False)
        durand.set_scheduler(VirtualScheduler())
        self.network = Network(self.nodes_said)
        self.foreign = durand.MinimalNode(self.network, 0xFF)
        for sub_index, number in enumerate(ADDRESS, 1):
            self.foreign.object_dictionary.write(0x1018, sub_index, number)
        #: the node-ID that it keeps without power
        self.kept = 0xFF
        self.foreign.lss.set_store_configuration_callback(self._keep)

    def _keep(self, _bit_rate: int | None, node_id: int) -> None:
        self.kept = node_id

    def _send(self, frame: Frame) -> None:
        super()._send(frame)
        self.network.hear(frame)


def test_a_foreign_slave_is_found_gets_its_node_id_and_keeps_it() -> None:
    bus = WithForeignNode()
    with Bench((), {"yes": True}, bus) as desk:
        scanned = desk.run("lss scan --json")
        (found,) = scanned.document["nodes"]
        assert tuple(found[part] for part in ("vendor_id", "product_code", "revision", "serial")) == ADDRESS
        assert (found["node"], found["confirmed"], bus.foreign.node_id) == (None, True, 0xFF)

        assert desk.run(f"lss node-id 5 {WORDS}").code == 0
        assert (bus.foreign.node_id, bus.kept) == (5, 0xFF)
        assert desk.run("lss select 5").code == 0
        stored = desk.run("lss store 5 --prove")
        assert (stored.code, "stored, proved by a reset" in stored.stdout, bus.kept) == (0, True, 5)

        assert [row["node"] for row in desk.run("scan --json").document["nodes"]] == [3, 5]
        assert desk.run("lss scan --json").document["without_node_id"] == 0


def test_a_foreign_slave_that_refuses_or_is_not_meant_is_left_as_it_is() -> None:
    bus = WithForeignNode()
    bus.foreign.lss.set_store_configuration_callback(None)
    with Bench((), {"yes": True}, bus) as desk:
        taken = desk.run(f"lss node-id 3 {WORDS}")
        assert (taken.code, "in use" in taken.stderr, bus.foreign.node_id) == (6, True, 0xFF)
        other = desk.run(f"lss node-id 5 {WORDS[:-1]}0")
        assert (other.code != 0, bus.foreign.node_id) == (True, 0xFF)
        assert desk.run(f"lss node-id 5 {WORDS}").code == 0
        refused = desk.run("lss store 5")
        assert (refused.code, "it cannot store its node-ID" in refused.stderr, bus.kept) == (1, True, 0xFF)
