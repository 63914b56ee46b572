"""A journal that cannot be finished is closed by what the device holds, or set aside; none is ever deleted unread."""

from __future__ import annotations

import json
from pathlib import Path

from dvtcli.simulator.device.strict_device import StrictDevice
from tests.journals import journal_document
from tests.recovery.bench import MAP, Bench


def killed(bench: Bench, at: int = 4) -> Path:
    """A change of which the first *at* steps were taken; its journal."""
    bench.killed(at, *MAP)
    (journal,) = bench.journals()
    return journal


def aside(bench: Bench, word: str) -> Path:
    assert not bench.journals()
    (kept,) = (bench.folder / "journals").glob(f"*.{word}-*")
    return kept


def test_accept_takes_what_the_device_holds_as_the_new_state(bench: Bench) -> None:
    journal = killed(bench)
    text = journal.read_text("utf-8")
    held, downloads = bench.pdos(), bench.wire.downloads
    code, stdout, stderr = bench.run("recover", "--accept", "--json")
    assert code == 0, stderr
    document = json.loads(stdout)
    assert document["schema"] == "dvtcli.recover/1"
    assert (document["node"], document["recovered"], document["accepted"]) == (5, False, True)
    (held_now,) = document["held"]
    assert held_now["pdo"] == "tpdo1"
    assert held_now["differs_from_before"]
    assert (bench.pdos(), bench.wire.downloads) == (held, downloads), "nothing is written"
    kept = aside(bench, "accepted")
    assert kept.read_text("utf-8") == text
    assert document["kept"] == str(kept)
    assert bench.run("set", "tpdo2", "--timer", "7")[0] == 0, "and nothing blocks writing"


class Correcting(StrictDevice):
    """A device that takes any event timer of TPDO1 and keeps it at 40 ms from then on."""

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        if (index, sub_index) == (0x1800, 5):
            data = bytes([40, 0])
        super().download(index, sub_index, data)


def test_a_device_that_corrects_what_is_written_is_told_of_accept(bench: Bench) -> None:
    journal = killed(bench)
    document = journal_document(journal)
    document["changes"][0]["before"]["event_timer"] = 41
    journal.write_text(json.dumps(document))
    bench.wire.device.__class__ = Correcting
    code, _, stderr = bench.run("recover", "--yes")
    assert code == 7, stderr
    assert "event timer" in stderr or "0x1800:05" in stderr
    assert "recover --accept" in stderr
    assert bench.run("recover", "--accept")[0] == 0
    assert bench.run("set", "tpdo2", "--timer", "7")[0] == 0


def test_a_damaged_journal_is_set_aside(bench: Bench) -> None:
    journal = killed(bench)
    journal.write_text('{"schema": "dvtcli.journal/1", "node": 5, "changes": [')
    for words in (("recover", "--yes"), ("recover", "--accept"), ("set", "tpdo2", "--timer", "7")):
        code, _, stderr = bench.run(*words)
        assert code in (4, 6), stderr
        assert "recover --discard" in stderr, "whatever is tried names the way out"
    code, stdout, stderr = bench.run("recover", "--discard", "--json")
    assert code == 0, stderr
    kept = aside(bench, "discarded")
    assert kept.read_text("utf-8").endswith('"changes": [')
    assert json.loads(stdout).items() >= {"node": 5, "discarded": True, "kept": str(kept)}.items()
    assert bench.run("set", "tpdo2", "--timer", "7")[0] == 0
    assert bench.run("recover", "--discard")[:2] == (
        0,
        "nothing to recover: no change of this node was interrupted\n",
    )


def test_a_journal_of_another_device_is_set_aside_and_one_of_this_is_not(bench: Bench) -> None:
    journal = killed(bench)
    code, _, stderr = bench.run("recover", "--discard")
    assert code == 6, stderr
    assert "--accept" in stderr
    assert bench.journals() == [journal]
    document = journal_document(journal)
    document["identity"]["serial"] += 1
    journal.write_text(json.dumps(document))
    assert bench.run("recover", "--accept")[0] == 6
    assert bench.run("recover", "--discard")[0] == 0
    aside(bench, "discarded")


def test_a_file_that_is_no_journal_is_not_set_aside(bench: Bench, tmp_path: Path) -> None:
    letter = tmp_path / "letter.txt"
    letter.write_text("dear reader")
    letter.chmod(0o600)
    code, _, stderr = bench.run("recover", "--discard", str(letter))
    assert code == 2, stderr
    assert (letter.read_text(), [*tmp_path.glob("letter*")]) == ("dear reader", [letter])


def test_accept_and_discard_exclude_each_other(bench: Bench) -> None:
    assert bench.run("recover", "--accept", "--discard")[0] == 2


def test_a_dry_run_leaves_the_journal(bench: Bench) -> None:
    journal = killed(bench)
    for word in ("--accept", "--discard"):
        bench.run("recover", word, "--dry-run", "--force")
        assert bench.journals() == [journal]


def test_a_journal_in_another_folder_is_finished_without_an_error(bench: Bench, tmp_path: Path) -> None:
    before = bench.pdos()
    journal = killed(bench)
    elsewhere = tmp_path / "elsewhere"
    at = bench.words.index("--journal") + 1
    bench.words[at] = str(elsewhere)
    code, _, stderr = bench.run("recover", "--yes")
    assert code == 0, stderr
    assert bench.pdos() == before
    assert not journal.exists()
    assert bench.run("set", "tpdo2", "--timer", "7")[0] == 0


def test_the_doctor_names_a_journal_that_waits(bench: Bench) -> None:
    journal = killed(bench)
    _, stdout, _ = bench.run("doctor", "--json")
    (check,) = [one for one in json.loads(stdout)["checks"] if one["check"] == "journals"]
    assert check["verdict"] == "warn"
    assert journal.name in check["text"]


def test_what_a_killed_process_left_half_written_goes_with_the_next_change(bench: Bench) -> None:
    """Of this node and no other: whoever has its lock is the only one that writes its files."""
    journal = killed(bench)
    own = journal.with_name(f"{journal.name}.abcd1234.tmp")
    others = journal.with_name(f"{journal.stem[:-1]}7.json.abcd1234.tmp"), journal.with_name("tmpabcd1234")
    for path in (own, *others):
        path.touch()
    assert bench.run("recover", "--yes")[0] == 0
    assert [path.exists() for path in (own, *others)] == [False, True, True]
