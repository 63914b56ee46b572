"""How much is read of a device: nothing twice before it is written, and no more than a change is about.

Real processes on a node behind a socketcand server that counts the objects it is asked for. The device has 8 PDOs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.domain.pdo import Pdo
from dvtcli.files.eds.reader import read_eds
from tests.cli.prompt.wire import Wire
from tests.recovery.bench import Bench
from tests.simulator.serve.served import served

CHANGES = {
    "event timer": "set tpdo1 --timer 100",
    "inhibit time": "set tpdo1 --inhibit 5",
    "COB-ID": "set tpdo1 --cob-id 0x1A7",
    "mapping": "map tpdo2 6041 606C",
    "mapping and COB-ID": "map tpdo2 6041 606C --cob-id 0x2A7",
    "RPDO": "map rpdo2 6040 60FF --cob-id 0x3A7",
    "enable": "enable tpdo3",
    "clear": "clear tpdo2",
    "clear all": "clear all",
    "parameter of a PDO": "write 1800:5 100 --as u16",
    "object": "write 1017 750 --as u16",
}


class Counted(Bench):
    """Runs dvtcli with or without the EDS, and says what it read."""

    def __init__(self, folder: Path, family: str = "generic", *, eds: bool = True) -> None:
        super().__init__(folder)
        self.wire.close()
        self.wire = Wire(family=family)
        at = self.words.index("--eds")
        self.words[at : at + 2] = ["--eds", str(self.wire.eds)] if eds else []
        if not eds:  # a device of its own, no simulated one that its family's file describes
            self.wire.device.set_value(0x1018, 4, b"\x77\x00\x00\x00")
        self.words[self.words.index("--bus-kwargs") + 3] = f"port={self.wire.port}"

    def reads(self, line: str) -> tuple[list[str], list[str]]:
        """The objects that *line* reads before its last write, and after it."""
        self.wire.uploads.clear()
        self.wire.uploads_before_write = 0
        code, _, stderr = self.run(*line.split(), "--yes")
        assert code == 0, stderr
        at = self.wire.uploads_before_write
        return self.wire.uploads[:at], self.wire.uploads[at:]


@pytest.fixture(params=[True, False], ids=["with its EDS", "without an EDS"])
def bench(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Counted]:
    made = Counted(tmp_path, eds=request.param)
    made.eds = request.param  # type: ignore[attr-defined]
    yield made
    made.wire.close()


def backed_up(bench: Counted) -> Counted:
    """A device that was changed before: its backup is made."""
    assert bench.run("set", "tpdo4", "--timer", "7")[0] == 0
    return bench


def twice(objects: list[str]) -> set[str]:
    return {one for one, count in Counter(objects).items() if count > 1}


@pytest.mark.drawn(7)
@pytest.mark.parametrize("line", CHANGES.values(), ids=CHANGES)
def test_nothing_is_read_twice_before_it_is_written_or_when_it_is_read_back(bench: Counted, line: str) -> None:
    for device in (bench, backed_up(bench)):
        before, after = device.reads(line)
        assert not twice(before)
        assert not twice(after)
        assert device.run("undo")[0] == 0


def unlisted(bench: Counted) -> list[str]:
    """What is read once it is done: whether `store` would keep it, where no EDS says that."""
    return [] if "--eds" in bench.words else ["1010:01"]


def who_has_can_ids(bench: Counted) -> set[str]:
    """The COB-IDs of its PDOs and services; without an EDS also what tells that it has no more of them."""
    cob_ids = {f"{base + number:04X}:01" for base in (0x1400, 0x1800) for number in range(4)}
    gaps = {"1012:00", "1201:01", "1280:01", "1404:01", "1604:00", "1804:01", "1A04:00"}
    return {"1005:00", "1014:00", *cob_ids, *(() if "--eds" in bench.words else gaps)}


def test_an_event_timer_reads_its_own_pdo_who_the_device_is_and_who_has_its_can_id(bench: Counted) -> None:
    before, after = backed_up(bench).reads(CHANGES["event timer"])
    own = {"1800:01", "1800:02", "1800:03", "1800:05", "1800:06", "1A00:00", "1A00:01"}
    identity = {"1018:01", "1018:02", "1018:03", "1018:04", "1020:01"}
    assert set(before) == identity | own | who_has_can_ids(bench), "who it is, its stamp, and who may clash"
    assert sorted(after) == [*unlisted(bench), *sorted(own)]


def test_an_event_timer_of_a_pdo_that_is_off_reads_nothing_of_others(bench: Counted) -> None:
    assert backed_up(bench).run("disable", "tpdo1", "--yes")[0] == 0
    before, _ = bench.reads(CHANGES["event timer"])
    assert not {"1005:00", "1014:00", "1801:01", "1400:01"} & set(before)


@pytest.mark.drawn(4)
@pytest.mark.parametrize("what", ["COB-ID", "mapping and COB-ID", "RPDO", "enable", "clear"])
def test_a_new_cob_id_reads_those_of_the_others_before_and_after(bench: Counted, what: str) -> None:
    before, after = backed_up(bench).reads(CHANGES[what])
    assert len(before + after) <= 60
    cob_ids = {f"{base + number:04X}:01" for base in (0x1400, 0x1800) for number in range(4)}
    assert cob_ids <= set(before)
    assert cob_ids <= set(after), "what another PDO has become is looked at on the wire, after the last write"


def test_the_first_change_of_a_device_reads_each_of_its_pdos_once_for_the_backup(bench: Counted) -> None:
    before, after = bench.reads(CHANGES["COB-ID"])
    mappings = {f"{base + number:04X}:00" for base in (0x1600, 0x1A00) for number in range(4)}
    assert mappings <= set(before)
    assert not twice(before)
    assert len(after) == 7 + 7 + len(unlisted(bench))
    assert len(list((bench.folder / "backups").iterdir())) == 1


@pytest.mark.parametrize("what", ["event timer", "COB-ID", "mapping"])
def test_in_a_session_the_others_are_read_whole_once_since_a_store_may_follow(bench: Counted, what: str) -> None:
    script = bench.folder / "two.dvt"
    script.write_text(f"{CHANGES[what]}\nset tpdo3 --timer 9\n", "utf-8")
    backed_up(bench).reads(f"run {script}")
    counts = Counter(bench.wire.uploads)
    assert {counts[f"{0x1600 + number:04X}:00"] for number in range(4)} == {1}
    (alone,) = [name for name in ("1803:05",) if counts[name]]
    assert counts[alone] == 1


def test_what_somebody_else_has_set_since_is_backed_up_before_it_is_overwritten(bench: Counted) -> None:
    backed_up(bench).reads(CHANGES["event timer"])
    assert len(list((bench.folder / "backups").iterdir())) == 1, "what it held is remembered: undo puts it back"
    with bench.wire.at_work:
        bench.wire.device.download(0x1800, 5, b"\x21\0")
    before, _ = bench.reads("set tpdo1 --timer 55")
    assert "1603:00" in before
    _, newest = sorted((bench.folder / "backups").iterdir())
    assert "--timer 33" in newest.read_text("utf-8")
    assert bench.run("undo", "--backup")[0] == 0
    assert bench.pdos()[Pdo.parse("tpdo1")].communication.event_timer == 33


def test_another_device_of_the_same_kind_has_a_backup_of_its_own(bench: Counted) -> None:
    backed_up(bench)
    with bench.wire.at_work:
        bench.wire.device.set_value(0x1018, 4, b"\x44\x33\x22\x11")
    before, _ = bench.reads(CHANGES["event timer"])
    assert "1603:00" in before
    _, newest = sorted((bench.folder / "backups").iterdir())
    assert "# serial number 0x11223344" in newest.read_text("utf-8").splitlines()


@pytest.mark.drawn(4)
@pytest.mark.parametrize("line", ["pdo", "pdo tpdo1", "read 6041 --as u16", "store"])
def test_other_commands_read_nothing_twice_either(bench: Counted, line: str) -> None:
    backed_up(bench)
    before, after = bench.reads(line)
    assert not twice(before)
    assert not twice(after)


def test_a_backup_reads_twice_only_what_may_change_by_itself(tmp_path: Path) -> None:
    bench = Counted(tmp_path)
    _, read = bench.reads(f"backup {tmp_path / 'drive.jsonl'}")
    described = read_eds(bench.wire.eds).dictionary.entries()
    moving = {entry.object for entry in described if entry.pdo_mapping and entry.access.writable}
    bench.wire.close()
    assert twice(read) == moving
    assert {"1000:00", "1018:01"} <= set(read)


def test_an_undo_reads_the_other_pdos_at_most_twice_before_its_write_and_behind_it(bench: Counted) -> None:
    """What the device alters on a way back is put back, too: all is looked at, then once more with what is undone."""
    for read in backed_up(bench).reads("undo"):
        assert max(Counter(read).values()) <= 2


def test_a_pdo_that_was_altered_beside_is_noticed_by_its_cob_id_and_no_more_is_claimed(tmp_path: Path) -> None:
    with served(tmp_path, "generic@1", "--fault", "alters@3=1801:1:0xC00002B1") as server:
        assert server.dvtcli("-n", "1", "set", "tpdo4", "--timer", "7").returncode == 0
        before = server.dvtcli("-n", "1", "pdo", "--all").stdout
        ran = server.dvtcli("-n", "1", "set", "tpdo1", "--cob-id", "0x1A7")
        assert ran.returncode == 1
        assert "took TPDO1, but changed TPDO2 as a side effect" in ran.stderr
        assert "TPDO2 has its COB-ID again" in ran.stderr
        assert "the rest of it was not read before" in " ".join(ran.stderr.split())
        assert server.dvtcli("-n", "1", "pdo", "--all").stdout == before
