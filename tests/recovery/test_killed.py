"""A dvtcli that is killed in the middle of a change leaves a journal, and `recover` puts the old configuration back.

Real processes: the node lives in this one behind a socketcand server, dvtcli in a child that gets SIGKILL.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from dvtcli.device.read_pdos import present_pdos, read_pdo
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.simulator.device.strict_device import StrictDevice
from tests import process
from tests.forked import Forked
from tests.process import documents
from tests.prompt.wire import Wire

MAP = ("map", "tpdo1", "6C01:1", "606C", "6041", "--cob-id", "0x201", "--sync", "1")
#: disable, type, count, three entries, count, COB-ID
STEPS = 8


@dataclass
class Direct:
    """The device's dictionary without a bus: what it really holds."""

    device: StrictDevice

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        from dvtcli.errors import SdoAborted
        from dvtcli.simulator.device.refusal import Refusal

        try:
            return self.device.upload(index, sub_index)
        except Refusal as refusal:
            raise SdoAborted(index, sub_index, refusal.code) from refusal

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        raise AssertionError("the test never writes")


class Bench:
    """A served node, a state folder, and dvtcli processes that use both."""

    def __init__(self, folder: Path, family: str = "gen4") -> None:
        self.wire = Wire(family=family)
        self.folder = folder
        self.words = [
            "-i", "socketcand", "-c", "can0",
            "--bus-kwargs", "host=127.0.0.1", "--bus-kwargs", f"port={self.wire.port}",
            "-n", "5", "--eds", str(self.wire.eds), "--journal", str(folder),
        ]  # fmt: skip

    def start(self, *words: str) -> Forked:
        return process.start([*self.words, *words])

    def run(self, *words: str) -> tuple[int, str, str]:
        child = self.start(*words)
        stdout, stderr = child.communicate(timeout=60)
        return child.returncode, stdout, stderr

    def pdos(self) -> dict[Pdo, PdoConfig]:
        sdo = Direct(self.wire.device)
        with self.wire.at_work:  # a killed child is gone before the node has seen its last request
            return {pdo: read_pdo(sdo, pdo) for pdo in present_pdos(sdo, None)}

    def journals(self) -> list[Path]:
        folder = self.folder / "journals"
        return sorted(folder.glob("*.json")) if folder.is_dir() else []


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    yield made
    made.wire.close()


@pytest.mark.drawn(4)
@pytest.mark.parametrize("step", range(1, STEPS + 1))
def test_recover_finishes_what_a_killed_process_began(bench: Bench, step: int) -> None:
    before = bench.pdos()
    child = bench.start(*MAP)

    def kill(number: int) -> None:
        if number == step:
            child.kill()
            child.wait()

    bench.wire.at_download = kill
    child.communicate(timeout=60)
    assert child.returncode == -9
    bench.wire.at_download = lambda _number: None
    assert bench.wire.downloads == step
    assert bench.pdos() != before

    (journal,) = bench.journals()
    assert journal.stat().st_mode & 0o777 == 0o600
    code, _, stderr = bench.run("recover", "--yes")
    assert code == 0, stderr
    assert stderr.count("was interrupted") == 1
    assert bench.pdos() == before
    assert not bench.journals()
    assert bench.run("recover")[:2] == (0, "nothing to recover: no change of this node was interrupted\n")


def test_until_then_nothing_is_written_or_stored(bench: Bench) -> None:
    child = bench.start(*MAP)
    bench.wire.at_download = lambda number: child.kill() if number == 4 else None
    child.communicate(timeout=60)
    bench.wire.at_download = lambda _number: None
    left, downloads = bench.pdos(), bench.wire.downloads
    for words in (MAP, ("store",), ("write", "1017", "100"), ("set", "tpdo2", "--timer", "7")):
        code, _, stderr = bench.run(*words)
        assert code == 6, stderr
        assert "recover" in stderr
    code, _, stderr = bench.run("recover")
    assert code == 6, "nobody can answer"
    assert "--yes" in stderr
    code, stdout, _ = bench.run("recover", "--dry-run", "--json")
    assert code == 0
    (document,) = documents(stdout)
    assert document["dry_run"] is True
    assert document["writes"] > 0
    code, stdout, stderr = bench.run("pdo", "tpdo1")
    assert code == 0, "reading is always possible"
    assert "was interrupted" in stderr
    assert (bench.pdos(), bench.wire.downloads) == (left, downloads)


def test_a_journal_of_another_device_is_refused(bench: Bench) -> None:
    child = bench.start(*MAP)
    bench.wire.at_download = lambda number: child.kill() if number == 3 else None
    child.communicate(timeout=60)
    bench.wire.at_download = lambda _number: None
    (journal,) = bench.journals()
    document = json.loads(journal.read_text())
    document["identity"]["serial"] += 1
    journal.write_text(json.dumps(document))
    code, _, stderr = bench.run("recover", "--yes")
    assert code == 6
    assert "another device" in stderr


def test_a_damaged_journal_is_an_error_and_blocks_writing(bench: Bench) -> None:
    child = bench.start(*MAP)
    bench.wire.at_download = lambda number: child.kill() if number == 3 else None
    child.communicate(timeout=60)
    bench.wire.at_download = lambda _number: None
    (path,) = bench.journals()
    path.write_text('{"schema": "dvtcli.journal/1", "node": 5, "changes": [')
    code, _, stderr = bench.run("recover", "--yes")
    assert code == 4, stderr
    assert str(path) in stderr
    code, _, stderr = bench.run("pdo")
    assert code == 0
    assert str(path) in stderr
    assert bench.run("set", "tpdo2", "--timer", "7")[0] == 6


def test_a_second_dvtcli_may_read_but_not_write(bench: Bench) -> None:
    """The first one sits in the middle of its change while the second one tries; the wire serves one at a time."""
    from dvtcli.device.change.lock import NodeLock
    from dvtcli.files.user_folders import user_folder

    code, _, stderr = bench.run("set", "tpdo2", "--timer", "7")
    assert code == 0, stderr
    folder = user_folder("state") / "locks"
    (lock_file,) = folder.glob(f"*{bench.wire.port}*.lock")
    lock = NodeLock(folder, lock_file.stem.removesuffix("-5"), 5)
    lock.take()
    try:
        code, _, stderr = bench.run("set", "tpdo2", "--timer", "8")
        assert code == 6
        assert "another dvtcli" in stderr
        assert bench.run("pdo")[0] == 0
    finally:
        lock.release()
    assert bench.run("set", "tpdo2", "--timer", "8")[0] == 0


def test_the_first_write_backs_the_node_up_as_a_script_that_restores_it(bench: Bench) -> None:
    before = bench.pdos()
    code, _, stderr = bench.run(*MAP)
    assert code == 0
    (backup,) = (bench.folder / "backups").glob("*.dvt")
    assert str(backup) in stderr
    assert backup.stat().st_mode & 0o777 == 0o600
    assert bench.pdos() != before
    code, _, stderr = bench.run("run", str(backup))
    assert code == 0, stderr
    assert bench.pdos() == before
    assert not bench.journals()


def test_the_backup_restores_also_after_can_ids_were_exchanged(bench: Bench) -> None:
    before = bench.pdos()
    first, second = (before[Pdo.parse(name)].communication.cob_id for name in ("tpdo1", "tpdo2"))
    assert bench.run("map", "tpdo1", "6041", "--cob-id", "0x6A0")[0] == 0
    (backup,) = (bench.folder / "backups").glob("*.dvt")
    assert bench.run("map", "tpdo2", "6041", "--cob-id", str(first))[0] == 0
    assert bench.run("set", "tpdo1", "--cob-id", str(second))[0] == 0
    now = bench.pdos()
    assert now[Pdo.parse("tpdo2")].communication.cob_id.can_id == first.can_id
    code, _, stderr = bench.run("run", str(backup))
    assert code == 0, stderr
    assert bench.pdos() == before


@pytest.mark.parametrize("target", ["5", "all"])
def test_a_start_of_a_half_configured_node_says_so_in_its_document(bench: Bench, target: str) -> None:
    child = bench.start(*MAP)
    bench.wire.at_download = lambda number: child.kill() if number == 4 else None
    child.communicate(timeout=60)
    bench.wire.at_download = lambda _number: None
    said = "a change of TPDO1 of node 5 was interrupted: `recover` puts the old configuration back"
    for dry in ([], ["--dry-run"]):
        code, stdout, _ = bench.run("--json", *dry, "nmt", "start", target)
        (document,) = documents(stdout)
        assert (code, document["command"], document["notes"]) == (0, "start", [said])
    assert bench.run("nmt", "start", target)[2].count(said) == 1
    assert bench.run("recover", "--yes")[0] == 0
    assert documents(bench.run("--json", "nmt", "start", target)[1])[0]["notes"] == []
