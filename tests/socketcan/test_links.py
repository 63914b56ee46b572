"""What is said of links that are down, gone, off, at another bit rate, or not named; and of one set down in use."""

from __future__ import annotations

import re
import subprocess
import threading
from collections.abc import Callable

import pytest

from dvtcli.bus.discover import links
from dvtcli.bus.kernel_links import KernelLink, kernel_link, kernel_links
from dvtcli.bus.opening import open_bus
from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.ports import Frame
from dvtcli.errors import BusUnavailable
from tests.bus.devices import device
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import device as family_device
from tests.process import PATIENCE_S
from tests.socketcan.conftest import ANSWER_S, PAIRS, ip, on, tool


def test_the_kernel_describes_its_links() -> None:
    ip("set", "can1", "down")
    ip("set", "can1", "type", "can", "bitrate", "250000")
    found = {link.name: link for link in kernel_links()}
    assert found["can0"] == KernelLink("can0", "can", up=True, bit_rate=500_000)
    assert found["can1"] == KernelLink("can1", "can", up=False, bit_rate=250_000)
    assert found["vcan0"] == KernelLink("vcan0", "vcan", up=True)
    assert found["vxcan1"] == KernelLink("vxcan1", "vxcan", up=True)
    assert "lo" not in found


@pytest.mark.parametrize(("link", "rest"), [("can1", ""), ("vcan0", ""), ("vxcan1", "")])
def test_a_link_that_is_down_is_not_opened_and_its_command_works(link: str, rest: str) -> None:
    ip("set", link, "down")
    with pytest.raises(BusUnavailable) as caught:
        open_bus("socketcan", link)
    hint = typed(caught.value.hint)
    assert (str(caught.value.why), hint) == ("it is down", f"sudo ip link set {link} up{rest}")
    assert next(one for one in links() if one.channel == link).problem == f"it is down: {hint}"
    subprocess.run(hint.removeprefix("sudo ").split(), check=True)
    open_bus("socketcan", link).close()


def test_without_a_channel_all_of_them_are_named() -> None:
    with pytest.raises(BusUnavailable) as caught:
        open_bus("socketcan")
    for words in ("-c can0 (up, 500 kbit/s)", "-c vcan0 (up)", "-c vxcan1 (up)"):
        assert words in typed(caught.value.hint)
    with pytest.raises(BusUnavailable) as caught:
        open_bus("socketcan", "can7")
    assert "no such channel" in typed(caught.value.hint)


def test_the_bit_rate_is_the_links() -> None:
    bus = open_bus("socketcan", "can0", 250_000)
    assert bus.bitrate == 500_000
    (told,) = bus.disturbances()
    assert "can0 runs at 500 kbit/s, not at 250 kbit/s" in told
    command = told.rpartition(": ")[2].replace("sudo ", "")
    bus.close()
    subprocess.run(command, shell=True, check=True)  # noqa: S602 - our own words
    bus = open_bus("socketcan", "can0", 250_000)
    assert (bus.bitrate, bus.disturbances()) == (250_000, [])
    bus.close()
    link = kernel_link("can0")
    assert link is not None
    subprocess.run(link.way_to(500_000).replace("sudo ", ""), shell=True, check=True)  # noqa: S602


def test_a_controller_that_is_not_bus_off_is_not_restarted() -> None:
    """The emulated ones never are: what is said of one that is has its test without a controller."""
    link = kernel_link("can0")
    assert link is not None
    assert not link.bus_off
    with pytest.raises(subprocess.CalledProcessError):
        ip("set", "can0", "type", "can", "restart")


def test_two_controllers_on_one_wire() -> None:
    with on("can1", device(1)):
        bus = open_bus("socketcan", "can0", timeout_s=ANSWER_S)
        assert bus.sdo(1).upload(0x1000, 0) == device(1).upload(0x1000, 0)
        assert bus.disturbances() == []
        bus.close()


def test_a_link_set_down_in_use_is_told_with_the_command() -> None:
    bus = open_bus("socketcan", "vcan0")
    threading.Timer(0.2, ip, ("set", "vcan0", "down")).start()
    with pytest.raises(BusUnavailable) as caught:
        list(bus.receive(PATIENCE_S))
    assert typed(caught.value.hint) == "it is down: sudo ip link set vcan0 up"
    with pytest.raises(BusUnavailable) as caught:
        bus.send(Frame(0x080, b""))
    assert typed(caught.value.hint) == "it is down: sudo ip link set vcan0 up"
    bus.close()


def test_a_link_that_is_gone_is_told_so() -> None:
    ip("add", "vcan7", "type", "vcan")
    ip("set", "vcan7", "up")
    bus = open_bus("socketcan", "vcan7")
    threading.Timer(0.2, ip, ("del", "vcan7")).start()
    with pytest.raises(BusUnavailable) as caught:
        list(bus.receive(PATIENCE_S))
    assert "vcan7 is gone" in typed(caught.value.hint)
    bus.close()


def tc(*words: str) -> None:
    """Change what a link makes of the frames that it is to send."""
    subprocess.run(["tc", "qdisc", *words], check=True, capture_output=True)


def after_downloads(count: int, act: Callable[[], None]) -> Callable[[Frame, bool], None]:
    """A tap that does *act* when as many SDO downloads were sent."""
    sent = 0

    def tap(frame: Frame, ours: bool) -> None:
        nonlocal sent
        sent += ours and 0x601 <= frame.can_id <= 0x67F and frame.data[0] >> 5 == 1
        if ours and sent == count:
            sent += 1
            act()

    return tap


def test_a_controller_that_goes_bus_off_in_the_middle_of_a_change_is_told_and_recover_finishes_it() -> None:
    """As the kernel does it: what is sent gets nowhere, an error frame says so, another one tells the restart."""
    options = {"interface": "socketcan", "channel": "vxcan0", "node": 1, "timeout": 0.5}

    def goes_off() -> None:
        tc("add", "dev", "vxcan0", "root", "netem", "loss", "100%")
        tool("cansend", "vxcan1", "20000040#0000000000000000")

    with on("vxcan1", family_device("gen4")), Bench((), options) as bench:
        before = bench.run("pdo tpdo1 --json").document
        stop = bench.session.wire.tap(after_downloads(2, goes_off))
        try:
            ran = bench.run("map tpdo1 6041 606C/32 --sync 1")
        finally:
            stop()
            tc("del", "dev", "vxcan0", "root")
        assert ran.code == 7, ran.stderr
        assert "the CAN controller went bus-off" in ran.stderr
        assert "link set CHANNEL type can restart" in ran.stderr
        tool("cansend", "vxcan1", "20000100#0000000000000000")
        ran = bench.run("recover --yes")
        assert ran.code == 0, ran.stderr
        assert "was bus-off and is restarted" in ran.stderr
        assert bench.run("pdo tpdo1 --json").document == before


@pytest.mark.parametrize(("ours", "theirs"), PAIRS[1:])
def test_a_link_set_down_in_the_middle_of_a_change_leaves_a_journal_and_recover_finishes_it(
    ours: str, theirs: str
) -> None:
    options = {"interface": "socketcan", "channel": ours, "node": 1, "timeout": ANSWER_S}
    with on(theirs, family_device("gen4")):
        with Bench((), options) as bench:
            before = bench.run("pdo tpdo1 --json").document
            bench.session.wire.tap(after_downloads(2, lambda: ip("set", ours, "down")))
            ran = bench.run("map tpdo1 6041 606C/32 --sync 1")
            assert ran.code == 7, ran.stderr
            assert "Network is down" in ran.stderr
            assert re.search(r"restore the bus first \(`dvtcli .*doctor` checks it\)", ran.stderr), ran.stderr
        ip("set", ours, "up")
        with Bench((), options) as bench:
            ran = bench.run("recover --yes")
            assert ran.code == 0, ran.stderr
            assert bench.run("pdo tpdo1 --json").document == before
