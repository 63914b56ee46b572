"""Input that is nearly right: each reader's own grammar, with damage.

A maker takes a `random.Random`: a seeded one makes the same input again, Hypothesis's makes it smaller.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping
from copy import deepcopy
from functools import cache
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

from dvtcli.device.change.journal import SCHEMA
from dvtcli.domain.ports import Frame
from dvtcli.files.recordings.formats import formats
from dvtcli.files.recordings.recording_file import Recorder
from dvtcli.simulator.device.simulated_faults import FaultKind
from tests.files.captures import CAN, pcap
from tests.files.test_eds_any import KEYS, SAMPLE, SECTIONS
from tests.small_xdd import COMMISSIONING
from tests.small_xdd import xdd as small_xdd

Maker = Callable[[Random], bytes]

_NUMBERS = (
    *("0", "1", "-1", "8", "64", "127", "255", "0x", "0x10", "0xFF", "65535", "0x80000000", "0xFFFFFFFF", "-0x80"),
    *("010", "08", "1e999", "nan", "inf", "-0", "+5", "1_0", "9" * 39, "9" * 41, "9" * 5000, "0x" + "F" * 4000),
    *("$NODEID", "$NODEID+0x180", "0x180+$NODEID", "$NODEID+$NODEID", "٣", "1.5", ".5", "0.1", "true", ""),
)
_WORDS = (
    *("tpdo1", "rpdo4", "tpdo512", "tpdo0", "5:tpdo1", "6041", "0x6041:0", "6C01:1", "1A00:1", "1010:1", "dummy/16"),
    *("6041/16", "statusword", "Device type", "a.b", "auto", "keep", "0x201", "0x1FFFFFFF", "identity", "all", "save"),
    *("vendor=0x1E", "product=1", "start", "reset-node", "good.eds", "odd.eds", "journal.json", "self.dvt", "absent"),
    *(".", "-", "--", "/", "=", "#", '""', "''", "u8", "u32", "vs", "r32", "bool", "check", "show", "t", "1:2"),
    *("1018:1", "2000", "1000", "1600:0", "1800:1", "map", "pdo"),
)
_HOSTILE = ("\0", "\x1b[2J", "\u202e", "\udc80", "\ue000", "\ue001", "\u2028", "é", "ſ", "İ", "'", '"', "\\", "\t")
_COMMANDS = (
    *("clear", "disable", "enable", "eds", "help", "map", "nmt", "node", "objects", "pdo", "read", "recover", "undo"),
    *("restore", "run", "save", "set", "store", "sync", "require", "verify", "write", "exit"),
)
_OPTIONS = (
    *("--cob-id", "--type", "--inhibit", "--timer", "--sync-start", "--off", "--extended", "--no-rtr", "--rtr"),
    *("--force", "--yes", "--dry-run", "--json", "--format", "--quiet", "-v", "-vv", "--timeout", "--as", "--all"),
    *("--mappable", "--prove", "--keep-going", "--frame", "--check", "--period", "--help", "-n", "--sim", "--eds"),
    *("--color", "--ascii", "--bus-kwargs", "--journal", "--fault", "--profile", "-i", "-c", "-b"),
)


_LINES = (
    *("map tpdo1 6041 6064 --off", "map rpdo1 6040 dummy/16 --cob-id 0x201", "map tpdo2 1001/8 --type 1 --force"),
    *("set tpdo1 --type 254 --inhibit 10 --timer 100", "set rpdo1 --cob-id auto", "set tpdo1 --rtr --sync-start 3"),
    *("clear tpdo1", "enable tpdo1", "disable rpdo1", "undo --all", "store --prove", "restore 1", "store", "undo"),
    *("read 1018:1", "read 1008 --as os", "read 6041 --json", "read 6041 --as r32", "write 1017 1000", "node 1"),
    *("write 1800:1 0x80000181 --as u32", "write 1A00:0 0", "write 1010:1 save", "write 1008 abc --as vs", "pdo"),
    *("pdo tpdo1", "pdo --all --json", "pdo rpdo1 --ascii", "objects velocity", "objects --mappable tpdo --json"),
    *("require identity vendor=0x1E", "verify tpdo1", "verify tpdo1 good.eds", "verify good.eds", "verify odd.eds"),
    *("run self.dvt --keep-going", "run -", "recover journal.json --yes", "recover", "eds check good.eds"),
    *(
        "eds show odd.eds",
        "eds add good.eds",
        "sync --count 3 --period 20",
        "sync --check",
        "nmt start",
        "nmt stop all",
    ),
    *("nmt reset-node 1", "help map", "help", "save x.dvt", "exit", "pdo tpdo1 -vv", "verify tpdo1 --frame --yes"),
)


def damaged(random: Random, data: bytes) -> bytes:
    """*data* with a few bytes changed, cut out, doubled or put in."""
    broken = bytearray(data)
    for _ in range(random.randrange(4)):
        at = random.randrange(len(broken) + 1)
        match random.randrange(5):
            case 0 if at < len(broken):
                broken[at] = random.randrange(256)
            case 1:
                del broken[at : at + random.randrange(1, 12)]
            case 2:
                broken[at:at] = broken[at : at + random.randrange(1, 40)]
            case 3:
                broken[at:at] = random.choice(_HOSTILE).encode("utf-8", "surrogateescape")
            case _:
                broken[at:at] = random.choice(_NUMBERS).encode()
    return bytes(broken)


def plain_bytes(random: Random) -> bytes:
    """Any bytes, mostly few."""
    return random.getrandbits(8 * 64).to_bytes(64, "little")[: random.choice((0, 1, 3, 8, 20, 64))]


def eds(random: Random) -> bytes:
    """An EDS with lines swapped, doubled and dropped, other values, other sections, other encodings."""
    lines = SAMPLE.decode().split("\n")
    for _ in range(random.randrange(1, 10)):
        at, other = random.randrange(len(lines)), random.randrange(len(lines))
        match random.randrange(7):
            case 0:
                lines[at], lines[other] = lines[other], lines[at]
            case 1:
                lines.insert(at, lines[other])
            case 2:
                del lines[at : at + random.randrange(1, 4)]
                lines.append("")
            case 3:
                lines[at] = f"[{_section(random)}]"
            case 4:
                lines[at] = f"{lines[at].partition('=')[0]}={_value(random)}"
            case 5:
                lines.insert(at, f"{random.choice(KEYS)}={_value(random)}")
            case _:
                first = min(at, other)
                lines += lines[first : first + 8]
    return _encoded(random, random.choice(("\n", "\r\n", "\r")).join(lines))


def _section(random: Random) -> str:
    index = f"{random.choice((0x1000, 0x1400, 0x1600, 0x1800, 0x1A00, 0x1A01, 0x1018, 0x2000, 0, 0xFFFF)):04X}"
    return random.choice((*SECTIONS, index, f"{index}sub{random.randrange(256):x}", f"{index}Value", f"{index}Name"))


def _value(random: Random) -> str:
    return random.choice(_NUMBERS) if random.randrange(3) else random.choice((*_HOSTILE, "ro", "rw", "const", "0x0009"))


def _encoded(random: Random, text: str) -> bytes:
    match random.randrange(12):
        case 0:
            return text.encode("utf-16", "replace")
        case 1:
            return text.encode("latin-1", "replace")
        case 2:
            return text.encode("utf-8-sig", "replace")
        case 3:
            return damaged(random, text.encode("utf-8", "surrogateescape"))
        case _:
            return text.encode("utf-8", "surrogateescape")


_PROFILE_LINES = (
    *('name = "x"', 'title = "t"', 'like = "gen4"', "vendor_ids = [1]", "product_masks = [[255, 1]]", "pdo_count = 4"),
    *('rtr_bit = {rpdo = "set", tpdo = "keep"}', "transmission_types = [[0, 240]]", 'rw_in_tpdo = "fine"', "[store]"),
    *("sub_indices = [1]", "timeout_s = 2.5", "covers = [0, 9]", "[login]", 'level = "5000:01"', "[aliases]"),
    *('"6C01:01" = "x"', "[reasons]", '1-240 = "x"', "[vpdo.a]", "index = 1", "dummies = [1]", "extended_ids = true"),
    *("[warn_mapped]", '1000-1FFF = "x"', 'state_object = "2800:00"', "[[store]]", 'instead = "x"', "max_entries = 8"),
)
_TOML_VALUES = (
    *("[]", "{}", "nan", "-inf", "1e400", "1979-05-27", "12:00:00", "''", '"\\u0000"', "[[[]]]", "[" * 300, "{a=1}"),
    *("0x" + "F" * 5000, "9" * 5000, "true", '"""a\nb"""', "-1", "[1, 'a']", '"\\U0001F600"', "'''", "[0xFFFFFFFFFF]"),
)


def _toml(random: Random, known: tuple[str, ...]) -> bytes:
    lines = [random.choice(known) for _ in range(random.randrange(1, 8))]
    for _ in range(random.randrange(3)):
        at = random.randrange(len(lines))
        lines[at] = f"{lines[at].partition('=')[0]}= {random.choice(_TOML_VALUES)}"
    data = "\n".join(lines).encode()
    return data if random.randrange(2) else damaged(random, data)


def profile_toml(random: Random) -> bytes:
    """A profile with other values."""
    start = b"" if random.randrange(4) == 0 else b'name = "x"\ntitle = "t"\n'
    return start + _toml(random, _PROFILE_LINES)


_DEFAULT_LINES = (
    *('interface = "virtual"', 'channel = "a"', "bitrate = 500000", 'bus_kwargs = ["a=b"]', "node = 5"),
    *('sim = ["gen4"]',),
    *('fault = ["silent@1"]', "dry-run = true", 'eds = "x"', 'profile = "gen4"', 'format = "json"', "quiet = true"),
    *("verbose = 2", 'color = "never"', "ascii = false", "yes = true", "force = false", "timeout = 0.5"),
    *('journal = "x"',),
    *('sim = "gen4"', "quiet = 2", "timeout = 'x'", "node = '0x7'", "verbose = 99999999999999999999"),
)


def defaults(random: Random) -> bytes:
    """A dvtcli.toml with other values."""
    return _toml(random, _DEFAULT_LINES)


def line(random: Random) -> bytes:
    """A command with words that it or another could take."""
    if random.randrange(4):
        words = random.choice(_LINES).split()
        for _ in range(random.randrange(3)):
            at = random.randrange(1, len(words) + 1)
            words[at : at + random.randrange(2)] = [_word(random)]
    else:
        words = [random.choice(_COMMANDS), *(_word(random) for _ in range(random.randrange(6)))]
    text = " ".join(words)
    if not random.randrange(4):
        return damaged(random, text.encode("utf-8", "surrogateescape"))
    return text.encode("utf-8", "surrogateescape")


def _word(random: Random) -> str:
    match random.randrange(8):
        case 0 | 1:
            return random.choice(_OPTIONS)
        case 2:
            return random.choice(_NUMBERS[:-10]) or "0"
        case 3:
            return random.choice(_HOSTILE) + random.choice(_WORDS)
        case _:
            return random.choice(_WORDS)


def script(random: Random) -> bytes:
    """Lines of commands, with comments, continuations and quotes."""
    lines = [line(random) for _ in range(random.randrange(1, 4))]
    ends = (b"\n", b"\r\n", b"\r", b" \\\n", b"\\\n", b" # x\n", b"\n# c\n\n")
    text = b"".join(each + random.choice(ends) for each in lines)
    return (b"\xef\xbb\xbf" if not random.randrange(8) else b"") + text


def syntax(random: Random) -> bytes:
    """One word."""
    text = random.choice((*_WORDS, *_NUMBERS))
    if random.randrange(2):
        text += random.choice((":", "/", ".", "@", "", "=")) + random.choice((*_WORDS, *_NUMBERS))
    data = text.encode("utf-8", "surrogateescape")
    return data if random.randrange(2) else damaged(random, data)


_VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, 1, -1, 127, 128, 255, 256, 65536, 1 << 32, 10**400, 1.5, float("nan"), float("inf")),
    *("", "x", "tpdo1", "\ud800", "00", "zz", [], [1], [[]], {}, {"": 1}, "1" * 5000),
)


def journal(random: Random) -> bytes:
    """A journal with values of other types and sizes, missing keys, and deep nests."""
    word = {
        "cob_id": 0x40000181, "transmission_type": 255, "inhibit_time": 0, "event_timer": None,
        "sync_start_value": None, "mapping": [0x60410010], "mpdo": None,
    }  # fmt: skip
    other = {**word, "cob_id": 0xC0000181, "mapping": [0x60410010, 0x60640020]}
    document: dict[str, Any] = {
        "schema": SCHEMA, "bus": "can0", "node": 1, "identity": {"vendor": 30, "product": None}, "nmt_state": 127,
        "changes": [
            {"pdo": "tpdo1", "before": word, "after": other},
            {"object": [0x2000, 1], "before": "00", "after": "01"},
        ],
    }  # fmt: skip
    for _ in range(random.randrange(4)):
        _spoil(random, document)
    text = json.dumps(document)
    match random.randrange(12):
        case 0:
            return text.replace("127", "[" * 2000).encode()
        case 1:
            return text.encode("utf-16")
        case 2:
            return text.replace("127", "9" * 5000).encode()
        case 3:
            return damaged(random, text.encode())
        case _:
            return text.encode()


def _spoil(random: Random, document: Any) -> None:
    """Put another value somewhere into *document*."""
    inner = document
    while True:
        keys = list(inner) if isinstance(inner, dict) else list(range(len(inner)))
        if not keys:
            return
        key = random.choice(keys)
        if isinstance(inner[key], dict | list) and random.randrange(4):
            inner = inner[key]
            continue
        if random.randrange(5) == 0:
            del inner[key]
        else:
            inner[key] = deepcopy(random.choice(_VALUES))
        return


def fault(random: Random) -> bytes:
    """A fault's text with other numbers."""
    text = random.choice(("", "", "1:", "0x7F:", "300:", "x:")) + random.choice(list(FaultKind))
    text += random.choice(("", "@1", "@0", "@0x10", "@٣", f"@{random.choice(_NUMBERS)}"))
    text += random.choice(("", "=0.5", "=0x06040041", f"={random.choice(_NUMBERS)}"))
    data = text.encode("utf-8", "surrogateescape")
    return data if random.randrange(3) else damaged(random, data)


def sdo_client(random: Random) -> bytes:
    """A transfer and the server's moves, most of them honest."""
    honest = random.randrange(1, 6)
    moves = []
    for _ in range(random.randrange(24)):
        moves += [random.randrange(5) if random.randrange(honest) else random.randrange(16), random.randrange(256)]
    size = random.choice((0, 1, 2, 4, 5, 7, 8, 14, 30, 200))
    return bytes([random.randrange(256), size, random.randrange(16), *moves])


#: heads of block transfers: initiate, start, acknowledge, end, and segments
_BLOCK = (0xA0, 0xA4, 0xA3, 0xA2, 0xA1, 0xC0, 0xC2, 0xC6, 0xC1, 0x02, 0x81, 0x82, 0x7F, 0xFF)


def sdo_server(random: Random) -> bytes:
    """Frames for a server: initiates, segments and others, on objects that exist and do not."""
    data = bytearray()
    for _ in range(random.randrange(1, 12)):
        index = random.choice((0x1000, 0x1008, 0x1010, 0x1017, 0x1018, 0x1400, 0x1600, 0x1800, 0x1A00, 0x2000, 0x6040))
        head = random.choice((0x40, 0x60, 0x70, 0x23, 0x2B, 0x2F, 0x21, 0x22, 0x00, 0x10, 0x01, 0x0F, 0x80, *_BLOCK))
        value = random.choice((0, 1, 0x65766173, 0x60410010, 0x80000181, 0x40000181, random.getrandbits(32)))
        frame = bytes([head]) + index.to_bytes(2, "little") + bytes([random.choice((0, 1, 2, 5, 255))])
        frame += value.to_bytes(4, "little")
        if not random.randrange(6):
            frame = frame[: random.randrange(9)]
        data += bytes([len(frame) | random.randrange(16) << 4]) + frame
    return bytes(data)


def view(random: Random) -> bytes:
    """Text with characters that steer terminals."""
    parts = [random.choice((*_HOSTILE, *_WORDS, "\x9b", "\x7f", "\r", "\n", "\u200b", "\U000e0001")) for _ in range(4)]
    if not random.randrange(4):
        parts.append(chr(random.choice((random.randrange(0x300), random.randrange(0xD800), random.randrange(0x2000)))))
    return "".join(parts[: 1 + random.randrange(5)]).encode("utf-8", "surrogateescape")


_NETWORK = """\
bitrate: 500
master: {node_id: 127, heartbeat_producer: 100, sync_period: 10000}
defaults:
  heartbeat_producer: 1000
  sdo: [{object: "2000:01", value: 5}]
drive:
  node_id: 5
  dcf: drive.dcf
  identity: {vendor: 0x1E, product: 7}
  heartbeat_consumer: true
  tpdo:
    1: {cob_id: auto, mapping: [statusword, "6064:00/32"], transmission: 254, event_timer: 100}
    2: {enabled: false}
  rpdo:
    1:
      cob_id: 0x201
      mapping:
        - controlword
        - dummy/16
io: &io
  node_id: 6
  physical: {"6000:01": {unit: V, factor: 0.1}}
links:
  - {from: "drive:tpdo1", to: ["io:rpdo1"]}
"""
_YAML_TOKENS = (
    *(
        "*io",
        "<<: *io",
        "&a",
        "!!int x",
        "!!python/object:os.system {}",
        "{",
        "[",
        "]",
        "- - - x",
        "? x",
        ": :",
        "|",
        ">",
    ),
    *(
        "---",
        "...",
        "%YAML 9.9",
        "0o17",
        "0b1",
        "1:30:00",
        ".inf",
        ".nan",
        "~",
        "2001-12-14t21:59:43Z",
        "yes",
        "\t",
        "#",
    ),
)
_DBC = """\
VERSION ""
NS_ :
BS_:
BU_: A B
BO_ 400 M: 8 A
 SG_ Mux M : 0|8@1+ (1,0) [0|0] "" B
 SG_ Sub m0M : 8|8@1+ (1,0) [0|0] "V" A
 SG_ Deep m3 : 23|16@0- (0.5,-40) [0|0] "" A
 SG_ Real : 32|32@1- (1,0) [0|0] "" A

BO_ 2566844672 E: 8 B

CM_ SG_ 400 Mux "a \\"comment\\"";
VAL_ 400 Mux 0 "off" 1 "on" ;
SIG_VALTYPE_ 400 Real : 1;
SG_MUL_VAL_ 400 Sub Mux 0-0;
SG_MUL_VAL_ 400 Deep Sub 3-3, 5-9;
"""
_LOGS = (
    "(1700000000.000000) can0 181#3706E80300000000\n(1700000000.500000) can0 1ABCDEF0#R\n"
    "(1700000001.000000) can1 20000080#0000000000000000\n(1700000001.000000) can1 701##105\n",
    "date Tue Nov 14 22:13:20.000 2023\nbase hex  timestamps absolute\ninternal events logged\n"
    "Begin TriggerBlock Tue Nov 14 22:13:20.000 2023\n 0.000000 Start of measurement\n"
    " 0.100000 1  181             Rx   d 8 37 06 E8 03 00 00 00 00\n 0.200000 1  1ABCDEF0x       Rx   r\n"
    " 0.300000 2  ErrorFrame\nEnd TriggerBlock\n",
    ";$FILEVERSION=2.1\n;$STARTTIME=45244.9259259259\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
    "      1       0.100 DT 1      0181 Rx -  8    37 06 E8 03 00 00 00 00\n"
    "      2       0.200 RR 1      0181 Rx -  8\n      3       0.300 ER 1         - Rx -  5    04 00 02 00 00\n",
)
_VALUES_TEXT = (
    'time_s,drive.statusword [V],x\n0.0,1,2\n0.5,,\'=1\n1e3,-4.5,"a\nb"\n',
    '{"schema": "dvtcli.frame/1", "time": "2023-11-14T22:13:20+00:00", "signals": {"speed": 1, "x": null}}\n' * 2,
)
_GATEWAY = (
    *("[1] 1 5 r 0x1000 0 u32", "[2] 5 w 0x1017 0 u16 400", "[3] set rpdo 1 0x201 event 1 0x6040 0 u16", "[4] 5 start"),
    *("[5] set sdo_timeout 500", "[6] info version", '[7] 5 w 0x1008 0 vs "a ""b"" c"', "[8] 5 w 0x2000 1 os AAEC"),
    *("[9] w pdo 1 2 3 4", "[10] r pdo 1", "[11] 5 enable guarding 100 3", "[12] boot_up_indication enable"),
)
_KEPT = (
    "[Topology]\nNodes=2\nNetName=a\nNode1Present=1\nNode1Name=drive\nNode1DCFName=drive.dcf\nEDSBaseName=.\n",
    "pdo: tpdo1\ncob_id: 0x181\nenabled: true\ntype: 1\ninhibit_ms: 10\nmapping:\n  - 6041:00/16 # statusword\n",
    '{"schema": "dvtcli.sim-state/1", "node": 1, "values": {"1017:00": "e803", "1008:00": "00"}}',
    '{"schema": "dvtcli.whole-device/1", "node": 1, "identity": {"vendor": 1}, "made": "x", "objects": 1}\n'
    '{"object": "1017:00", "raw": "e803"}\n',
    '{"schema": "dvtcli.plan/1", "file": "n.yaml", "nodes": [{"node": 1, "name": "a", '
    '"identity": {"vendor": 1, "product": null}, "changes": [], "holds": []}]}',
)


def _edited(random: Random, text: str, tokens: tuple[str, ...]) -> bytes:
    """*text* with lines moved, doubled, dropped and cut, and words put in or exchanged."""
    lines = text.split("\n")
    for _ in range(random.randrange(1, 6)):
        at, other = random.randrange(len(lines)), random.randrange(len(lines))
        word = random.choice((*tokens, *_NUMBERS, *_HOSTILE))
        match random.randrange(6):
            case 0:
                lines[at], lines[other] = lines[other], lines[at]
            case 1:
                lines.insert(at, lines[other])
            case 2:
                lines[at] = ""
            case 3:
                cut = random.randrange(len(lines[at]) + 1)
                lines[at] = lines[at][:cut] + word + lines[at][cut:]
            case 4:
                words = lines[at].split(" ")
                words[random.randrange(len(words))] = word
                lines[at] = " ".join(words)
            case _:
                lines[at] = " " * random.randrange(6) + lines[at].lstrip()
    return _encoded(random, "\n".join(lines))


def network(random: Random) -> bytes:
    """A network file with other values, places and YAML."""
    return _edited(random, _NETWORK, _YAML_TOKENS)


def dbc(random: Random) -> bytes:
    """A DBC with other values and places."""
    return _edited(random, _DBC, ("BO_", "SG_", '"', ";", "M", "m1", "0-4000000000", "0-9, 5-6", "@", "1|1@1+", "CM_"))


@cache
def _binary_recordings() -> Mapping[str, bytes]:
    """A short recording of each format that is not text."""
    found = {}
    frames = [Frame(0x181 + n, bytes(range(n)), timestamp_s=1.7e9 + n / 8) for n in range(6)]
    with TemporaryDirectory() as folder:
        for suffix in (".blf", ".pcapng"):
            path = Path(folder, f"a{suffix}")
            with Recorder(path) as recorder:
                for frame in frames:
                    recorder.write(frame)
            found[suffix] = path.read_bytes()
    found[".pcap"] = pcap(frames, "<", nanoseconds=False, link=CAN)
    return found


def recording(random: Random) -> bytes:
    """A recording, of each format that is read, with its number before it."""
    suffixes = [suffix for suffix in formats() if suffix != ".mf4"]
    number = random.randrange(len(suffixes))
    texts = dict(zip((".log", ".asc", ".trc"), _LOGS, strict=True))
    text = texts.get(suffixes[number])
    if text is None:
        return bytes([number]) + damaged(random, _binary_recordings()[suffixes[number]])
    return bytes([number]) + _edited(
        random, text, ("#", "##", "R", "Rx", "Tx", "d", "ErrorFrame", "T", "FFFFFFFF", ";")
    )


@cache
def _mdf() -> bytes:
    """A short recording of ASAM's."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "a.mf4")
        with Recorder(path) as recorder:
            for number in range(6):
                recorder.write(Frame(0x181 + number, bytes(range(number)), timestamp_s=1.7e9 + number / 8))
        return path.read_bytes()


def mdf(random: Random) -> bytes:
    """A damaged recording of ASAM's, which asammdf has to be there for."""
    return damaged(random, _mdf())


def values(random: Random) -> bytes:
    """Values as CSV or JSON lines."""
    number = random.randrange(2)
    made = _edited(random, _VALUES_TEXT[1 - number], (",", '"', "'", "{", "}", "[", "null", ":", "1,2,3", "\r"))
    return bytes([number]) + made


def xdd(random: Random) -> bytes:
    """An XDD or XDC with other values, elements and entities."""
    tokens = (
        "<a>",
        "</a>",
        "<!--",
        "-->",
        "<![CDATA[",
        "]]>",
        "&x;",
        "&#0;",
        "<!DOCTYPE a [<!ENTITY x 'y'>]>",
        '"',
        ">",
    )
    return _edited(random, small_xdd(commissioning=COMMISSIONING).replace("><", ">\n<"), tokens)


def gateway_line(random: Random) -> bytes:
    """A line of CiA 309-3."""
    tokens = ("[1]", "[", "]", "r", "w", "set", "start", "u8", "vs", '"', "event", "sync", "rtr", "all", "0", "pdo")
    return _edited(random, random.choice(_GATEWAY), tokens).replace(b"\n", b" ")


def concise(random: Random) -> bytes:
    """A concise DCF: a count, and entries with their lengths."""
    entries = [
        (random.randrange(0x10000), random.randrange(256), random.randbytes(random.randrange(6))) for _ in range(4)
    ]
    told = b"".join(struct.pack("<HBL", index, sub, len(data)) + data for index, sub, data in entries)
    return damaged(random, struct.pack("<L", random.choice((4, 4, 4, 0, 5, 1 << 31))) + told)


def history(random: Random) -> bytes:
    """Lines that were typed."""
    return _edited(random, "# 2023-11-14 22:13:20\n+pdo\n+map tpdo1 6041\n\n# 2023\n+read 1018:1\n", ("+", "#", "\r"))


def kept(random: Random) -> bytes:
    """One of what dvtcli keeps besides, with its number before it."""
    number = random.randrange(len(_KEPT))
    return bytes([number]) + _edited(
        random, _KEPT[number], ("{", "}", "[", "]", '"', "null", "true", ":", "=", *_YAML_TOKENS)
    )


#: by target
MAKERS: dict[str, Maker] = {
    "eds": eds, "dcf": eds, "profile_toml": profile_toml, "defaults": defaults, "script": script, "line": line,
    "syntax": syntax, "journal": journal, "fault": fault, "sdo_client": sdo_client, "sdo_server": sdo_server,
    "view": view, "device": eds, "network": network, "dbc": dbc, "recording": recording, "mdf": mdf, "values": values,
    "xdd": xdd, "gateway_line": gateway_line, "concise": concise, "history": history, "kept": kept,
}  # fmt: skip


def make(target: str, random: Random) -> bytes:
    """An input for *target*: one in eight is plain bytes."""
    return plain_bytes(random) if not random.randrange(8) else MAKERS[target](random)
