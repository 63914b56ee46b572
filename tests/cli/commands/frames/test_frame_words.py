"""Frames in words: `decode`, `explain`, `trace` and the others say the same of a frame, service by service."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench
from tests.process import dvtcli

#: a frame and what it says; of frames that belong together the others stand before it
WORDS = [
    (["000#8005"], "nmt", "NMT preop -> node 5"),
    (["000#8205"], "nmt", "NMT reset-comm -> node 5"),
    (["000#0180"], "nmt", "NMT start -> reserved node-ID 128"),
    (["000#010000"], "nmt", "NMT start -> all nodes; too long: an NMT command has 2 bytes"),
    (["000#0100"], "nmt", "NMT start -> all nodes"),
    (["000#4205"], "nmt", "NMT reserved command 0x42 -> node 5"),
    (["000#01"], "nmt", "NMT too short: it has 2 bytes"),
    (["080#"], "sync", "SYNC"),
    (["080#07"], "sync", "SYNC 7"),
    (["080#F1"], "sync", "SYNC 241; reserved: SYNC counts from 1 to 240 at most"),
    (["080#0700"], "sync", "SYNC 7; too long: SYNC has 1 byte at most"),
    (["100#000000000100"], "time", "TIME 1984-01-02 00:00:00.000"),
    (["085#2030810000000000"], "emcy", "EMCY 0x3020 voltage, register 0x81"),
    (["085#0000000001020304"], "emcy", "EMCY 0x0000 error reset, register 0x00, data 00 01 02 03 04"),
    (["100#00000000010000"], "time", "TIME 1984-01-02 00:00:00.000; too long: TIME has 6 bytes"),
    (["705#05"], "heartbeat", "OPERATIONAL"),
    (["705#7F00"], "heartbeat", "PRE-OPERATIONAL; too long: a heartbeat has 1 byte"),
    (["705#00"], "boot-up", "boot-up"),
    (["705#85"], "guarding", "OPERATIONAL, toggle bit 1"),
    (["705#R"], "guarding", "node guarding request"),
    (["705#R", "705#7F"], "guarding", "PRE-OPERATIONAL, toggle bit 0"),
    (["605#2F60600008000000"], "sdo", "write 6060:00 = cyclic synchronous position (8)"),
    (["605#2F60600008000000", "585#6060600000000000"], "sdo", "6060:00 written"),
    (["605#2F60600008000000", "585#8060600030000906"], "sdo-abort",
     "abort 0x06090030 of 6060:00: invalid value for the parameter"),
    (["585#80021A0141000406"], "sdo-abort",
     "abort 0x06040041 of 1A02:01 mapped object 1: object cannot be mapped to the PDO"),
    (["605#23021A0110004160"], "sdo", "write 1A02:01 mapped object 1 = 6041:00, 16 bits"),
    (["605#2303180182040080"], "sdo", "write 1803:01 COB-ID = 0x482, disabled (0x80000482)"),
    (["605#23161001DC056400"], "sdo", "write 1016:01 consumer heartbeat time 1 = node 100, 1500 ms"),
    (["605#4041600000000000"], "sdo", "read 6041:00"),
    (["605#4041600000000000", "585#4B41600037060000"], "sdo", "6041:00 = operation enabled (0x0637)"),
    (["605#40081000"], "sdo", "too short: an SDO has 8 bytes"),
    (["605#0100000000000000"], "sdo", "download segment of an unknown object"),
    (["605#4008100000000000", "585#4108100008000000"], "sdo",
     "read 1008:00 manufacturer device name: accepted, 8 bytes"),
    (["605#4008100000000000", "585#4108100008000000", "605#6000000000000000", "585#0053657276656C6C"], "sdo",
     "read 1008:00 manufacturer device name: bytes 1 to 7 of 8"),
    (["605#4008100000000000", "585#4108100008000000", "605#6000000000000000", "585#0053657276656C6C",
      "605#7000000000000000", "585#1D69000000000000"], "sdo", "1008:00 manufacturer device name = 'Servelli'"),
    (["605#C250200108000000"], "sdo", "write 2050:01 by blocks, 8 bytes"),
    (["605#C250200109000000", "585#A450200102000000", "605#0141424344454647", "605#8248490000000000",
      "585#A202020000000000", "605#D500000000000000", "585#A100000000000000"], "sdo",
     "2050:01 written = 'ABCDEFGHI'"),
    (["7E5#0401000000000000"], "lss", "LSS switch state global: mode configuration"),
    (["7E5#1105000000000000"], "lss", "LSS configure node-ID: 5"),
    (["7E4#1101000000000000"], "lss",
        "LSS configure node-ID: error code it does not support this node-ID (error code 1)"),
    (["185#10"], "pdo", ""),
    (["6FF#10"], "other", ""),
]  # fmt: skip


def recorded(path: Path, frames: list[str]) -> Path:
    path.write_text("".join(f"({1.7e9 + n / 100:.6f}) can0 {frame}\n" for n, frame in enumerate(frames)), "ascii")
    return path


@pytest.mark.parametrize(("frames", "what", "text"), WORDS)
def test_decode_says_what_a_frame_is(frames: list[str], what: str, text: str, tmp_path: Path) -> None:
    """As text and as JSON; `explain` says the same of a frame by itself."""
    path = recorded(tmp_path / "run.log", frames)
    last = Bench(()).run(f"decode {path}").stdout.splitlines()[-1]
    document = json.loads(Bench(()).run(f"decode {path} --json").stdout.splitlines()[-1])
    assert (document["what"], document["text"]) == (what, text)
    assert last.endswith(text)
    if len(frames) == 1:
        alone = Bench(()).run(f"explain {frames[0]} --json").document
        assert (alone["what"], alone["text"]) == (what, text)


def test_kinds_that_are_not_there_are_told(tmp_path: Path) -> None:
    path = recorded(tmp_path / "run.log", ["705#05"])
    ran = Bench(()).run(f"decode {path} --only emcy,nmt")
    assert (ran.code, ran.stdout, "no frame in run.log is of the kinds emcy, nmt" in ran.stderr) == (0, "", True)


def test_transfers_of_two_buses_are_read_by_themselves(tmp_path: Path) -> None:
    """Nodes with one node-ID on two buses are read at the same time, as text and into files."""
    begin = ["605#4008100000000000", "585#4108100008000000", "605#6000000000000000"]
    frames = [(frame, bus) for frame in begin for bus in ("can0", "can1")]
    frames += [
        ("585#0053657276656C6C", "can0"),
        ("585#0047656E6572696B", "can1"),
        *[("605#7000000000000000", bus) for bus in ("can0", "can1")],
    ]
    frames += [("585#1D69000000000000", "can0"), ("585#1D61000000000000", "can1")]
    path = tmp_path / "two.log"
    path.write_text("".join(f"({1.7e9 + n / 100:.6f}) {bus} {frame}\n" for n, (frame, bus) in enumerate(frames)))
    names = [f"1008:00 manufacturer device name = '{name}'" for name in ("Servelli", "Generika")]
    lines = Bench(()).run(f"decode {path}").stdout.splitlines()
    assert [line.partition("1008:00")[1] + line.partition("1008:00")[2] for line in lines[-2:]] == names
    target = tmp_path / "two.jsonl"
    done = dvtcli("--eds", "gen4", "-n", "5", "decode", str(path), "--output", str(target))
    assert done.returncode == 0, done.stderr
    documents = map(json.loads, target.read_text().splitlines())
    texts = [document["text"] for document in documents if document["fields"]["step"] == "done"]
    assert [text.partition(" = ")[2] for text in texts] == ["'Servelli'", "'Generika'"]


#: what an EDS needs for multiplexed PDOs: TPDO1 addresses the destination, TPDO2 the source
MPDO = """[FileInfo]
FileName=m.eds
[DeviceInfo]
VendorName=V
ProductName=P
[MandatoryObjects]
SupportedObjects=2
1=0x1000
2=0x1001
[1000]
ParameterName=Device type
DataType=7
AccessType=ro
DefaultValue=0
[1001]
ParameterName=Error register
DataType=5
AccessType=ro
[ManufacturerObjects]
SupportedObjects=1
1=0x2000
[2000]
ParameterName=Speed
DataType=3
AccessType=rw
PDOMapping=1
[OptionalObjects]
SupportedObjects=4
1=0x1800
2=0x1A00
3=0x1801
4=0x1A01
"""


def mpdo_eds(path: Path) -> Path:
    text = MPDO
    for number, count in ((0, 255), (1, 254)):
        for index, subs in (
            (0x1800, ((0, 5, "2"), (1, 7, f"$NODEID+0x{0x180 + 0x100 * number:X}"), (2, 5, "254"))),
            (0x1A00, ((0, 5, str(count)),)),
        ):
            text += f"[{index + number:X}]\nParameterName=PDO\nObjectType=9\nSubNumber={len(subs)}\n"
            for sub, kind, default in subs:
                text += (
                    f"[{index + number:X}sub{sub}]\nParameterName=sub\nDataType={kind}\nAccessType=rw\n"
                    f"DefaultValue={default}\n"
                )
    path.write_text(text, "ascii")
    return path


@pytest.mark.parametrize(
    ("frame", "text"),
    [
        ("181#850020000CFE0000", "to node 5: 2000:00 Speed = -500"),
        ("181#80002000F4010000", "to all nodes: 2000:00 Speed = 500"),
        ("281#01002000F4010000", "from node 1: 2000:00 Speed = 500"),
        ("281#0107200001000000", "from node 1: 2007:00 = 1"),
        ("281#0100", "too short: a multiplexed PDO has 8 bytes"),
    ],
)
def test_a_multiplexed_pdo_names_node_object_and_value(frame: str, text: str, tmp_path: Path) -> None:
    eds, path = mpdo_eds(tmp_path / "m.eds"), recorded(tmp_path / "run.log", [frame])
    document = Bench((), {"eds": str(eds)}).run(f"decode {path} --nodes 1 --json").document
    assert (document["what"], document["text"]) == ("mpdo", text)
    by_device = Bench((str(eds),)).run(f"explain {frame} --json").document
    assert by_device["text"] == text
    assert sum(part["bits"] for part in by_device["parts"] if not part["in_can_id"]) == 4 * len(frame.split("#")[1])


@pytest.mark.parametrize("axis", range(8))
def test_every_axis_of_a_drive_has_the_same_words(axis: int) -> None:
    index = 0x6041 + 0x800 * axis
    data = f"{index & 0xFF:02X}{index >> 8:02X}00"
    said = Bench(()).run(f"explain 581#4B{data}37060000 --json").document
    assert said["text"] == f"{index:04X}:00 = operation enabled (0x0637)"


def test_no_other_object_is_an_axis() -> None:
    """0x5841 and 0xA041 are no objects of CiA 402, though they are 0x800 off; 0x1841 is TPDO66's."""
    for index in (0x5841, 0xA041):
        said = Bench(()).run(f"explain 581#4B{index & 0xFF:02X}{index >> 8:02X}0037060000 --json").document
        assert said["text"] == f"{index:04X}:00 = 1591"


#: the default server sets 0x6C5 and 0x5C5 for server 2 of node 5, which is asked then
_SERVER_2 = ["605#23011201C5060000", "585#6001120100000000", "605#23011202C5050000", "585#6001120200000000"]
_ASKED_2 = ["6C5#4041600000000000", "5C5#4B41600037060000", "6C5#2F60600008000000", "5C5#8060600030000906"]
_SAID_2 = [
    ("SDO2 request", "read 6041:00"), ("SDO2 answer", "6041:00 = operation enabled (0x0637)"),
    ("SDO2 request", "write 6060:00 = cyclic synchronous position (8)"),
    ("SDO2 answer", "abort 0x06090030 of 6060:00: invalid value for the parameter"),
]  # fmt: skip


def _said(path: Path, words: str, options: dict[str, str] | None = None) -> list[tuple[str, str]]:
    """Service and text of the last four frames."""
    ran = Bench((), options or {}).run(f"decode {path} --json {words}")
    documents = [json.loads(line) for line in ran.stdout.splitlines()[-4:]]
    lines = Bench((), options or {}).run(f"decode {path} {words}").stdout.splitlines()[-4:]
    assert {document["kind"] for document in documents} == {"sdo"}, ran.stdout
    return [(" ".join(line.split()[2:4]), document["text"]) for line, document in zip(lines, documents, strict=True)]


def test_a_further_sdo_server_is_known_by_the_writes_of_its_cob_ids(tmp_path: Path) -> None:
    path = recorded(tmp_path / "run.log", [*_SERVER_2, *_ASKED_2])
    assert _said(path, "") == _SAID_2
    disabled = recorded(tmp_path / "off.log", ["605#23011201C5060080", "585#6001120100000000", _ASKED_2[0]])
    assert json.loads(Bench(()).run(f"decode {disabled} --json").stdout.splitlines()[-1])["kind"] != "sdo"


def sdo2_eds(path: Path) -> Path:
    """The EDS of a node whose second SDO server has CAN-IDs by its node-ID."""
    text = (
        MPDO.replace("DefaultValue=0\n", "DefaultValue=0x192\n", 1)
        .replace("4=0x1A01\n", "4=0x1A01\n5=0x1201\n")
        .replace("SupportedObjects=4", "SupportedObjects=5")
    )
    text += "[1201]\nParameterName=SDO server 2\nObjectType=9\nSubNumber=3\n"
    for sub, kind, default in ((0, 5, "2"), (1, 7, "$NODEID+0x6C0"), (2, 7, "$NODEID+0x5C0")):
        text += f"[1201sub{sub}]\nParameterName=COB-ID {sub}\nDataType={kind}\nAccessType=rw\nDefaultValue={default}\n"
    path.write_text(text, "ascii")
    return path


def test_a_further_sdo_server_is_known_by_the_eds_or_the_network_file(tmp_path: Path) -> None:
    eds, path = sdo2_eds(tmp_path / "two.eds"), recorded(tmp_path / "run.log", _ASKED_2)
    assert _said(path, "--nodes 5", {"eds": str(eds)}) == _SAID_2
    network = tmp_path / "net.yaml"
    network.write_text("drive: {node_id: 5, dcf: two.eds}\n")
    assert _said(path, f"-d {network}") == _SAID_2
    values = [f"{{index: 0x1201, sub_index: {sub}, value: {value}}}" for sub, value in ((1, "0x6C9"), (2, "0x5C9"))]
    network.write_text(f"drive: {{node_id: 5, dcf: two.eds, sdo: [{', '.join(values)}]}}\n")
    moved = recorded(tmp_path / "moved.log", [frame.replace("C5#", "C9#") for frame in _ASKED_2])
    assert _said(moved, f"-d {network}") == _SAID_2
    done = dvtcli("--eds", str(eds), "-n", "5", "check", str(path), "--json")
    (found,) = json.loads(done.stdout.splitlines()[0])["files"][0]["findings"]
    assert (found["rule"], found["node"], found["object"]) == ("refused-write", 5, "6060:00")


def test_services_are_rows_of_values_files_without_any_mapping(tmp_path: Path) -> None:
    """A mapping is asked for only if no frame of the recording is a row; --only says that it found none."""
    (tmp_path / "run.log").write_text("(1.000000) can0 705#05 R\n(2.000000) can0 185#10 R\n")
    (tmp_path / "pdos.log").write_text("(2.000000) can0 185#10 R\n")
    done = dvtcli("decode", "run.log", "--csv", cwd=tmp_path)
    head, row = done.stdout.splitlines()
    assert (head, row.partition(",")[2]) == ("time,frame", "heartbeat node 5: OPERATIONAL")
    for suffix in (".csv", ".jsonl"):
        assert "1 frame, 0 signals" in dvtcli("decode", "run.log", "-o", f"run{suffix}", cwd=tmp_path).stdout
    refused = dvtcli("decode", "pdos.log", "--csv", cwd=tmp_path)
    assert (refused.returncode, "values of signals need a mapping" in refused.stderr) == (2, True)
    found = dvtcli("decode", "run.log", "--csv", "--only", "emcy", cwd=tmp_path)
    assert (found.returncode, "no frame in run.log is of the kinds emcy" in found.stderr) == (0, True)


@pytest.mark.needs("pyarrow")
def test_services_are_rows_of_a_parquet_file_without_any_mapping(tmp_path: Path) -> None:
    (tmp_path / "run.log").write_text("(1.000000) can0 705#05 R\n")
    done = dvtcli("decode", "run.log", "-o", "run.parquet", cwd=tmp_path)
    assert (done.returncode, "1 frame, 0 signals" in done.stdout) == (0, True)
