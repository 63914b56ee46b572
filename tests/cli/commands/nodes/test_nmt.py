"""`nmt`: the state that a node is seen in decides, and a drive that is enabled is not reset unasked."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.abort import Abort
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.errors import NoAnswer
from dvtcli.files.eds.reader import parse_eds, read_eds
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy
from tests.virtual_time import VirtualTimeBus

#: an object that a device with node guarding has
_GUARDING = """
[100C]
ParameterName=Guard time
ObjectType=0x7
DataType=0x0006
AccessType=rw
DefaultValue=0
PDOMapping=0

[100D]
ParameterName=Life time factor
ObjectType=0x7
DataType=0x0005
AccessType=rw
DefaultValue=0
PDOMapping=0
"""


def guarded() -> StrictDevice:
    """A drive without heartbeats, whose state can be asked for by node guarding."""
    text = family_eds("generic").read_text("utf-8") + _GUARDING
    node = StrictDevice(parse_eds(text.encode(), "guarded.eds").dictionary, load_family("generic"), 1)
    node.set_value(0x1017, 0, b"\0\0")
    return node


def requests(wire: Wire) -> int:
    """How many node guarding requests were on the bus since the last look."""
    return sum(frame.arbitration_id == 0x701 and frame.is_remote_frame for frame in wire.frames())


@pytest.mark.parametrize(("command", "before"), [("start", None), ("preop", "start"), ("stop", None)])
@pytest.mark.parametrize("family", ["generic", "gen4"])
def test_a_node_that_does_not_obey_is_no_success(family: str, command: str, before: str | None) -> None:
    node = device(family)
    with Bench((), {"node": 1}, VirtualTimeBus([node], simulated=False)) as bench:
        if before is not None:
            assert bench.run(f"nmt {before} --json").document["state"] == "OPERATIONAL"
        node.ignores_nmt = True
        stays = "OPERATIONAL" if before else "PRE-OPERATIONAL"
        ran = bench.run(f"nmt {command}")
        assert ran.code == 1
        assert f"{stays}, not " in ran.stdout
        document = bench.run(f"nmt {command} --json").document
        assert (document["state"], document["nodes"]) == (stays, [{"node": 1, "state": stays}])


def test_the_fault_has_a_word() -> None:
    with Bench(("gen4",), {"fault": ("ignores-nmt",)}) as bench:
        assert bench.run("nmt start").code == 1
        assert bench.script("nmt start", "nmt preop").code == 1


def test_all_nodes_that_are_heard_are_confirmed() -> None:
    with Wire(device("generic", 1), device("tmcm", 9)) as wire, Bench((), wire.options) as bench:
        document = bench.run("nmt start all --json").document
        assert document["nodes"] == [{"node": 1, "state": "OPERATIONAL"}, {"node": 9, "state": "OPERATIONAL"}]
        assert document["wanted"] == "OPERATIONAL"


def test_one_of_all_that_does_not_obey_is_named() -> None:
    with Bench(("generic", "generic@9"), {"fault": ("9:ignores-nmt",)}) as bench:
        ran = bench.run("nmt start all")
        assert ran.code == 1
        assert "node 9: PRE-OPERATIONAL, not OPERATIONAL" in ran.stdout
        assert "node 1: OPERATIONAL\n" in ran.stdout


@pytest.mark.parametrize("line", ["nmt start all", "nmt stop all"])
def test_nodes_without_a_heartbeat_are_named_as_not_confirmed(line: str) -> None:
    """The command reaches them, and nothing shows that they obeyed."""
    silent = device("gen4", 2)
    silent.set_value(0x1017, 0, b"\0\0")
    with Bench((), {"node": 1}, VirtualTimeBus([device("gen4", 1), silent], simulated=False)) as bench:
        ran = bench.run(line)
        assert ran.code == 0
        assert "note: nodes without a heartbeat may have got it, too, unconfirmed: `dvtcli " in ran.stderr
        assert " scan` finds them" in ran.stderr


def test_what_cannot_be_seen_is_said_and_no_failure() -> None:
    node = device("generic")
    node.set_value(0x1017, 0, b"\0\0")
    with Bench((), {"node": 1}, VirtualTimeBus([node], simulated=False)) as bench:
        ran = bench.run("nmt start")
        assert ran.code == 0
        assert "not confirmed" in ran.stdout
        assert bench.run("nmt start --json").document["state"] is None


def test_node_guarding_shows_a_state_that_no_heartbeat_tells() -> None:
    node = guarded()
    with Wire(node) as wire, Bench((), wire.options) as bench:
        wire.frames()
        assert bench.run("nmt start --json").document["state"] == "OPERATIONAL"
        assert requests(wire) == 1
        node.ignores_nmt = True
        ran = bench.run("nmt preop --json")
        assert (ran.code, ran.document["state"]) == (1, "OPERATIONAL")


@pytest.mark.parametrize("guard_ms", [0, 100])
def test_a_life_that_is_guarded_is_not_asked_for(guard_ms: int) -> None:
    """The first request would start life guarding, and its end would be an error of the node."""
    node = guarded()
    node.set_value(0x100C, 0, guard_ms.to_bytes(2, "little"))
    node.set_value(0x100D, 0, b"\3")
    with Wire(node) as wire, Bench((), wire.options) as bench:
        wire.frames()
        assert bench.run("nmt start --json").document["state"] == (None if guard_ms else "OPERATIONAL")
        assert requests(wire) == (0 if guard_ms else 1)


def test_a_slow_heartbeat_is_waited_for() -> None:
    node = device("generic")
    node.set_value(0x1017, 0, (1800).to_bytes(2, "little"))
    with Bench((), {"node": 1}, VirtualTimeBus([node], simulated=False)) as bench:
        assert bench.run("nmt start --json").document["state"] == "OPERATIONAL"


# --- consent to a reset


@pytest.fixture
def eds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return str(family_eds("generic"))


@pytest.mark.drawn(2)
@pytest.mark.parametrize("line", ["nmt reset-node", "nmt reset-comm", "nmt reset-node all", "store --prove"])
def test_an_enabled_drive_is_not_reset_unasked(line: str, eds: str) -> None:
    node = device("generic")
    node.set_value(0x6041, 0, b"\x37\x12")
    with Wire(node) as wire, Bench((), {**wire.options, "eds": eds}) as bench:
        bench.run("nmt preop")
        wire.frames()
        ran = bench.run(line)
        assert ran.code == 6
        assert "operation enabled (0x6041 is 0x1237)" in ran.stderr
        written = [m for m in wire.frames() if m.arbitration_id == 0x601 and m.data[0] >> 5 == 1]
        assert written == [], "it was asked before anything was stored"
        assert node.state is NmtState.PRE_OPERATIONAL
        assert bench.run(f"{line} --yes").code == 0


@pytest.mark.drawn(1)
@pytest.mark.parametrize("line", ["nmt reset-node all", "nmt reset-comm all"])
@pytest.mark.parametrize("selected", [None, 1])
def test_all_are_listened_for_before_they_are_reset(line: str, selected: int | None, eds: str) -> None:
    """The first command of a session has heard nobody yet: an enabled drive may be among all."""
    still, node = device("generic", 1), device("generic", 9)
    still.set_value(0x6041, 0, b"\x50\x02")
    node.set_value(0x6041, 0, b"\x37\x12")
    with (
        Wire(still, node) as wire,
        Bench((), {**wire.options, "node": selected, "eds": eds}) as bench,
    ):
        ran = bench.run(line)
        assert ran.code == 6
        assert "node 9 has operation enabled (0x6041 is 0x1237)" in ran.stderr
        assert not any(frame.arbitration_id == 0 for frame in wire.frames()), "nothing was sent"
        document = bench.run(f"{line} --yes --json").document
        assert [one["node"] for one in document["nodes"]] == [1, 9], "their boot-ups were received"


@heavy
def test_where_nobody_is_heard_a_reset_of_all_is_asked_for(eds: str) -> None:
    quiet = device("generic")
    quiet.set_value(0x1017, 0, b"\0\0")
    with Wire(quiet) as wire, Bench((), {**wire.options, "node": None, "eds": eds}) as bench:
        bench.run("doctor")  # the boot-up of a node that was just switched on is over
        ran = bench.run("nmt reset-node all")
        assert ran.code == 6
        assert "no node is seen on the bus" in ran.stderr
        assert "--yes" in ran.stderr
        assert not any(frame.arbitration_id == 0 for frame in wire.frames())
        assert bench.run("nmt reset-node all --yes").code == 0


@pytest.mark.parametrize(("statusword", "code"), [(0x0250, 0), (0x1237, 6)])
def test_the_selected_node_counts_though_it_sends_no_heartbeat(statusword: int, code: int, eds: str) -> None:
    quiet = device("generic")
    quiet.set_value(0x1017, 0, b"\0\0")
    quiet.set_value(0x6041, 0, statusword.to_bytes(2, "little"))
    with Wire(quiet) as wire, Bench((), {**wire.options, "eds": eds}) as bench:
        ran = bench.run("nmt reset-node all --json")
        assert ran.code == code
        assert code or [one["node"] for one in ran.document["nodes"]] == [1]


@pytest.mark.parametrize("statusword", [0x0250, 0x1233, 0x1218])
def test_a_drive_that_is_not_enabled_is_reset(statusword: int, eds: str) -> None:
    node = device("generic")
    node.set_value(0x6041, 0, statusword.to_bytes(2, "little"))
    with Wire(node) as wire, Bench((), {**wire.options, "eds": eds}) as bench:
        assert bench.run("nmt reset-node").code == 0


class Hanging(StrictDevice):
    """A device whose application hangs: heartbeats and NMT go on, 0x6041 is answered as *code* says, or not at all."""

    code: int | None = None

    def upload(self, index: int, sub_index: int) -> bytes:
        if index == 0x6041 and self.code is not None:
            raise Refusal(Abort(self.code))
        return super().upload(index, sub_index)


@pytest.mark.drawn(2)
@pytest.mark.parametrize("line", ["nmt reset-node", "nmt reset-node all", "store --prove"])
@pytest.mark.parametrize(("code", "asked"), [(0x08000022, True), (0x06020000, False)])
def test_where_it_is_not_told_whether_a_drive_moves_it_is_asked(line: str, code: int, asked: bool, eds: str) -> None:
    node = Hanging(read_eds(family_eds("generic")).dictionary, load_family("generic"), 1)
    node.code = code
    with Wire(node) as wire, Bench((), {**wire.options, "eds": eds}) as bench:
        ran = bench.run(line)
        assert ran.code == (6 if asked else 0), ran.stderr
        assert not asked or "does not show whether its operation is enabled (0x6041: abort 0x08000022)" in ran.stderr
        assert bench.run(f"{line} --yes").code == 0


def test_a_node_that_is_heard_and_answers_nothing_is_asked_about(eds: str) -> None:
    """As one whose application hangs, whose heartbeats and NMT go on."""
    node = device("generic")
    with Wire(node) as wire, Bench((), {**wire.options, "eds": eds}) as bench:
        assert bench.run("nmt stop").code == 0
        bench.session.bus.set_timeout(0.1)
        ran = bench.run("nmt reset-node --json")
        assert (ran.code, ran.document["node"]) == (6, 1)
        assert "STOPPED" in ran.document["text"]
        assert bench.run("nmt reset-node --yes").code == 0
        with Bench((), {**wire.options, "node": 9, "timeout": 0.1}) as other:
            ran = other.run("nmt reset-node")
            assert ran.code == 6
            assert "node 9 does not answer a read of its statusword (0x6041)" in ran.stderr


def test_all_are_reset_or_who_is_not_is_named() -> None:
    from dvtcli.device.resets import reset_all_and_wait

    bus = VirtualTimeBus([device("generic", 3)])
    reset_all_and_wait(bus, NmtCommand.RESET_NODE, {3})
    assert bus.boot_ups(3) == 2
    with pytest.raises(NoAnswer, match="from node 4"):
        reset_all_and_wait(bus, NmtCommand.RESET_NODE, {3, 4})


@pytest.mark.parametrize("line", ["nmt reset-node all", "nmt start all"])
def test_a_dry_run_listens_and_says_whom_it_would_reach(line: str, eds: str) -> None:
    with (
        Wire(device("generic", 1), device("generic", 9)) as wire,
        Bench((), {**wire.options, "node": None, "eds": eds}) as bench,
    ):
        document = bench.run(f"{line} --dry-run --json").document
        assert [one["node"] for one in document["nodes"]] == [1, 9]
        assert document["dry_run"] is True
        sent = [frame for frame in wire.frames() if frame.arbitration_id == 0]
        assert sent == []


def test_what_is_asked_of_one_node_names_it_in_json(eds: str) -> None:
    with Bench(("gen4@3",)) as bench:
        assert bench.run("nmt start").code == 0
        ran = bench.run("set tpdo1 --timer 20 --json")
        assert (ran.code, ran.document["node"]) == (6, 3)
        assert bench.run("restore --json").document["node"] == 3


def test_a_reset_without_a_boot_up_message_is_said() -> None:
    with Bench(("no-boot-up",), {"yes": True}) as bench:
        ran = bench.run("nmt reset-node 1")
    assert (ran.code, "sent no boot-up message, and answers: whether it restarted is not known" in ran.stderr) == (
        0,
        True,
    )


@pytest.mark.parametrize("word", ["pre-op", "PRE-OP", "preop"])
def test_the_state_as_answers_write_it_is_a_command(word: str) -> None:
    with Bench() as bench:
        assert bench.run("nmt start --yes").code == 0
        assert bench.run(f"nmt {word} --json").document["state"] == "PRE-OPERATIONAL"
