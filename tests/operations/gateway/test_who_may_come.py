"""Who is let in to a gateway, what is told of it, and that nobody makes the others wait."""

from __future__ import annotations

import errno
import signal
import socket
import stat
import subprocess
import sys
from collections import deque
from contextlib import ExitStack
from pathlib import Path

import pytest

from dvtcli.errors import BusUnavailable, SafetyRefusal, UsageError
from dvtcli.operations.gateway.gateway_work import WAITING_S
from dvtcli.operations.gateway.line_client import LineClient
from dvtcli.operations.gateway.serve_gateway import gateway, listen_address, serve_gateway
from dvtcli.operations.results import Facts
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from tests.cli.commands.program.settings_bench import STRANGER, WHY_NOT, as_user
from tests.operations.gateway.clients import Client, Heard, served
from tests.process import PATIENCE_S, documents, environment, start
from tests.simulator.serve.served import wait_for

UNIX = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no Unix sockets in Python")
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells whose a connection is")
#: connects, says a line, and prints what comes
ASK = """
import socket, sys
with socket.create_connection(("127.0.0.1", int(sys.argv[1]))) as link:
    link.settimeout(20)
    try:
        link.sendall(b"[1] 4 r 0x1017 0 u16\\n")
        while b"[1]" not in (came := link.recv(100)) and came:
            pass
    except ConnectionError:
        came = b""
print(came.decode())
"""


@UNIX
def test_a_unix_socket_is_its_users_alone_and_stands_beside_tcp(tmp_path: Path) -> None:
    path = tmp_path / "g.sock"
    with Session(Options(sim=("generic@4",))) as session:
        for wrong in (tmp_path, tmp_path / "no" / "x", tmp_path / ("x" * 120), Path(__file__)):
            with (
                pytest.raises(UsageError, match=r"unix:.*: (it is a|there is|no such folder|the path of a socket)"),
                gateway(session, str(wrong)),
            ):
                pass
        for wrong in ("unix:", "unix:a\0b", "nowhere"):
            with pytest.raises(UsageError):
                listen_address(wrong)
        with gateway(session, ("127.0.0.1", 0), listen_address(f"unix:{path}")) as first:
            assert stat.S_IMODE(path.stat().st_mode) == 0o600
            assert first.hub.port
            with pytest.raises(BusUnavailable, match="cannot listen on unix:"), gateway(session, str(path)):
                pass
            left_over = tmp_path / "left.sock"
            with socket.socket(socket.AF_UNIX) as gone:
                gone.bind(str(left_over))
            with gateway(session, str(left_over)) as second:
                assert second.hub.port is None
            assert not left_over.exists(), "it goes with its gateway"
            file = tmp_path / "a file"
            file.write_text("kept")
            with pytest.raises(UsageError, match="there is a file"), gateway(session, str(file)):
                pass
            assert file.read_text() == "kept"
            everybody = tmp_path / "everybody"
            everybody.mkdir()
            everybody.chmod(0o777)
            with pytest.raises(SafetyRefusal, match="writable by everybody"), gateway(session, str(everybody / "g")):
                pass
        assert not path.exists()


@UNIX
def test_json_says_on_stderr_who_came_and_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "g.sock"
    words = ["--sim", "generic@4", "--json", "gateway", "--listen", f"unix:{path}", "--allow-changes"]
    process = start(words, env=environment())
    with socket.socket(socket.AF_UNIX) as link:
        link.settimeout(PATIENCE_S)

        def listens() -> bool:
            """Its socket has a name before it listens."""
            return link.connect_ex(str(path)) == 0 or process.poll() is not None

        wait_for(listens, "the gateway")
        link.sendall(b"[1] 4 w 0x1017 0 u16 400\n")
        came = b""
        while b"[1] OK" not in came:
            came += link.recv(100)
    process.send_signal(signal.SIGINT)
    said, error = process.communicate(timeout=PATIENCE_S)
    begun = documents(said)[0]
    assert (begun["host"], begun["port"], begun["path"]) == (None, None, str(path))
    told = [
        one
        for one in documents("".join(line for line in error.splitlines(keepends=True) if line[0] == "{"))
        if one["schema"] == "dvtcli.gateway-event/1"
    ]
    connected, written = (next(one for one in told if one["event"] == wanted) for wanted in ("connected", "written"))
    assert connected["client"] == written["client"]
    assert (written["node"], written["object"], written["data"]) == (4, "1017:00", "90 01")


def test_a_passcode_is_not_told() -> None:
    received = Heard()
    with served("gen4-locked@1", reporter=received) as (_, running), Client(running) as client:
        assert client.ask("1 w 0x5000 2 u16 0x4444").startswith("ERROR:102 #0x5000:02 is a passcode")
    assert not any("44 44" in one or "4444" in one for one in received.said)


@LINUX
@pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)
@pytest.mark.parametrize("any_user", [False, True])
def test_another_user_is_not_let_in(any_user: bool) -> None:
    received = Heard()
    with served("generic@4", reporter=received, any_user=any_user) as (_, running), Client(running) as own:
        asked = [*as_user(STRANGER), sys.executable, "-c", ASK, str(running.hub.port)]
        answer = subprocess.run(asked, capture_output=True, encoding="ascii", timeout=PATIENCE_S, check=True).stdout
        assert ("[1] 500" in answer) == any_user
        assert own.ask("4 r 0x1017 0 u16") == "500"
    refused = [one for one in received.said if one.startswith("refused client") and f"user {STRANGER}" in one]
    assert bool(refused) != any_user


@LINUX
@pytest.mark.parametrize("any_user", [False, True])
def test_who_has_closed_already_is_nobody_known(any_user: bool) -> None:
    """Linux says user 0 of a connection that its program has closed, whose ever it was."""
    received = Heard()
    with Session(Options(sim=("generic@4",))) as session:
        session.reporter = received
        with gateway(session, ("127.0.0.1", 0), any_user=any_user) as running:
            with socket.create_connection(("127.0.0.1", running.hub.port or 0)) as link:
                link.sendall(b"[1] 4 w 0x1017 0 u16 7\n")
            running.hub.wait(1.0, lambda _client: True)
            assert running.hub.clients == any_user
    refused = [said for said in received.said if said.startswith("refused client")]
    assert len(refused) == (not any_user)
    assert all("its owner is not known, or it has closed already" in said for said in refused)


def test_every_port_is_told() -> None:
    begun: list[Facts] = []

    def end(facts: Facts) -> None:
        begun.append(facts)
        raise KeyboardInterrupt

    with Session(Options(sim=("generic@4",))) as session, pytest.raises(KeyboardInterrupt):
        serve_gateway(session, [("127.0.0.1", 0), ("127.0.0.1", 0)], end)
    rows = dict(begun[0].rows)
    first, second = rows["listen"]
    assert first == f"127.0.0.1:{rows['port']}"
    assert first != second
    assert f"listening on {first} and {second} " in str(begun[0].text[0])


def test_a_newcomer_is_next_after_the_line_under_way() -> None:
    """Two hundred who talk of silent nodes keep nobody out: the next line is that of who had none of the time."""
    with (
        Session(Options(sim=("generic@4",), timeout=0.001)) as session,
        gateway(session, ("127.0.0.1", 0)) as running,
        ExitStack() as stack,
    ):

        def received(wanted: int) -> None:
            """Let clients in, and hear them, until that many have said lines."""
            for _ in range(1000):
                running.hub.wait(0.001, lambda _client: True)
                if sum(bool(one.lines) for one in _clients(running.hub.connected)) >= wanted:
                    return
            raise AssertionError("somebody was not let in")

        for number in range(200):
            talker = stack.enter_context(Client(running))
            talker.say(b"".join(b"[1] %d r 0x1018 1 u32\n" % (5 + (number + at) % 100) for at in range(9)))
        received(200)
        for _ in range(3):
            running._answer_lines()
        for number in range(4):  # whoever was next otherwise
            waiting = sum(bool(one.lines) for one in _clients(running.hub.connected))
            newcomer = stack.enter_context(Client(running))
            newcomer.say(b"[7] 4 r 0x1017 0 u16\n" * 2)
            received(waiting + 1)
            ready = [one for one in _clients(running.hub.connected) if one.lines]
            assert _is(running._next(ready), newcomer), f"newcomer {number} waits for a second line"
            heard_client = next(one for one in ready if _is(one, newcomer))
            running._answer(heard_client, "[7] 4 r 0x1017 0 u16", alone=False)
            heard_client.turn_s = running._turn_s + 1
            assert newcomer.reply() == "[7] 500"
        assert any(one.lines for one in _clients(running.hub.connected)), "the others wait still"


def test_who_comes_anew_for_each_line_keeps_out_nobody_who_was_heard_before() -> None:
    with Session(Options(sim=("generic@4",))) as session, gateway(session, ("127.0.0.1", 0)) as running:
        known = _spoken(1.0)
        answered = [running._next([known, _spoken(0.0)]) is known for _ in range(100)]
    assert sum(answered) >= 40
    assert True in answered[:12]


@pytest.mark.parametrize("talkers", [0, 1, 5])
@pytest.mark.parametrize("flood", [1, 40, 200])
@pytest.mark.parametrize("is_last", [True, False])
def test_who_comes_anew_for_each_line_lets_a_newcomer_wait_for_three_lines_at_most(
    talkers: int, flood: int, is_last: bool
) -> None:
    """Whenever the newcomer comes, just before the one that comes anew or just after it: its line is the fourth."""
    with Session(Options(sim=("generic@4",))) as session, gateway(session, ("127.0.0.1", 0)) as running:
        waiting = [_spoken(0.0) for _ in range(flood)] + [_spoken(1.0 + number) for number in range(talkers)]

        def answer() -> LineClient:
            client = running._next(waiting)
            waiting.remove(client)
            if client.turn_s:
                client.turn_s += talkers
            waiting.append(client if client.turn_s else _spoken(0.0))  # it comes anew
            return client

        for _ in range(60):
            for _ in range(3):
                answer()
            newcomer = _spoken(0.0)
            waiting.insert(len(waiting) - (not is_last), newcomer)
            assert newcomer in [answer() for _ in range(4)]


def _spoken(turn_s: float) -> LineClient:
    """A client that waits with a line, and had its turn, or not."""
    link, other = socket.socketpair()
    other.close()
    with link:
        return LineClient(link, "a", print, lines=deque(["[1] 4 r 0x1017 0 u16"]), turn_s=turn_s)


def _clients(found: tuple[object, ...]) -> list[LineClient]:
    return [one for one in found if isinstance(one, LineClient)]


def _port(client: Client) -> int:
    port = client.link.getsockname()[1]
    assert isinstance(port, int)
    return port


def _is(one: LineClient, client: Client) -> bool:
    return one.peer[1] == _port(client)


def test_nobody_makes_others_wait_for_silent_nodes() -> None:
    with served("generic@4", in_virtual_time=True) as (session, running), Client(running) as slow:
        assert slow.ask("set sdo_timeout 5000") == "OK"

        def waited_s() -> float:
            begun_s = session.bus.now_s()
            assert slow.ask("9 r 0x1018 1 u32").startswith("ERROR:103 ")
            return session.bus.now_s() - begun_s

        assert waited_s() > 4, "alone it may wait as long as it wants"
        with Client(running) as other:
            assert other.ask("4 r 0x1017 0 u16") == "500"
            assert waited_s() < 2.5, "with others there, twice the usual time-out"
            (told,) = (one for one in _clients(running.hub.connected) if _is(one, slow))
            told.waited_s = WAITING_S + 1
            assert "you made others wait" in slow.ask("9 r 0x1018 1 u32")
            assert "you made others wait" not in other.ask("9 r 0x1018 1 u32")
            assert slow.ask("4 r 0x1017 0 u16") == "500"


@UNIX
def test_who_knocks_in_vain_keeps_nobody_elses_knock_away() -> None:
    """All who wait are looked at together, so that a newcomer does not wait behind who is refused."""
    received = Heard()
    with served("generic@4", reporter=received) as (_, running):
        links = []
        try:
            for _ in range(300):
                link = socket.socket()
                link.setblocking(False)
                assert link.connect_ex(("127.0.0.1", running.hub.port or 0)) in (0, errno.EINPROGRESS)
                links.append(link)
            with Client(running) as client:
                assert client.ask("4 r 0x1017 0 u16") == "500"
        finally:
            for link in links:
                link.close()
