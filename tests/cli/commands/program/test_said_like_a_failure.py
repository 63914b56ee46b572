"""Results that end with 1 say what every failure says: what, where, why, in which state the device is, what next."""

from __future__ import annotations

import pytest

from dvtcli.cli.boundary import exit_code_of
from dvtcli.cli.scripts.script import run_script
from tests.cli.commands.bench import Bench, Ran
from tests.harness.sample import heavy

MAP = "map tpdo1 6064 606C"


def sim(*faults: str) -> Bench:
    return Bench(("generic",), {"fault": faults, "yes": True, "timeout": 0.2})


def atomic(bench: Bench, *lines: str) -> Ran:
    """Run *lines* as `run --atomic` does."""
    data = "\n".join(lines).encode()
    session = bench.session
    return bench._ran(
        lambda: exit_code_of(session, lambda: run_script(session, data, "test.dvt", keep_going=False, atomic=True))
    )


def rows(ran: Ran) -> dict[str, str]:
    """The labelled lines of the one error that was said."""
    lines = ran.stderr.splitlines()
    (first,) = (number for number, line in enumerate(lines) if "error: " in line)
    found = {"error": lines[first]}
    for line in lines[first + 1 :]:
        if line.startswith("  "):
            label, _, text = line.strip().partition(" ")
            found[label] = text.strip()
    return found


def test_a_store_that_was_not_kept_says_that_what_was_set_is_lost() -> None:
    with sim("stores-nothing") as bench:
        bench.run(MAP)
        said = rows(bench.run("store --prove"))
        assert said["error"] == "error: node 1 acknowledged the store but did not keep it"
        assert said["why"] == "after the reset TPDO1 differs from what was stored"
        assert "again" in said["hint"]
        assert said["state"] == (
            "lost with the reset: TPDO1; the node holds what it came up with, read after the reset"
        )


def test_a_store_that_was_not_kept_leaves_no_line_of_a_script_standing() -> None:
    with sim("stores-nothing") as bench:
        ran = bench.script(MAP, "store --prove")
        said = rows(ran)
        assert ran.code == 1
        assert said["error"].startswith("test.dvt:2: error: node 1 ")
        assert "not rolled back" not in said["state"]


@pytest.mark.parametrize("fault", ["keeps-ram", "saves-itself"])
def test_a_store_that_is_not_proved_says_that_the_test_value_was_put_back(fault: str) -> None:
    with sim(fault) as bench:
        ran = bench.script(MAP, "store --prove")
        said = rows(ran)
        assert said["error"] == "test.dvt:2: error: node 1 acknowledged the store, and that it keeps it is not proved"
        assert said["why"] == "RAM is kept over a reset, or the device stored on its own"
        assert said["hint"].endswith(" store --prove power` finds out")
        assert "8 PDOs read back equal after the reset, and could be lost at power-off" in said["state"]
        assert "0x1802:05 (event timer of TPDO3) is rolled back to 0, read back equal" in said["state"]
        assert said["state"].endswith("the changes of test.dvt:1 stay, read back equal")


def test_a_group_that_has_no_pdos_gets_the_hint_of_the_one_that_has() -> None:
    with sim() as bench:
        own = "dvtcli --sim generic"
        hint = f"`{own} store all --prove` takes and compares them; `{own} store` alone stores without a proof"
        assert rows(bench.run("store --prove application"))["hint"] == hint
        hint = f"`{own} restore all --prove` takes and compares them"
        assert rows(bench.run("restore --prove application"))["hint"] == hint


def test_a_restore_that_did_nothing_says_what_the_node_holds() -> None:
    with sim("restores-nothing") as bench:
        bench.script(MAP, "store")
        said = rows(bench.run("restore --prove"))
        assert said["error"] == "error: node 1 acknowledged the restore and does not hold its defaults"
        assert said["why"] == "after the reset TPDO1 differs from the defaults of generic.eds"
        assert said["state"] == "the node holds what is listed, read after the reset"


def test_a_state_that_was_not_taken_says_where_and_what_to_look_at() -> None:
    with sim("ignores-nmt") as bench:
        ran = bench.script("nmt preop", "nmt start")
        said = rows(ran)
        assert ran.code == 1
        assert said["error"] == "test.dvt:2: error: node 1 is PRE-OPERATIONAL, not OPERATIONAL as commanded"
        assert "not acknowledged" in said["why"]
        assert "1001" in said["hint"]
        assert said["state"].startswith("PRE-OPERATIONAL; nothing was written")


def test_all_nodes_that_did_not_obey_stand_in_one_error() -> None:
    with Bench(("generic", "generic@9"), {"fault": ("9:ignores-nmt", "1:ignores-nmt")}) as bench:
        said = rows(bench.run("nmt start all"))
        assert said["error"] == "error: nodes 1, 9 are PRE-OPERATIONAL, not OPERATIONAL as commanded"


@pytest.mark.parametrize(
    ("fault", "lines"),
    [("ignores-nmt", ["nmt start"]), ("keeps-ram", ["store --prove"]), ("stores-nothing", [MAP, "store --prove"])],
)
def test_a_program_gets_the_answer_and_then_the_error_with_the_words_of_the_screen(
    fault: str, lines: list[str]
) -> None:
    with sim(fault) as bench:
        ran = bench.script(*[f"{line} --json" for line in lines])
    with sim(fault) as bench:
        screen = bench.script(*lines).stderr
    *answers, error = ran.documents
    assert len(answers) == len(lines)
    assert all(answer["schema"] != "dvtcli.error/1" for answer in answers)
    assert (ran.code, error["schema"], error["exit_code"]) == (1, "dvtcli.error/1", 1)
    assert error["message"].startswith(f"test.dvt:{len(lines)}: error: ")
    assert {*error["message"].splitlines()} <= {*screen.splitlines()}
    assert "error" not in ran.stderr


def test_an_atomic_script_tells_the_reason_of_its_failing_line() -> None:
    with sim("ignores-nmt") as bench:
        before = bench.run("pdo tpdo1 --json").document["pdos"]
        ran = atomic(bench, MAP, "nmt start")
        said = rows(ran)
        assert ran.code == 1
        assert "node 1 is PRE-OPERATIONAL, not OPERATIONAL as commanded" in said["error"]
        assert said["state"].startswith("rolled back")
        assert bench.run("pdo tpdo1 --json").document["pdos"] == before


def test_a_store_that_is_not_proved_is_final_for_an_atomic_script() -> None:
    with sim("keeps-ram") as bench:
        ran = atomic(bench, MAP, "store --prove")
        said = rows(ran)
        assert ran.code == 7
        assert "it keeps it is not proved" in said["error"]
        assert "cannot be rolled back after that line" in said["error"]
        assert "nothing was stored" not in ran.stderr


# --- what a proof is about


@pytest.mark.parametrize(("written", "now"), [("6083 500", "6083:00: is 5000, expected 500"),
                                               ("1017 700", "1017:00: is 500 ms, expected 700 ms")])  # fmt: skip
def test_a_single_object_that_was_not_kept_is_no_proof(written: str, now: str) -> None:
    with sim("stores-nothing") as bench:
        assert bench.run(f"write {written}").code == 0
        ran = bench.run("store --prove --json")
        document = ran.answer
        assert (ran.code, document["proved"], document["stored"]) == (1, False, False)
        assert document["differences"] == [now]


def test_a_single_object_that_was_kept_is_counted() -> None:
    with sim() as bench:
        assert bench.run("write 1017 700").code == 0
        ran = bench.run("store --prove")
        assert ran.code == 0, ran.stderr
        assert "proved: after the reset 8 PDOs and 1 object read back equal" in ran.stdout
        document = bench.run("store --prove --json").answer
        assert (document["compared"], document["objects"], document["proved"]) == (8, 1, True)


def test_a_store_of_a_part_compares_only_what_it_takes() -> None:
    with sim() as bench:
        assert bench.run("write 6083 500").code == 0
        ran = bench.run("store --prove communication --json")
        document = ran.answer
        assert (ran.code, document["objects"], document["lost"]) == (0, 0, ["6083:00"])


def test_where_nothing_was_changed_no_proof_of_the_save_itself_is_claimed() -> None:
    with sim("stores-nothing") as bench:
        ran = bench.run("store --prove")
        assert ran.code == 0
        assert "dvtcli knows of no change since the last store" in ran.stdout
        assert "not that the save wrote it" in " ".join(ran.stdout.split())
    with sim() as bench:
        bench.run(MAP)
        assert "not that the save wrote it" not in bench.run("store --prove").stdout


@heavy
def test_a_device_that_refuses_the_canary_is_not_said_to_have_no_pdo_that_is_off() -> None:
    """It is asked before the store; where it takes the change then, and not after the store, that is said."""
    with sim(*(f"refuse@{number}=0x06090030" for number in range(1, 40))) as bench:
        ran = bench.run("store --prove --json")
    assert (ran.code, ran.document["state"]) == (1, "unchanged")
    assert "it has nothing that can be changed harmlessly to test the reset" in ran.document["why"]
    with sim("refuse@4=0x06090030") as bench:
        document = bench.run("store --prove --json").answer
    assert document["canary"] is None
    assert document["unproved"] == "it refused event timer of TPDO3 after the store, and took it before"
