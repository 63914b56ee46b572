"""A bus that was gone and is back: a changed node that stays away is asked once a line, and as soon as it is heard."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import Frame
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import SafetyRefusal
from dvtcli.operations.changes.change import configure
from dvtcli.operations.devices.verify_nodes import verify
from dvtcli.operations.network.network_files import apply_file
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.simulator.network.family_file import family_eds
from tests.operations.network.bench import device
from tests.virtual_time import VirtualTimeBus

NETWORK = """
{}:
  node_id: {}
  tpdo:
    1:
      transmission: 1
"""


class Back(VirtualTimeBus):
    """A bus that others use, too; counts what node 5 is asked."""

    asked = 0

    def send_sdo(self, can_id: int, data: bytes) -> None:
        self.asked += can_id == 0x605
        super().send_sdo(can_id, data)


def test_a_changed_node_that_stays_away_is_asked_once_a_line(tmp_path: Path) -> None:
    away, there = device(5, "generic"), device(9, "generic")
    file = tmp_path / "network.yaml"
    file.write_text(NETWORK.format("a", 5) + NETWORK.format("b", 9))
    before, back = VirtualTimeBus([away, there], simulated=False), Back([there], simulated=False)
    with Session(Options(yes=True, journal=str(tmp_path)), open_bus=lambda _options: before) as session:
        session.comes_back = True
        apply_file(session, str(file))
        session.end_line(0)
        session.leave_bus("it is gone")
        session.take_bus(back)
        session.node(9)
        asked = back.asked
        assert asked, "node 5 was changed: is it there, and is it still the same device?"
        for _ in range(3):
            session.node(9).read_anew()
        assert back.asked == asked
        session.end_line(0)
        session.node(9)
        assert asked < back.asked <= 2 * asked, "another line asks again, once (and needs no abort before it)"
        assert list(session.network.left) == [5]
        back.join([away])
        back.nodes_said(Frame(0x705, b"\0"))
        back.sleep(0.01)
        assert not session.network.left, "who is heard is asked at once"
        assert sorted(session.network.nodes) == [5, 9]


def changed(session: Session) -> None:
    """Node 5 has two changes of this session in its RAM, and the bus is gone."""
    configure(session, session.node(5), {Pdo.parse("tpdo1"): PdoRequest(event_timer=70)})
    configure(session, session.node(5), {Pdo.parse("tpdo2"): PdoRequest(event_timer=80)})
    session.end_line(0)
    session.leave_bus("it is gone")


@pytest.mark.parametrize("restarted", [True, False])
def test_what_a_restart_took_while_nobody_listened_is_not_called_unstored(tmp_path: Path, restarted: bool) -> None:
    node, said = device(5, "generic"), list[str]()
    bus = VirtualTimeBus([node], simulated=False)
    with Session(Options(yes=True, journal=str(tmp_path)), open_bus=lambda _options: bus) as session:
        session.comes_back = True
        changed(session)
        session.reporter.warning = said.append  # type: ignore[method-assign]
        if restarted:
            node.restart()
        session.take_bus(VirtualTimeBus([node], simulated=False))
        assert list(session.node(5).unstored) == ([] if restarted else ["TPDO1", "TPDO2"])
    lost = "node 5 has lost unstored values: TPDO1, TPDO2; it may have restarted"
    assert said == ([lost] if restarted else [])


def test_verify_does_not_leave_out_a_device_that_is_another_one_now(tmp_path: Path) -> None:
    bus = VirtualTimeBus([device(5, "generic")], simulated=False)
    with Session(Options(yes=True, journal=str(tmp_path)), open_bus=lambda _options: bus) as session:
        session.comes_back = True
        changed(session)
        session.take_bus(VirtualTimeBus([device(5, "tmcm")], simulated=False))
        with pytest.raises(SafetyRefusal, match="is not the device that it was"):
            verify(session, lambda _file, _node_id=None: {})


def test_the_file_that_comes_late_says_what_stores_and_which_cob_ids_are_fixed(tmp_path: Path) -> None:
    """A node that was met without an EDS: the family said that it cannot store, its own file says that it can."""
    own = family_eds("generic").read_text("latin-1")
    head, entry, rest = own.partition("[1801sub1]")
    (tmp_path / "own.eds").write_text(head + entry + rest.replace("AccessType=rw", "AccessType=ro", 1), "latin-1")
    file = tmp_path / "network.yaml"
    file.write_text("a: {node_id: 5, dcf: own.eds, tpdo: {1: {transmission: 1}}}\n")
    unknown = device(5, "generic")
    unknown.set_value(0x1018, 4, (77).to_bytes(4, "little"))  # not what a served family says, whose EDS is known
    bus = VirtualTimeBus([unknown], simulated=False)
    options = Options(yes=True, journal=str(tmp_path / "state"), profile="roboteq")
    with Session(options, open_bus=lambda _options: bus) as session:
        node = session.node(5)
        assert node.dictionary is None
        assert not node.profile.store.sub_indices
        apply_file(session, str(file))
        assert node.dictionary is not None
        assert node.profile.store.sub_indices[:1] == (1,)
    (backup,) = (tmp_path / "state" / "backups").glob("*.dvt")
    (disables,) = (line for line in backup.read_text().splitlines() if line.startswith("disable "))
    assert "tpdo1" in disables
    assert "tpdo2" not in disables, "its COB-ID cannot be written"
