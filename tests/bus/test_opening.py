"""Opening a bus, and the words for every way it can fail."""

from __future__ import annotations

import itertools
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from struct import pack

import pytest
from can.interfaces import BACKENDS

from dvtcli.bus.opening import open_bus
from dvtcli.bus.python_can_settings import given_settings
from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import CanopenBus
from dvtcli.errors import BusUnavailable, NoAnswer


@pytest.fixture(autouse=True)
def no_configuration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A home without python-can's files, and an environment without its variables."""
    for name in ("CAN_INTERFACE", "CAN_CHANNEL", "CAN_BITRATE", "CAN_CONFIG"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    return tmp_path / "can.conf"


@pytest.fixture
def socketcand() -> Iterator[tuple[int, list[socket.socket]]]:
    """A server on 127.0.0.1 that does socketcand's handshake and then says nothing; its port and connections."""
    with server(itertools.repeat(b"< ok >")) as made:
        yield made


@contextmanager
def server(last_answers: Iterator[bytes]) -> Iterator[tuple[int, list[socket.socket]]]:
    """The same; it ends each handshake that comes so far with the next one of *last_answers*."""
    listener = socket.create_server(("127.0.0.1", 0))
    connections: list[socket.socket] = []

    def serve() -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            try:
                connection.sendall(b"< hi >")
                if connection.recv(256):
                    connection.sendall(b"< ok >")
                    if connection.recv(256):
                        connections.append(connection)
                        connection.sendall(next(last_answers))
                        continue
            except OSError:
                pass
            connection.close()

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    yield listener.getsockname()[1], connections
    listener.shutdown(socket.SHUT_RDWR)
    listener.close()
    thread.join()
    for connection in connections:
        connection.close()


def test_opening_a_virtual_bus() -> None:
    bus = open_bus("virtual", "opening", 500_000, timeout_s=0.2, retries=0)
    assert bus.name == "virtual:opening"
    assert not bus.simulated
    assert (bus.settings.timeout_s, bus.settings.retries) == (0.2, 0)
    bus.close()


def test_unset_keys_come_from_python_cans_configuration(
    no_configuration: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    no_configuration.write_text("[default]\ninterface = virtual\nchannel = from-file\nreceive_own_messages = True\n")
    bus = open_bus()
    assert bus.name == "virtual:from-file"
    bus.close()
    monkeypatch.setenv("CAN_CHANNEL", "from-environment")
    bus = open_bus()
    assert bus.name == "virtual:from-environment"
    bus.close()
    bus = open_bus(channel="given")
    assert bus.name == "virtual:given"
    bus.close()


def test_a_file_for_another_interface_adds_nothing(no_configuration: Path) -> None:
    no_configuration.write_text("[default]\ninterface = socketcand\nchannel = can0\nhost = 127.0.0.1\nport = 1\n")
    bus = open_bus("virtual", "mine")
    assert bus.name == "virtual:mine"
    bus.close()


def test_nothing_configured() -> None:
    with pytest.raises(BusUnavailable, match="no CAN interface is configured") as caught:
        open_bus()
    assert "--sim" in typed(caught.value.hint)


def test_an_interface_that_does_not_exist() -> None:
    with pytest.raises(BusUnavailable) as caught:
        open_bus("socketcnd", "can0")
    assert "socketcand" in typed(caught.value.hint)


@pytest.mark.parametrize("interface", sorted(set(BACKENDS) - {"virtual", "udp_multicast"}))
@pytest.mark.parametrize("channel", [None, "no-such-channel"])
def test_every_interface_fails_in_words(interface: str, channel: str | None) -> None:
    with pytest.raises(BusUnavailable) as caught:
        open_bus(interface, channel)
    error = caught.value
    assert interface in error.text
    assert channel is None or channel in error.text
    assert error.why
    assert typed(error.hint)
    assert error.state == "unchanged"


def test_unknown_settings() -> None:
    with pytest.raises(BusUnavailable) as caught:
        open_bus("socketcand", "can0", None, {"host": "127.0.0.1"})
    assert "port" in typed(caught.value.hint)


def test_nothing_listens_and_that_is_said() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(BusUnavailable) as caught:
        open_bus("socketcand", "can0", None, {"host": "127.0.0.1", "port": str(port)})
    assert f"127.0.0.1:{port}" in caught.value.text
    assert "no server there" in typed(caught.value.hint)


def test_frames_that_come_with_the_last_answer_are_read() -> None:
    """As on a busy bus, or where this process was late."""
    with server(itertools.repeat(b"< ok >< frame 703 1.0 00 >")) as (port, connections):
        bus = open_bus("socketcand", "can0", None, {"host": "127.0.0.1", "port": port})
        assert bus.wait_boot_up(3, 0, 10)
        assert len(connections) == 1
        bus.close()


def test_a_server_that_refuses_is_no_bus() -> None:
    with server(itertools.repeat(b"< error >")) as (port, connections):
        with pytest.raises(BusUnavailable, match="cannot open socketcand") as caught:
            open_bus("socketcand", "can0", None, {"host": "127.0.0.1", "port": port})
        assert "got '< error >'" in str(caught.value.why)
        assert len(connections) == 1


def read_until_it_fails(bus: CanopenBus) -> None:
    for _ in range(20):
        with suppress(NoAnswer):
            bus.sdo(1).upload(0x1000, 0)


def test_a_server_that_goes_away_in_use(socketcand: tuple[int, list[socket.socket]]) -> None:
    port, connections = socketcand
    bus = open_bus("socketcand", "can0", None, {"host": "127.0.0.1", "port": port}, timeout_s=0.02, retries=0)
    assert bus.name == f"socketcand:127.0.0.1:{port}"
    connections[-1].close()
    with pytest.raises(BusUnavailable) as caught:
        read_until_it_fails(bus)
    assert caught.value.why
    bus.close()


def test_a_server_that_goes_away_while_nothing_is_sent(socketcand: tuple[int, list[socket.socket]]) -> None:
    """A recording ends."""
    port, connections = socketcand
    bus = open_bus("socketcand", "can0", None, {"host": "127.0.0.1", "port": port})
    assert list(bus.receive(0.05)) == []
    connections[-1].close()
    with pytest.raises(BusUnavailable) as caught:
        list(bus.receive(60))
    assert "closed the connection" in str(caught.value.why)
    assert "server" in typed(caught.value.hint)
    bus.close()


def test_a_server_that_sends_what_is_no_frame_is_in_question_not_an_adapter(
    socketcand: tuple[int, list[socket.socket]],
) -> None:
    port, connections = socketcand
    bus = open_bus("socketcand", "can0", None, {"host": "127.0.0.1", "port": port})
    assert list(bus.receive(0.05)) == []
    connections[-1].sendall(b"< frame xyz 1 00 >")
    with pytest.raises(BusUnavailable, match="failed") as caught:
        list(bus.receive(60))
    assert "what is not a frame" in str(caught.value.why)
    assert typed(caught.value.hint) == "is the server still running?"
    bus.close()


@pytest.mark.parametrize("linger_s", [None, 0], ids=["closed", "reset"])
def test_a_server_that_has_gone_is_noticed_before_anything_is_sent(
    socketcand: tuple[int, list[socket.socket]], linger_s: int | None
) -> None:
    port, connections = socketcand
    bus = open_bus("socketcand", "can0", None, {"host": "127.0.0.1", "port": port})
    assert bus.nodes_seen() == {}
    if linger_s is not None:
        connections[-1].setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, pack("ii", 1, linger_s))
    connections[-1].close()
    with pytest.raises(BusUnavailable) as caught:
        bus.sdo(1).download(0x1017, 0, b"\0\0")
    assert caught.value.state == "unchanged"
    bus.close()


def test_frames_that_the_client_has_read_ahead_are_not_missed(socketcand: tuple[int, list[socket.socket]]) -> None:
    """Three boot-ups in one packet: the first is waited for, the others are there without another packet."""
    port, connections = socketcand
    bus = open_bus("socketcand", "can0", None, {"host": "127.0.0.1", "port": port})
    assert bus.nodes_seen() == {}
    connections[-1].sendall(b"".join(b"< frame 70%d 1.0 00 >" % node_id for node_id in (1, 2, 3)))
    assert bus.wait_boot_up(1, 0, 10)
    assert bus.nodes_seen() == dict.fromkeys((1, 2, 3), NmtState.PRE_OPERATIONAL)
    bus.close()


@pytest.mark.parametrize("module", ["dvtcli.operations.session.open_network", "dvtcli.simulator.network.twin_bus"])
def test_nothing_heavy_is_imported_before_a_bus_is_opened(module: str) -> None:
    code = f"import sys, {module}; print(*sorted({{'can', 'canopen', 'asyncio'}} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


@pytest.mark.parametrize(
    ("channel", "extra", "host", "where"),
    [
        ("127.0.0.1:29536", {}, "127.0.0.1", "can0"),
        ("cell-4.plant:29536", {}, "cell-4.plant", "can0"),
        ("[::1]:29536", {}, "::1", "can0"),
        ("can1", {"host": "10.0.0.1", "port": "29536"}, "10.0.0.1", "can1"),
    ],
)
def test_a_server_is_named_by_its_address_or_by_host_and_port(
    channel: str, extra: dict[str, object], host: str, where: str
) -> None:
    asked = given_settings("socketcand", channel, None, extra)
    assert asked == {"interface": "socketcand", "channel": where, "host": host, "port": 29536}


def test_an_address_beside_a_host_is_a_channel_and_of_other_interfaces_too() -> None:
    assert given_settings("socketcand", "a:1", None, {"host": "b"})["channel"] == "a:1"
    assert given_settings("slcan", "host:2000", None, {}) == {"interface": "slcan", "channel": "host:2000"}


def test_a_server_at_an_address_is_opened(socketcand: tuple[int, list[socket.socket]]) -> None:
    port, _ = socketcand
    bus = open_bus("socketcand", f"127.0.0.1:{port}")
    try:
        assert bus.name == f"socketcand:127.0.0.1:{port}"
    finally:
        bus.close()
