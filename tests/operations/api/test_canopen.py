"""canopen's RemoteNode beside ours, on one bus."""

from __future__ import annotations

from queue import Queue

import canopen
import pytest

import dvtcli
from dvtcli import errors
from dvtcli.simulator.network.family_file import family_eds
from dvtcli.testing import serve
from tests.process import PATIENCE_S


def test_it_reads_writes_and_names_as_canopen_does() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        remote = node.canopen()
        assert isinstance(remote, canopen.RemoteNode)
        assert remote is node.canopen()
        remote.sdo["Producer heartbeat time"].raw = 700
        assert node.read(0x1017).value == 700
        assert remote.sdo[0x1018][1].raw == node.identity().vendor_id
        remote.tpdo.read()
        assert [variable.index for variable in remote.tpdo[1].map] == [0x6041]


def test_it_hears_frames_heartbeats_and_syncs() -> None:
    received: Queue[int] = Queue()
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        node.map("tpdo1", "6041", sync=1)
        node.write(0x1017, 10)
        remote = node.canopen()
        remote.tpdo.read()
        remote.tpdo[1].add_callback(lambda frame: received.put(frame[0].raw))
        remote.nmt.state = "OPERATIONAL"
        remote.nmt.wait_for_heartbeat(timeout=PATIENCE_S)
        remote.network.sync.start(0.01)
        assert received.get(timeout=PATIENCE_S) == node.read(0x6041).value
        remote.network.sync.stop()
        assert remote.nmt.state == "OPERATIONAL"


def test_its_errors_are_canopens() -> None:
    with dvtcli.simulate("gen4") as bus:
        remote = bus.node().canopen()
        with pytest.raises(canopen.SdoAbortedError) as aborted:
            remote.sdo.upload(0x2FFF, 0)
        assert aborted.value.code == 0x06020000
        with pytest.raises(canopen.SdoCommunicationError, match="streams"):
            remote.sdo["Manufacturer device name"].open()
    with pytest.raises(canopen.SdoCommunicationError, match="closed"):
        remote.sdo.upload(0x1000, 0)


def test_what_it_wrote_is_seen_and_nothing_altered_is_stored() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        node.set("tpdo1", event=True, timer_ms=100)
        node.canopen().sdo[0x1800][5].raw = 250
        assert node.pdo("tpdo1").config.communication.event_timer == 250
        assert not node.verify()
        with pytest.raises(errors.SafetyRefusal):
            node.store()


def test_it_does_not_speak_in_a_dry_run() -> None:
    with dvtcli.simulate("gen4") as bus:
        remote = bus.node().canopen()
        with bus.dry_run():
            with pytest.raises(errors.UsageError, match="dry run"):
                bus.node().canopen()
            with pytest.raises(canopen.SdoCommunicationError, match="dry run"):
                remote.sdo.download(0x1017, 0, b"\0\0")
            with pytest.raises(errors.UsageError, match="dry run"):
                remote.nmt.state = "STOPPED"
        assert bus.node().identity().state != "STOPPED"


def test_a_node_that_restarts_between_two_calls_has_lost_what_was_set() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        node.set("tpdo1", event=True, timer_ms=100)
        remote, booted = node.canopen(), Queue[int]()
        remote.network.subscribe(0x701, lambda can_id, _data, _time: booted.put(can_id))
        remote.nmt.send_command(0x81)
        booted.get(timeout=PATIENCE_S)
        with pytest.raises((errors.Restarted, errors.SafetyRefusal)):  # whichever looks first
            node.set("tpdo2", event=True, timer_ms=100)


@pytest.mark.usefixtures("dvtcli_state")
def test_it_works_on_a_bus_of_others() -> None:
    with serve("gen4@5") as served, served.connect(timeout_s=PATIENCE_S) as bus:
        assert bus.node(5, eds=family_eds("gen4")).canopen().sdo[0x1018][1].raw == bus.node(5).identity().vendor_id
        # on a busy machine the node may answer later than a scan waits
        found = next(rows for rows in iter(bus.scan, None) if rows)
        assert [row.node for row in found] == [5]


@pytest.mark.usefixtures("dvtcli_state")
def test_others_may_write_once_it_has_written() -> None:
    with (
        serve("gen4@5") as served,
        served.connect(timeout_s=PATIENCE_S) as bus,
        served.connect(timeout_s=PATIENCE_S) as other,
    ):
        bus.node(5).canopen().sdo.download(0x1017, 0, b"\x64\0")
        assert other.node(5).write(0x1017, 200)
