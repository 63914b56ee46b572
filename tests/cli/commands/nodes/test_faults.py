"""`faults`: what a node says of its errors, and emptying its history."""

from __future__ import annotations

import pytest

from tests.cli.commands.bench import Bench


def bench(*faults: str, sim: str = "canopennode", **options: object) -> Bench:
    return Bench(sim=(sim,), options={"fault": faults, **options})


def codes(document: dict[str, object], source: str) -> list[int]:
    rows = document["faults"]
    assert isinstance(rows, list)
    return [row["code"] for row in rows if row["source"] == source]


def test_a_sound_node_tells_none() -> None:
    with bench() as one:
        ran = one.run("faults --json")
        assert (ran.code, ran.document["register"], ran.document["faults"]) == (0, 0, [])
        assert "no error is reported" in one.run("faults").stdout


def test_history_newest_first_and_what_was_heard() -> None:
    with bench("emcy=0x3210", "emcy=0x8130") as one:
        document = one.run("faults --json").document
        assert codes(document, "history") == [0x8130, 0x3210]
        assert codes(document, "heard") == [0x8130, 0x3210]
        assert document["register_bits"] == ["generic", "voltage", "communication"]
        received = document["faults"][-1]
        assert (received["count"], received["register"], received["manufacturer"]) == (1, 5, "00 00 00 00 00")
        assert "0x1017" in document["faults"][0]["remedy"]


def test_clear_empties_the_history_and_not_the_register() -> None:
    with bench("emcy=0x3210") as one:
        cleared = one.run("faults --clear --json")
        assert (cleared.code, cleared.document["cleared"], cleared.document["register"]) == (0, True, 5)
        assert codes(cleared.document, "history") == [0x3210]
        assert one.run("read 1003 --json").document["value"] == 0
        again = one.run("faults --clear")
        assert (again.code, "was empty already" in again.stdout) == (0, True)


def test_a_dry_run_leaves_the_history() -> None:
    with bench("emcy=0x3210") as one:
        assert "its twin" in one.run("faults --clear --dry-run").stdout
        assert one.run("read 1003 --json").document["value"] == 1


def test_a_refusal_says_that_nothing_changed() -> None:
    with bench("emcy=0x3210", "refuse@1=0x08000022") as one:
        ran = one.run("faults --clear --json")
        assert (ran.code, ran.document["abort"], ran.document["state"]) == (1, "0x08000022", "unchanged")
        assert one.run("read 1003 --json").document["value"] == 1


def test_a_history_that_fills_again_is_not_called_empty() -> None:
    """The device takes the 0 and puts back what it held, as one whose error came again at once."""
    with bench("emcy=0x3210", "alters@1=1003:00:1") as one:
        ran = one.run("faults --clear --json")
        assert (ran.code, ran.document["state"]) == (1, "unknown")
        assert "0x0000" in ran.document["error"] or "occurred again" in ran.document["why"]


def test_a_familys_own_list_is_read_position_by_position() -> None:
    """The position that was chosen before is put back, and a device that resets lists its errors anew."""
    with bench("emcy=0x4481", "emcy=0x4682", sim="gen4") as one:
        one.run("write 5300:2 1")
        document = one.run("faults --json").document
        assert codes(document, "active") == [0x4682, 0x4481]
        assert document["faults"][1]["remedy"] == "release the handbrake"
        assert one.run("read 5300:2 --json").document["value"] == 1
        dry = one.run("faults --json --dry-run")
        assert codes(dry.document, "active") == [0x4481]
        assert one.run("nmt reset-node --yes").code == 0
        assert codes(one.run("faults --json").document, "active") == [0x4682, 0x4481]


def test_an_error_that_goes_leaves_the_list() -> None:
    with bench("emcy=0x4481", "emcy=0:0.05", sim="gen4") as one:
        one.run("faults --watch --for 100ms")
        assert codes(one.run("faults --json").document, "active") == []


def test_a_node_without_history_says_so() -> None:
    with bench(sim="gen4") as one:
        ran = one.run("faults --clear --json")
        assert (ran.code, ran.document["abort"]) == (1, "0x06020000")
        assert "it has no error history" in one.run("faults").stdout


def test_an_error_of_a_drive_is_in_the_words_of_its_profile() -> None:
    with bench("emcy=0x3210", sim="generic") as one:
        assert codes(one.run("faults --json").document, "history") == [0x3210]
        assert "DC link over-voltage" in one.run("faults").stdout


def test_a_reset_brings_the_error_anew() -> None:
    with bench("emcy=0x3210") as one:
        assert one.run("faults --clear").code == 0
        assert one.run("nmt reset-node --yes").code == 0
        document = one.run("faults --json").document
        assert codes(document, "history")[:1] == [0x3210]
        assert document["faults"][-1]["count"] == 2


def test_in_a_script_it_is_said_that_no_undo_reverts_it() -> None:
    with bench("emcy=0x3210") as one:
        ran = one.script("set tpdo1 --timer 100", "faults --clear", "faults")
        assert ran.code == 0, ran.stderr


@pytest.mark.parametrize("line", ["faults --clear --watch", "faults --for 5s", "faults --watch --for 5h"])
def test_what_does_not_go_together(line: str) -> None:
    with bench() as one:
        assert one.run(line).code == 2


@pytest.mark.parametrize("word", ["emcy", "emcy=0x10000", "emcy@3=0x3210", "emcy=volt", "emcy=0x3210:x"])
def test_a_wrong_error_is_a_usage_error(word: str) -> None:
    with bench(word) as one:
        assert one.run("faults").code == 2


def test_watch_shows_what_came_and_what_comes() -> None:
    with bench("emcy=0x3210", "emcy=0x8130:0.1", "emcy=0:0.15") as one:
        ran = one.run("faults --watch --for 400ms --json")
        told = [(seen["code"], seen["register"], seen["count"]) for seen in ran.documents]
        assert (ran.code, told) == (0, [(0x3210, 5, 1), (0x8130, 0x15, 1), (0, 0, 1)])
        assert {seen["schema"] for seen in ran.documents} == {"dvtcli.emergency/1"}
