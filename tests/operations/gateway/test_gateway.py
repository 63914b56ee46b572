"""`gateway`: other programs read, write and command through it, and nothing that they say upsets it."""

from __future__ import annotations

import re
import socket
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import canopen
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dvtcli.domain.gateway_words import LONGEST_LINE, Dialect, Failed, format_answer
from dvtcli.errors import BusUnavailable, DvtcliError, LeftChanged, SafetyRefusal
from dvtcli.operations.gateway.serve_gateway import gateway
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench
from tests.operations.gateway.clients import BridgedNode, Client, Heard, served
from tests.operations.gateway.networks import FAMILIES, everything, network_file, options
from tests.process import PATIENCE_S


def test_it_reads_writes_and_commands() -> None:
    received = Heard()
    with served("generic@4", reporter=received) as (_, running), Client(running) as client:
        assert client.ask("info version").startswith("dvtcli ")
        assert client.ask("4 r 0x1017 0 u16") == "500"
        assert client.ask("r 0x1017 0 u16").startswith("ERROR:105 #")
        assert client.ask("set node 4") == "OK"
        assert client.ask("w 0x1017 0 u16 1234") == "OK"
        assert client.ask("1 4 r 0x1017 0") == "1234"
        assert client.ask("r 0x1017 0 x16") == "0x04D2"
        assert client.ask("r 0x1017 0 hex") == "D2 04"
        assert client.ask("preop") == "OK"
        assert client.ask("set sdo_timeout 700") == "OK"
        assert client.ask("set sdo_timeout 5001").startswith("ERROR:101 #")
        assert client.ask("w 0x1010 1 vs save") == "OK"
        assert client.ask("reset node") == "OK"
        client.wait("1 4 BOOT_UP")
        assert client.ask("r 0x1017 0 u16") == "1234"
    assert any("connected" in one for one in received.said)
    assert "node 4: 0x1017:00 <- D2 04" in received.said


def test_errors_have_the_standards_numbers() -> None:
    with served("generic@4") as (_, running), Client(running) as client:
        assert client.ask("4 r 0x5FFF 0 u8").startswith("ERROR:0x06020000 #")
        assert client.ask("4 w 0x1000 0 u32 1").startswith("ERROR:0x06010002 #")
        assert client.ask("4 r 0x1000 0 u8").startswith("ERROR:0x06070010 #")
        assert client.ask("4 fly").startswith("ERROR:100 #")
        assert client.ask("4 r").startswith("ERROR:101 #")
        assert client.ask("2 4 r 0x1000 0").startswith("ERROR:106 #")
        assert client.ask("200 r 0x1000 0").startswith("ERROR:107 #")
        assert client.ask("set network 2").startswith("ERROR:106 #")
        assert client.ask("set node 0").startswith("ERROR:107 #")
        assert client.ask("4 w 0x1010 1 vs load").startswith("ERROR:0x08000020 #")
        assert client.ask("init 3").startswith("ERROR:100 #")
        assert client.ask("9 r 0x1000 0").startswith("ERROR:103 #")
        client.say(b"4 r 0x1017 0 u16\n# nothing\n\n4 r 0x1017 0 u16\n")
        assert (client.line(), client.line()) == ("500", "500")


def test_what_is_not_ascii_is_said_by_what_looks_like_it() -> None:
    said = format_answer(1, Failed(0x06090030, "bits 0\u201330 of a COB-ID\u2026 in \u00b5s\x1b\u96fb"), Dialect.HASH)
    assert said == "[1] ERROR:0x06090030 #bits 0-30 of a COB-ID... in us??"


def test_who_is_not_there_is_not_told_and_not_ok() -> None:
    with served("generic@4") as (_, running), Client(running) as client:
        assert client.ask("77 r 0x1017 0 u16").startswith("ERROR:103 #node 77 did not answer for 0x1017:00")
        assert client.ask("77 w 0x1017 0 u16 5").startswith("ERROR:103 #node 77 did not answer for 0x1017:00")


@pytest.mark.long
@pytest.mark.drawn(1)
@pytest.mark.parametrize("command", ["start", "stop", "preop", "reset comm"])
def test_a_command_to_nobody_is_not_ok(command: str) -> None:
    with served("generic@4") as (_, running), Client(running) as client:
        assert client.ask(f"7 {command}").startswith("ERROR:103 #")
        assert client.ask("4 stop") == "OK"
        assert client.ask("4 stop") == "OK"
        assert client.ask("0 preop") == "OK"


def test_a_command_to_a_node_that_tells_no_state_is_not_ok() -> None:
    with served("generic@4", in_virtual_time=True) as (_, running), Client(running) as client:
        assert client.ask("4 w 0x1017 0 u16 0") == "OK"
        assert client.ask("4 start").startswith(
            "ERROR:103 #sent, and not seen to be obeyed: node 4 does not report its NMT state"
        )


def test_who_resets_a_node_that_is_not_there_waits_alone() -> None:
    """Others are answered meanwhile, but for the node itself; the client's next line has its turn after the answer."""
    received = Heard()
    with (
        served("generic@4", reporter=received, in_virtual_time=True) as (_, running),
        Client(running) as first,
        Client(running) as second,
        Client(running) as third,
    ):
        first.say(b"[1] 7 reset node\r\n[2] 4 r 0x1017 0\r\n")
        while "node 7: nmt reset-node" not in received.said:
            assert second.ask("4 r 0x1017 0") == "500"
        third.say(b"[1] 7 r 0x1017 0\r\n")
        assert second.ask("4 w 0x1017 0 u16 9") == "OK"
        assert second.ask("info version").startswith("dvtcli ")
        assert not first.is_answered()
        while not first.is_answered():
            assert second.ask("9 r 0x1017 0").startswith("ERROR:103 #")  # makes time go on
        assert first.line().startswith(
            "[1] ERROR:103 #node 7 sent neither a boot-up message nor an answer within 10 s after its reset"
        )
        assert first.line() == "[2] 9"
        assert third.line().startswith("[1] ERROR:103 #node 7 did not answer")


def test_a_reset_ends_though_its_client_has_gone() -> None:
    received = Heard()
    with served("generic@4", reporter=received) as (session, running), Client(running) as client:
        assert client.ask("4 w 0x1017 0 u16 9") == "OK"
        with Client(running) as hasty:
            hasty.say(b"4 reset node\r\n")
            while "node 4: nmt reset-node" not in received.said:
                assert client.ask("info version").startswith("dvtcli ")
        assert client.ask("4 r 0x1017 0") == "500", "it waited for the restart"
        assert "nmt reset-node" in [line for _, line in session.record.lines]


def test_the_other_dialect() -> None:
    with served("generic@4", dialect=Dialect.PAREN) as (_, running), Client(running) as client:
        assert client.ask("4 r 0x5FFF 0 u8").startswith("ERROR: 06020000 (")
        assert client.ask("4 fly").startswith("ERROR: 100 (")


def test_without_allow_changes_nothing_is_written() -> None:
    with served("generic@4", allow_changes=False) as (session, running), Client(running) as client:
        for line in (
            "4 w 0x1017 0 u16 9",
            "4 start",
            "0 reset node",
            "4 w 0x1010 1 vs save",
            "lss_store",
            "lss_set_node 9",
        ):
            assert client.ask(line).startswith("ERROR:102 #read-only")
        assert client.ask("4 r 0x1017 0 u16") == "500"
        assert not session.record.lines


def test_without_allow_changes_no_slave_is_taken_out_of_waiting() -> None:
    with served("gen4@4", allow_changes=False) as (session, running), Client(running) as client:
        for line in ("lss_switch_sel 0x1E 0x0705302D 0x00030000 0x00012345", "lss_switch_glob 1", "_lss_fastscan"):
            assert client.ask(line).startswith("ERROR:102 #read-only"), line
        assert not [frame for frame, ours in session.bus.exchanged() if ours and frame.can_id == 0x7E5]
        assert client.ask("lss_switch_glob 0") == "OK"
        assert client.ask("lss_identity 0x1E 0x0705302D 0 0xFFFFFFFF 0 0xFFFFFFFF") == "OK"


def test_a_dry_run_changes_a_twin() -> None:
    with served("generic@4", dry_run=True) as (session, running):
        with Client(running) as client:
            assert client.ask("4 w 0x1017 0 u16 9") == "OK"
            assert client.ask("4 r 0x1017 0 u16") == "9"
            for line in ("lss_switch_sel 1 2 3 4", "lss_set_node 5", "lss_store"):
                assert client.ask(line).startswith("ERROR:102 #dry run")
        assert session.wire.sdo(4).upload(0x1017, 0) == (500).to_bytes(2, "little")


def test_lss() -> None:
    with served("gen4@4") as (_, running), Client(running) as client:
        assert client.ask("lss_inquire_addr").startswith("ERROR:501 #")
        assert client.ask("lss_switch_glob 0") == "OK"
        assert client.ask("lss_conf_bitrate 0 2").startswith("ERROR:100 #")
        assert client.ask("_lss_fastscan").startswith("ERROR:103 #")
        assert client.ask("lss_ident_nonconf").startswith("ERROR:103 #")


def test_a_slave_that_was_selected_waits_again() -> None:
    """An order of another master, to whoever is being configured, does not reach it; each order selects it anew."""
    with served("gen4@4") as (session, running), Client(running) as client:
        assert client.ask("lss_switch_sel 0x1E 0x0705302D 0x00030000 0x00012345") == "OK"
        sent = [frame for frame, ours in session.bus.exchanged() if ours and frame.can_id == 0x7E5]
        assert sent[-1].data[:2] == bytes([0x04, 0]), "switch state global: waiting"
        assert client.ask("lss_get_node") == "4"
        assert client.ask("lss_switch_glob 0") == "OK"
        assert client.ask("lss_get_node").startswith("ERROR:501 #")


def test_who_one_client_selected_is_not_what_another_configures() -> None:
    with served("gen4@4") as (_, running), Client(running) as first, Client(running) as second:
        assert first.ask("lss_switch_sel 0x1E 0x0705302D 0x00030000 0x00012345") == "OK"
        assert second.ask("lss_set_node 9").startswith("ERROR:501 #")
        assert second.ask("lss_switch_sel 0x1E 0x0705302D 0x00030000 0x00012345") == "OK"
        assert second.ask("lss_set_node 9") == "OK"
        assert second.ask("lss_switch_glob 0") == "OK"
        assert first.ask("lss_get_node") == "9"
        assert first.ask("lss_store") == "OK"


@pytest.mark.parametrize("allow_changes", [False, True])
def test_a_heartbeat_that_is_missed_is_said_to_who_watches_it(allow_changes: bool) -> None:
    with (
        served("generic@4", allow_changes=allow_changes, in_virtual_time=True) as (session, running),
        Client(running) as client,
        Client(running) as other,
    ):
        assert client.ask("4 enable heartbeat 1200") == "OK"
        while "1 4 ERROR 202 #Heartbeat started" not in client.events:
            assert client.ask("9 r 0x1017 0").startswith("ERROR:103 #")  # makes time go on
        session.wire.sdo(4).download(0x1017, 0, bytes(2))
        while "1 4 ERROR 203 #Heartbeat lost" not in client.events:
            assert client.ask("9 r 0x1017 0").startswith("ERROR:103 #")
        session.wire.sdo(4).download(0x1017, 0, (500).to_bytes(2, "little"))
        while client.events.count("1 4 ERROR 202 #Heartbeat started") < 2:
            assert client.ask("9 r 0x1017 0").startswith("ERROR:103 #")
        assert client.ask("4 disable heartbeat") == "OK"
        session.wire.sdo(4).download(0x1017, 0, bytes(2))
        said = list(client.events)
        for _ in range(10):
            assert client.ask("9 r 0x1017 0").startswith("ERROR:103 #")
        assert client.events == said
        assert other.ask("info version")
        assert not other.events


def test_a_heartbeat_that_is_watched_again_has_its_new_time() -> None:
    with (
        served("generic@4", dialect=Dialect.PAREN, in_virtual_time=True) as (_, running),
        Client(running) as client,
    ):
        for words in ("enable heartbeat 0", "enable heartbeat 65536", "enable heartbeat", "disable heartbeat 1"):
            assert client.ask(f"4 {words}").startswith("ERROR: 101 (")
        assert client.ask("enable heartbeat 100").startswith("ERROR: 105 (")
        for node_id in (0, 128):
            assert client.ask(f"{node_id} enable heartbeat 100").startswith("ERROR: 107 (")
        assert client.ask("4 disable heartbeat") == "OK"
        assert client.ask("4 enable heartbeat 60000") == "OK"
        assert client.ask("4 enable heartbeat 100") == "OK", "shorter than the node's time"
        while client.events.count("1 4 ERROR 203 (Heartbeat lost)") < 2:
            assert client.ask("9 r 0x1017 0").startswith("ERROR: 103 (")
        with Client(running) as gone:
            assert gone.ask("4 enable heartbeat 100") == "OK"
        assert client.ask("4 r 0x1017 0") == "500"


def test_what_a_gateway_that_is_no_node_has_not_is_said() -> None:
    with served("generic@4") as (_, running), Client(running) as client:
        for words, why in (
            ("set id 5", "not a node of the bus"),
            ("set heartbeat 100", "not a node of the bus"),
            ("4 enable guarding 100 3", "enable heartbeat"),
            ("4 disable guarding", "enable heartbeat"),
            ("init 3", "where the gateway is started"),
            ("set sdo_block 1", "by itself"),
            ("lss_switch_glob 1", "lss_switch_sel"),
            ("lss_conf_bitrate 0 2", "dvtcli changes the rate of all"),
            ("lss_activate_bitrate 100", "dvtcli changes the rate of all"),
        ):
            said = client.ask(words)
            assert said.startswith("ERROR:100 #"), words
            assert why in said, words
        assert client.ask("set command_size 65536") == "OK"
        assert client.ask("set command_size 65537").startswith("ERROR:600 #")
        assert client.ask("set command_size 0").startswith("ERROR:101 #")


def test_what_comes_from_elsewhere_is_refused() -> None:
    with Session(Options(sim=("generic",))) as session:
        with pytest.raises(SafetyRefusal, match=r"192\.0\.2\.1 is not a loopback"), gateway(session, ("192.0.2.1", 0)):
            pass
        with socket.create_server(("127.0.0.1", 0)) as taken:
            where = ("127.0.0.1", taken.getsockname()[1])
            with pytest.raises(BusUnavailable, match="cannot listen"), gateway(session, where):
                pass


def test_idle_hostile_and_leaving_clients_stop_nobody() -> None:
    received = Heard()
    with served("generic@4", reporter=received) as (_, running), Client(running) as client:
        with Client(running), Client(running) as half, Client(running) as long, Client(running) as gone:
            half.say(b"[1] 4 r 0x10")
            long.say(b"x" * (LONGEST_LINE + 70_000))
            gone.say(b"[1] 4 r 0x1017 0 u16\r\n" * 50)
            gone.link.shutdown(socket.SHUT_RDWR)
            assert client.ask("4 r 0x1017 0 u16") == "500"
            assert long.reply() == ""
            half.say(b"17 0 u16\r\n")
            assert half.reply() == "[1] 500"
        assert client.ask("4 r 0x1017 0 u16") == "500"
    assert any("a line of more than" in one for one in received.said)


@pytest.mark.parametrize("method", ["POST", "GET", "OPTIONS"])
def test_what_a_browser_posts_is_not_carried_out(method: str) -> None:
    received = Heard()
    body = "[1] 4 w 0x1017 0 u16 777\n[2] 0 start\n"
    head = f"{method} / HTTP/1.1\r\nHost: localhost:60000\r\nContent-Type: text/plain\r\n\r\n"
    with served("generic@4", reporter=received) as (session, running), Client(running) as client:
        with Client(running) as page, Client(running) as slow:
            page.say((head + body).encode())
            assert page.reply() == ""
            slow.say(head[:9].encode())
            assert client.ask("4 r 0x1017 0 u16") == "500"
            with suppress(ConnectionError):
                slow.say((head[9:] + body).encode())
            assert slow.reply() == ""
        assert client.ask("4 r 0x1017 0 u16") == "500"
        assert not session.record.lines
    assert sum("an HTTP request, as a web page sends it" in one for one in received.said) == 2


@given(st.lists(st.binary(max_size=40) | st.text('[]0194 "#rwxsetnodelpu', max_size=40).map(str.encode), max_size=20))
def test_whatever_is_said_the_next_line_is_answered(said: list[bytes]) -> None:
    with served("generic@4", allow_changes=False) as (_, running), Client(running) as client:
        client.say(b"\n".join([*said, b""]))
        assert client.answer("[4294967295] 4 r 0x1017 0 u16") == "500"


@pytest.mark.long
@settings(max_examples=max(2, settings().max_examples // 4))  # of each, two devices from their start on
@given(st.sampled_from(FAMILIES), options())
def test_lines_through_the_gateway_make_the_device_that_apply_makes(family: str, config: str) -> None:
    path = network_file(Path(), config)
    with Bench((f"{family}@4",), {"yes": True}) as applied:
        code = applied.run(f"apply {path}").code
        assert applied.run(f"plan {path}").code == code
        held = everything(applied)
    with Bench((f"{family}@4",), {"yes": True}) as bench:
        assert bench.run(f"plan {path} -o lines.309").code == code
    if not code:
        with served(f"{family}@4") as (session, running):
            with Client(running) as client:
                answers = client.execute(Path("lines.309").read_text())
                assert set(answers) <= {"OK"}, answers
            node = session.node(4)
            node.read_anew()
            assert (dict(node.pdos()), node.upload(0x1017, 0)) == held


def test_canopen_sets_a_pdo_through_it() -> None:
    eds = family_eds("generic")
    with served("generic@4") as (session, running), Client(running) as client:
        assert client.ask("4 preop") == "OK"
        node = BridgedNode(client, 4, canopen.import_od(str(eds), 4))
        node.tpdo.read()
        pdo = node.tpdo[1]
        pdo.clear()
        pdo.add_variable(0x606C, 0)
        pdo.add_variable(0x6041, 0)
        pdo.enabled, pdo.trans_type, pdo.cob_id = True, 1, 0x1A4
        pdo.save()
        device = session.node(4)
        device.read_anew()
        config = next(config for name, config in device.pdos().items() if str(name) == "tpdo1")
        assert (config.enabled, config.communication.cob_id.can_id) == (True, 0x1A4)
        assert [(entry.index, entry.bits) for entry in config.mapping] == [(0x606C, 32), (0x6041, 16)]


def test_pdos_of_the_gateway_itself() -> None:
    with served("generic@4") as (_, running), Client(running) as client:
        assert client.ask("r p 1").startswith("ERROR:102 #")
        assert client.ask("set rpdo 1 0x301 event 3 0x2000 0 u16 u8 0x2001 0 i8") == "OK"
        assert client.ask("set rpdo 2 0x301 event 0").startswith("ERROR:400 #")
        assert client.ask("r p 1").startswith("ERROR:102 #no frame")
        assert client.ask("set tpdo 1 0x601 event 0").startswith("ERROR:0x06090030 #")
        assert client.ask("set tpdo 1 0x201 sync1 0").startswith("ERROR:100 #")
        assert client.ask("set tpdo 1 0x201 event 2 0 0 u64 0 0 u8").startswith("ERROR:401 #")
        assert client.ask("set tpdo 1 0x201 event 2 0 0 i16 0 0 u8") == "OK"
        assert client.ask("w p 1 1 5").startswith("ERROR:101 #")
        assert client.ask("w p 1 2 -2 256").startswith("ERROR:101 #")
        assert client.ask("w p 1 2 -2 7") == "OK"
        assert client.ask("set tpdo 1 0x80000201 event 0") == "OK"
        assert client.ask("w p 1 2 -2 7").startswith("ERROR:102 #")


def test_a_frame_of_a_node_is_read_as_a_pdo() -> None:
    with served("generic@4") as (_, running), Client(running) as client:
        assert client.ask("set rpdo 1 0x184 event 1 0x6041 0 u16") == "OK"
        mapped = ("w 0x1800 1 u32 0x80000184", "w 0x1A00 0 u8 0", "w 0x1A00 1 u32 0x60410010", "w 0x1A00 0 u8 1")
        for line in ("preop", *mapped, "w 0x1800 2 u8 255", "w 0x1800 1 u32 0x184", "start"):
            assert client.ask(f"4 {line}") == "OK", line
        said = client.ask("r p 1")
        while said.startswith("ERROR:102"):  # until the first frame came
            said = client.ask("r p 1")
        assert said == f"1 pdo 1 {client.ask('4 r 0x6041 0 u16')}"


def test_a_pdo_that_is_set_up_again_has_heard_nothing() -> None:
    with served("generic@4", "generic@5") as (_, running), Client(running) as client:
        for line in ("set rpdo 1 0x585 event 0", "set rpdo 1 0x705 event 1 0 0 u8"):
            assert client.ask(line).startswith("ERROR:0x06090030 #"), "no PDO's CAN-ID"
        assert client.ask("set rpdo 1 0x301 event 1 0 0 u8") == "OK"
        assert client.ask("set rpdo 2 0x40000301 event 0").startswith("ERROR:400 #"), "the same frame without RTR"
        assert client.ask("set rpdo 1 0x185 event 1 0x6041 0 u16") == "OK"
        mapped = ("w 0x1800 1 u32 0x80000185", "w 0x1A00 0 u8 0", "w 0x1A00 1 u32 0x60410010", "w 0x1A00 0 u8 1")
        for line in ("preop", *mapped, "w 0x1800 2 u8 255", "w 0x1800 1 u32 0x185", "start"):
            assert client.ask(f"5 {line}") == "OK", line
        while client.ask("r p 1").startswith("ERROR:102"):
            pass
        assert client.ask("5 stop") == "OK"
        for line in ("set rpdo 1 0x80000185 event 0", "set rpdo 1 0x185 event 1 0x6041 0 u16"):
            assert client.ask(line) == "OK"
        assert client.ask("r p 1").startswith("ERROR:102 #no frame")


_WORDS = (
    "r", "w", "p", "pdo", "set", "rpdo", "tpdo", "node", "network", "sdo_timeout", "start", "stop", "reset", "comm",
    "lss_switch_sel", "lss_switch_glob", "lss_conf_bitrate", "lss_identity", "lss_inquire_addr", "lss_set_node",
    "lss_store", "_lss_fastscan", "init", "help",
    "enable", "disable", "heartbeat", "guarding", "id", "command_size",
    "event", "sync1", "u8", "u64", "vs", "hex", "d", "td", '"', '""', "0", "1", "4", "-1", "0x1017", "0x1A00", "0x301",
    "255", "4294967295", "99999999999", "1e9", "[3]",
)  # fmt: skip


@given(st.lists(st.lists(st.sampled_from(_WORDS), min_size=1, max_size=7).map(" ".join), max_size=12))
def test_right_words_in_any_order_are_answered_once_each(lines: list[str]) -> None:
    with served("generic@4", allow_changes=False) as (_, running), Client(running) as client:
        client.say(
            "".join(f"[{number}] set sdo_timeout 1\n[{number}] {line}\n" for number, line in enumerate(lines)).encode()
        )
        last = client.answer("[4294967295] set network 1")
        assert last == "OK"
        assert len([one for one in client.events if re.match(r"\[\d+\] ", one)]) == 2 * len(lines)


def test_a_signal_ends_it_at_once_also_after_a_change() -> None:
    with served("gen4@4") as (session, running), Client(running) as client:
        for words in (
            "4 w 0x1017 0 u16 9",
            "4 preop",
            "4 w 0x5FFF 0 u8 1",
            "lss_switch_sel 0x1E 0x0705302D 0x00030000 0x00012345",
            "lss_set_node 5",
            "lss_store",
        ):
            client.ask(words)
            assert session.cancellation.asked(130, insists=True), words


@pytest.mark.parametrize(
    ("fault", "told", "state"),
    [(("4:bus-error@2",), LeftChanged, "left_changed"), ((), BusUnavailable, "unknown")],
)
def test_a_bus_that_is_gone_after_a_write_is_not_said_to_have_changed_nothing(
    fault: tuple[str, ...], told: type[DvtcliError], state: str
) -> None:
    with (
        Session(Options(sim=("generic@4",), fault=fault, yes=True)) as session,
        gateway(session, ("127.0.0.1", 0), allow_changes=True) as running,
        ThreadPoolExecutor() as pool,
    ):
        ran = pool.submit(running.run)
        with Client(running) as client:
            assert client.ask("4 w 0x1017 0 u16 700") == "OK"
            if fault:
                assert client.ask("4 w 0x1017 0 u16 800").startswith("ERROR:102 #")
            else:
                session.bus.close()
            client.say(b"[9] 4 r 0x1017 0 u16\r\n")
            with pytest.raises(told) as ended:
                ran.result(PATIENCE_S)
    assert ended.value.state == state
