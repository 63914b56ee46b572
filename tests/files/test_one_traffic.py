"""One traffic in every format, named or pasted into standard input: the same facts in the same order."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from dvtcli.domain.ports import Frame
from dvtcli.files.recordings.formats import formats, written
from dvtcli.files.recordings.recording_file import Recorder
from tests.cli.commands.bench import Bench
from tests.files.captures import Style, pcap, pcapng
from tests.files.test_pasted import BEGIN_S, FORMS
from tests.surroundings import ROOT
from tests.watch.test_sdo_transfers import by_blocks, in_segments

LINE = ROOT / "examples" / "line.yaml"
#: what decodes the frames: nodes 1 and 5 with their PDOs
WORDS = f"-d {LINE} --json"
TEXT = b"firmware 4.2, built in Kiel"


def _transfer(frames: Iterator[tuple[bool, bytes]]) -> list[Frame]:
    return [Frame(0x605 if is_request else 0x585, data) for is_request, data in frames]


def _frames(*texts: str) -> list[Frame]:
    pairs = (text.split("#") for text in texts)
    return [Frame(int(can_id, 16), bytes.fromhex(data), extended=len(can_id) == 8) for can_id, data in pairs]


#: every service and each kind of transfer, PDOs of two nodes and one of nobody, and a 29-bit frame; no remote frame
TRAFFIC = [
    *_frames("000#8105", "705#00", "701#05", "7E5#04010000 00000000", "7E4#4F00000000000000", "100#80EE3602 B33B"),
    *_frames("605#2F60600008000000", "585#8060600030000906", "605#4018100100000000", "585#431810011E000000"),
    *_transfer(in_segments(TEXT, is_write=False)), *_transfer(in_segments(TEXT, is_write=True)),
    *_transfer(by_blocks(TEXT, 2, iter((1,)), is_write=False)), *_transfer(by_blocks(TEXT, 4, iter(()), is_write=True)),
    *_frames("605#8000210300000405", "000#0100", "705#05", "705#85", "080#", "080#07"),
    *_frames("181#120034125634", "185#370012", "3A5#0102030405060708", "085#2030810000000000", "085#0000000000000000"),
    *_frames("18FF0102#0102", "00000181#010203", "6FF#"),
]  # fmt: skip
TIMED = [frame._replace(timestamp_s=BEGIN_S + 0.001 + 0.01 * number) for number, frame in enumerate(TRAFFIC)]
#: what a fact is: all but the time
KEYS = ("cob_id", "extended", "data", "kind", "node", "pdo", "signals", "physical", "what", "text", "fields")


def _recorded(suffix: str, folder: Path) -> bytes:
    path = folder / f"made{suffix}"
    with Recorder(path) as recorder:
        for frame in TIMED:
            recorder.write(frame)
    return path.read_bytes()


def _printed(words: str, folder: Path) -> bytes:
    """What dvtcli itself prints of the frames with *words*."""
    path = folder / "first.log"
    path.write_bytes(_recorded(".log", folder))
    ran = Bench(()).run(f"decode {path} {words}")
    assert ran.code == 0, ran.stderr
    return ran.stdout.encode()


def _made(form: str, folder: Path) -> bytes:
    """The frames in *form*."""
    if form in FORMS:
        return FORMS[form](TRAFFIC).encode()
    if form.startswith("decode"):
        return _printed(form.removeprefix("decode"), folder)
    if form == ".pcap":
        return pcap(TIMED, "<", nanoseconds=False)
    return pcapng(TIMED, Style()) if form == ".pcapng" else _recorded(form, folder)


#: also what `monitor` prints into a pipe, which are the documents of `decode --json`
OWN = ("decode", "decode --json", f"decode -d {LINE}")
ALL_FORMS = (*FORMS, *formats(), *OWN)


def _facts(stdout: str) -> list[tuple[Any, ...]]:
    documents = [json.loads(line) for line in stdout.splitlines()]
    return [tuple(document[key] for key in KEYS) for document in documents]


def _pasted(data: bytes, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(data), "utf-8"))
    ran = Bench(()).run(f"decode - {WORDS}")
    assert ran.code == 0, ran.stderr
    return ran.stdout


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> Sequence[tuple[Any, ...]]:
    folder = tmp_path_factory.mktemp("plain")
    path = folder / "run.log"
    path.write_bytes(_recorded(".log", folder))
    found = _facts(Bench(()).run(f"decode {path} {WORDS}").stdout)
    assert [(fact[0], fact[2].replace(" ", "")) for fact in found] == [
        (frame.can_id, frame.data.hex().upper()) for frame in TRAFFIC
    ]
    kinds = {fact[KEYS.index("what")] for fact in found}
    assert kinds == {
        "nmt", "sync", "time", "emcy", "sdo", "sdo-abort", "boot-up", "heartbeat", "guarding", "lss", "pdo", "other"
    }  # fmt: skip
    values = [fact[KEYS.index("fields")].get("value") for fact in found]
    assert values.count(TEXT.decode()) == 4, "each transfer's value is in its last frame"
    return found


def test_each_format_has_its_case() -> None:
    assert set(ALL_FORMS) >= {*formats(), *written()}


@pytest.mark.parametrize(
    "form", [pytest.param(form, marks=pytest.mark.needs("asammdf") if form == ".mf4" else ()) for form in ALL_FORMS]
)
def test_one_traffic_has_the_same_facts_in_every_format(
    form: str, tmp_path: Path, expected: Sequence[tuple[Any, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    data = _made(form, tmp_path)
    file = tmp_path / "run"
    file.write_bytes(data)
    ran = Bench(()).run(f"decode {file} {WORDS}")
    assert ran.code == 0, ran.stderr
    assert _facts(ran.stdout) == expected
    assert _facts(_pasted(data, monkeypatch)) == expected
