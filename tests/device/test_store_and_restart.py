"""A store that ends in a restart is not waited for any longer than an answer of before it may take."""

from __future__ import annotations

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.cancellation import Cancellation
from dvtcli.device.nmt_gate import NodeAccess
from dvtcli.device.store.store_parameters import write_signature
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.objects import STORE_PARAMETERS
from dvtcli.domain.ports import Frame
from dvtcli.domain.profile import GENERIC
from dvtcli.errors import Interrupted, NoAnswer
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.laws.bench import NODE, DirectBus, DirectSdo, FaultySdo, booted, dictionary, interrupt_after, profile
from tests.virtual_time import VirtualTimeBus


@pytest.mark.parametrize(("fault", "longest_s"), [("reset@1=0.3", 2.0), ("lose-response@1", 21.0)])
def test_a_boot_up_ends_the_waiting(fault: str, longest_s: float) -> None:
    bus = VirtualTimeBus([booted()], faults=[Fault.parse(fault)])
    policy = profile("generic").store
    bus.send_nmt(NmtCommand.START, NODE)
    bus.sleep(1)  # its heartbeat says so
    before_s = bus.now_s()
    with pytest.raises(NoAnswer) as caught:
        write_signature(NodeAccess(bus, NODE, profile("generic")), policy, STORE_PARAMETERS, None, Cancellation())
    waited_s = bus.now_s() - before_s
    assert waited_s < longest_s
    assert (waited_s >= policy.timeout_s) is (fault != "reset@1=0.3"), "a slow store has its time"
    hint = {
        "reset@1=0.3": "it restarted instead: unstored values are lost; set them again, then `store`",
        "lose-response@1": "it may still be writing; wait, then `store` again",
    }
    assert (typed(caught.value.hint), caught.value.state) == (hint[fault], "unknown")
    assert bus.nodes[0].device.state is NmtState.OPERATIONAL, "as it was found"


def test_a_second_ctrl_c_leaves_the_store_to_the_device() -> None:
    device = booted()
    cancellation = Cancellation()
    cancellation.exit_code = 143
    faulty = FaultySdo(DirectSdo(device), interrupt_after, 1)
    with pytest.raises(Interrupted) as caught:
        write_signature(
            NodeAccess(DirectBus(device, faulty), NODE, GENERIC), GENERIC.store, STORE_PARAMETERS, None, cancellation
        )
    assert (caught.value.exit_code, caught.value.state) == (143, "unknown")
    assert typed(caught.value.hint) == "it may still be writing its memory: leave it powered, then `store` again"


class Starting(StrictDevice):
    """A device whose boot-up of before goes out as it takes a store."""

    bus: VirtualTimeBus

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        super().download(index, sub_index, data)
        self.bus.nodes_said(Frame(0x700 + NODE, b"\0"))


def test_an_answer_that_comes_soon_after_a_boot_up_counts() -> None:
    device = Starting(dictionary("generic"), load_family("generic"), NODE)
    device.boot_up()
    device.bus = VirtualTimeBus([device], faults=[Fault.parse("late@1=0.4")])
    signed = write_signature(
        NodeAccess(device.bus, NODE, profile("generic")),
        profile("generic").store,
        STORE_PARAMETERS,
        None,
        Cancellation(),
    )
    assert 0.4 <= signed.seconds < 1.0
