"""`verify` says nothing of what was read before a restart: while it reads, or when it starts the node for a frame."""

from __future__ import annotations

from dvtcli.domain.nmt import NmtCommand
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire


class Restarting(StrictDevice):
    """A device that restarts once: after its answer for 0x1800:02 while *while_read*, or when it is started."""

    while_read = False
    when_started = False

    def upload(self, index: int, sub_index: int) -> bytes:
        data = super().upload(index, sub_index)
        if self.while_read and (index, sub_index) == (0x1800, 2):
            self.while_read = False
            self.nmt(NmtCommand.RESET_NODE)
        return data

    def nmt(self, command: int) -> None:
        if self.when_started and command == NmtCommand.START:
            self.when_started = False
            super().nmt(NmtCommand.RESET_NODE)
        super().nmt(command)


def restarting() -> Restarting:
    return Restarting(read_eds(family_eds("generic")).dictionary, load_family("generic"), 1)


def test_a_reset_while_it_reads() -> None:
    device = restarting()
    with Wire(device) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.run("set tpdo1 --sync 3").code == 0
        assert bench.run("verify").code == 0
        device.while_read = True
        ran = bench.run("verify")
        assert not device.while_read
        assert ran.code == 3, ran.stdout


def test_a_reset_when_it_starts_the_node_for_a_frame() -> None:
    device = restarting()
    with Wire(device) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.run("set tpdo1 --timer 20").code == 0
        device.when_started = True
        ran = bench.run("verify --frame")
        assert not device.when_started
        assert ran.code == 3, ran.stdout
