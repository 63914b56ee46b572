"""A service call, rehearsed: find the nodes, give one its ID, load a program, see its faults, watch three objects."""

from __future__ import annotations

from pathlib import Path

from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.simulator.device.simulated_faults import Fault
from tests.cli.commands.bench import Bench
from tests.lss_nodes import address_of, unconfigured
from tests.virtual_time import VirtualTimeBus

PROGRAM = bytes(range(256)) * 8


def test_a_service_call_from_finding_the_node_to_watching_it(tmp_path: Path) -> None:
    (tmp_path / "fw.bin").write_bytes(PROGRAM)
    new, other = unconfigured(7, "loader"), unconfigured(8, node_id=3)
    bus = VirtualTimeBus([new, other], faults=[Fault.parse("emcy=0x3210")], simulated=False)
    with Bench((), {"yes": True, "profile": "loader", "journal": str(tmp_path / "state")}, bus) as desk:
        assert "1 node without a node-ID" in desk.run("lss scan").stdout
        assert desk.run(f"lss node-id 5 {address_of(new)}").code == 0
        assert "stored, proved by a reset" in desk.run("lss store 5 --prove").stdout
        assert [row["node"] for row in desk.run("scan --json").document["nodes"]] == [3, 5]
        assert desk.run("node 5").code == 0
        loaded = desk.run(f"download {tmp_path / 'fw.bin'}")
        assert (loaded.code, "as profile loader expects" in loaded.stdout) == (0, True), loaded.stderr
        assert new.loader is not None
        assert new.loader.program == PROGRAM
        told = desk.run("faults")
        assert "0x3210" in told.stdout, told
        watched = desk.run("read 1001 6000:01 6200:01 --every 100ms --for 500ms")
        assert watched.code == 0, watched.stderr
        assert all(name in watched.stdout for name in ("1001:00", "6000:01", "6200:01"))
    assert (new.lss.stored, other.lss.stored) == (5, 3)
    new.restart()
    new.boot_up()
    assert new.node_id == 5 != UNCONFIGURED
