"""A dvtcli that is killed in the middle of a change leaves a journal, and `recover` puts the old configuration back.

Real processes: the node lives in this one behind a socketcand server, dvtcli in a child that gets SIGKILL.
"""

from __future__ import annotations

import json

import pytest

from dvtcli.domain.pdo import Pdo
from tests.journals import journal_document
from tests.process import documents
from tests.recovery.bench import MAP, STEPS, Bench


@pytest.mark.drawn(4)
@pytest.mark.parametrize("step", range(1, STEPS + 1))
def test_recover_finishes_what_a_killed_process_began(bench: Bench, step: int) -> None:
    before = bench.pdos()
    bench.killed(step, *MAP)
    assert bench.wire.downloads == step
    assert bench.pdos() != before

    (journal,) = bench.journals()
    assert journal.stat().st_mode & 0o777 == 0o600
    code, _, stderr = bench.run("recover", "--yes")
    assert code == 0, stderr
    assert "was interrupted" not in stderr, "nobody who recovers is asked to recover"
    assert bench.pdos() == before
    assert not bench.journals()
    assert bench.run("recover")[:2] == (0, "nothing to recover: no change of this node was interrupted\n")


def test_until_then_nothing_is_written_or_stored(bench: Bench) -> None:
    bench.killed(4, *MAP)
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


@pytest.mark.long
def test_an_interrupted_change_is_reported_while_its_node_is_silent(bench: Bench) -> None:
    bench.killed(4, *MAP)
    bench.wire.device.restart()
    for words in (("pdo", "tpdo1"), ("set", "tpdo2", "--timer", "7"), ("recover", "--yes"), ("nmt", "preop")):
        code, _, stderr = bench.run(*words)
        assert code == 5, stderr
        assert stderr.count("was interrupted") == 1, stderr


def test_a_journal_of_another_device_is_refused(bench: Bench) -> None:
    bench.killed(3, *MAP)
    (journal,) = bench.journals()
    document = journal_document(journal)
    document["identity"]["serial"] += 1
    journal.write_text(json.dumps(document))
    code, _, stderr = bench.run("recover", "--yes")
    assert code == 6
    assert "another device" in stderr


def test_a_damaged_journal_is_an_error_and_blocks_writing(bench: Bench) -> None:
    bench.killed(3, *MAP)
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
    bench.killed(4, *MAP)
    said, does = "a change of TPDO1 of node 5 was interrupted: `dvtcli ", "recover` rolls back to the old configuration"
    for dry in ([], ["--dry-run"]):
        code, stdout, _ = bench.run("--json", *dry, "nmt", "start", target)
        (document,) = documents(stdout)
        (note,) = document["notes"]
        assert (code, document["command"], note.startswith(said), note.endswith(does)) == (0, "start", True, True)
    assert bench.run("nmt", "start", target)[2].count(said) == 1
    assert bench.run("recover", "--yes")[0] == 0
    assert documents(bench.run("--json", "nmt", "start", target)[1])[0]["notes"] == []
