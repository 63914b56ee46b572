"""What fuzzing found once: each input, and what must come of it."""

from __future__ import annotations

import io
import json
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from dvtcli.bus.sdo.client import StrictSdoClient
from dvtcli.bus.sdo.sdo_link import SdoSettings
from dvtcli.cli.lexer import split
from dvtcli.cli.scripts.script_parse import MOST_COMMANDS, script_lines
from dvtcli.cli.view.output import Output
from dvtcli.device.change.journal import JournalFolder
from dvtcli.errors import InputFileError, SdoProtocolError, UsageError
from dvtcli.files.eds.reader import parse_eds
from dvtcli.files.profiles import read_profile
from dvtcli.operations.results import ValueRead
from dvtcli.operations.user.settings import File, SettingsFile
from tests.cli.commands.bench import Bench
from tests.fuzz.server import NODE, HostileLink
from tests.harness.sample import heavy


@pytest.mark.parametrize(
    "text",
    [
        "quiet = 2",
        "bus = 1",
        "bus = {a = 1}",
        "bus_kwargs = {a = {}}",
        "bus_kwargs = {a = inf}",
        "[bus.a]\nyes = true",
        "[bus.a]\nnosuch = 1",
        "[bus.a]\ninterface = []",
        "node = 128",
        "format = 'xml'",
        "bitrate = 5",
        "timeout = 'x'",
        "bus_kwargs = ['a']",
        "quiet = []",
        'verbose = "x"',
        "verbose = 99999999999999999999",
        "bitrate = 1979-05-27",
        "bitrate = {a = 1}",
        "bitrate = inf",
        f"bitrate = {'9' * 5000}",
        f"bitrate = 0x{'F' * 5000}",
        "timeout = [1]",
        'eds = "a\\u0000b"',
        "node = " + "[" * 5000,
        "a" * 100_001,
    ],
    ids=lambda text: text[:20],
)
def test_a_setting_of_another_kind_is_an_error_in_the_file(text: str, tmp_path: Path) -> None:
    (tmp_path / "dvtcli.toml").write_text(text)
    with pytest.raises(InputFileError, match=r"dvtcli\.toml"):
        File(SettingsFile(str(tmp_path / "dvtcli.toml")), users_own=False)


@pytest.mark.parametrize("value", ["0x" + "F" * 5000, "9" * 5000, "[" * 5000, "[0x" + "F" * 5000 + "]"])
def test_a_profile_with_a_monstrous_value_is_an_error_in_the_file(value: str) -> None:
    with pytest.raises(InputFileError):
        read_profile(f'name = "x"\ntitle = "t"\nmax_entries = {value}\n', "x.toml")


@pytest.mark.parametrize("line", ["verify {}", "recover {}", "run {}", "eds check {}"])
@pytest.mark.parametrize("name", ["x" * 5000, "a\0b"], ids=["long", "nul"])
def test_a_word_that_can_be_no_path_is_a_usage_error(line: str, name: str) -> None:
    with Bench() as bench:
        assert bench.run(line.format(name)).code == 2


def test_saving_under_an_impossible_name_is_a_usage_error() -> None:
    with Bench() as bench:
        assert bench.run("map tpdo1 6041").code == 0
        assert bench.run(f"save {'x' * 5000}").code == 2


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="needs a file without an end")
@pytest.mark.parametrize("line", ["run /dev/zero", "eds check /dev/zero"])
def test_a_file_without_an_end_is_an_error(line: str) -> None:
    with Bench() as bench:
        assert bench.run(line).code == 4


def test_a_journal_that_cannot_be_read_is_a_damaged_journal(tmp_path: Path) -> None:
    journals = JournalFolder(tmp_path, "bus")
    journals.path(1).mkdir(parents=True)
    with pytest.raises(InputFileError, match="not a usable journal"):
        journals.find(1)


def test_an_identity_that_is_no_number_of_32_bits_counts_for_nothing() -> None:
    text = "[DeviceInfo]\n[1018]\nObjectType=9\n[1018sub1]\nDataType=9\nAccessType=ro\nDefaultValue=" + "x" * 300
    assert parse_eds(text.encode(), "x.eds").dictionary.info.vendor_id is None


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_documents_are_strict_json_for_every_real_number(value: float) -> None:
    output = Output(io.StringIO(), io.StringIO())
    output.format = "json"
    output.result(ValueRead(1, "2000:00", "", value, bytes(4), "r32"))
    assert isinstance(output.stdout, io.StringIO)
    assert json.loads(output.stdout.getvalue(), parse_constant=pytest.fail)["value"] == str(value)


def test_a_word_of_a_million_letters_is_split_at_once() -> None:
    assert split(f"read {'x' * 1_000_000} 'a b'") == ["read", "x" * 1_000_000, "a b"]


def test_an_open_quote_is_not_repeated_whole() -> None:
    with pytest.raises(UsageError) as error:
        split('read "' + "x" * 100_000)
    assert len(error.value.text) < 300


def test_a_private_character_is_not_taken_for_an_apostrophe() -> None:
    assert split("read a\ue001b") == ["read", "a\ue001b"]


def test_more_commands_than_a_person_writes_are_no_script() -> None:
    with pytest.raises(InputFileError, match="a script has at most"):
        script_lines(b"pdo\n" * (MOST_COMMANDS + 1), "x.dvt")


class Answering(HostileLink):
    """A server that answers each request with the frames that *answers* gives."""

    def __init__(self, answers: Callable[[bytes], Iterator[bytes]]) -> None:
        super().__init__(deque(), 0, most_requests=1 << 30)
        self.frames = answers

    def _answers(self, request: bytes, move: int, shape: int) -> list[tuple[float, bytes]]:
        return [(0.0, frame) for frame in self.frames(request)]


def client(answers: Callable[[bytes], Iterator[bytes]]) -> StrictSdoClient:
    link = Answering(answers)
    link.client = StrictSdoClient(NODE, link, SdoSettings(0.5, 0))
    return link.client


def test_a_segment_acknowledged_before_it_was_sent_is_not_acknowledged() -> None:
    def premature(request: bytes) -> Iterator[bytes]:
        if request[0] >> 5 == 1:
            yield b"\x60" + request[1:4] + bytes(4)
        elif not request[0] & 0x10:  # the second segment is acknowledged together with the first, and is never taken
            yield from (b"\x20" + bytes(7), b"\x30" + bytes(7))

    with pytest.raises(Exception, match="did not answer"):
        client(premature).download(0x2000, 0, bytes(14))


@heavy
@pytest.mark.parametrize("announced", [None, 0xFFFF_FFFF])
def test_an_upload_that_never_ends_is_a_protocol_error(announced: int | None) -> None:
    def endless(request: bytes) -> Iterator[bytes]:
        if request[0] >> 5 == 2:
            size = (announced or 0).to_bytes(4, "little")
            yield bytes([0x40 | (announced is not None)]) + request[1:4] + size
        elif request[0] >> 5 == 3:
            yield bytes([request[0] & 0x10]) + bytes(7)

    with pytest.raises(SdoProtocolError, match="bytes"):
        client(endless).upload(0x2000, 0)
