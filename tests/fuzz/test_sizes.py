"""Hostile sizes: each ends in an answer or an error of ours, within seconds and a few hundred MB.

Every case is a process of its own under limits of the system; what it took is what the system measured.
"""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from dvtcli.device.change.journal import SCHEMA
from tests.harness.sample import part

resource = pytest.importorskip("resource", reason="limits of a process are set this way on POSIX only")

#: CPU seconds and MB that a case may take; the system ends it at twice as much
SECONDS, MEGABYTES = 20, 700
_MB = 1 << 20
_EDS = "[DeviceInfo]\nVendorName=x\n"


@dataclass(frozen=True)
class Case:
    """Files to write, and the arguments for dvtcli; the exit code must be one of *codes*.

    *silent* is whether nothing is on stderr, None where that does not matter.
    """

    name: str
    words: tuple[str, ...]
    files: dict[str, Callable[[], str | bytes]]
    codes: tuple[int, ...]
    silent: bool | None = None


def _check(name: str, text: Callable[[], str], *, read: bool = True) -> Case:
    """A file whose errors are told on stdout where it could be *read* at all, else on stderr."""
    return Case(f"eds check: {name}", ("eds", "check", "x.eds"), {"x.eds": text}, (4,), silent=read)


def _on_sim(name: str, text: Callable[[], str], *words: str, codes: tuple[int, ...] = (0,)) -> Case:
    return Case(f"{' '.join(words)[:20]}: {name}", ("--sim", "x.eds", *words), {"x.eds": text}, codes)


def _script(name: str, text: Callable[[], str], *codes: int) -> Case:
    return Case(f"script: {name}", ("--sim", "gen4", "run", "x.dvt"), {"x.dvt": text}, codes)


def _settings(name: str, text: Callable[[], str]) -> Case:
    return Case(f"dvtcli.toml: {name}", ("--sim", "gen4", "pdo"), {"dvtcli.toml": text}, (4,))


def _journal(name: str, text: Callable[[], str]) -> Case:
    return Case(f"journal: {name}", ("--sim", "gen4", "recover", "j.json", "--yes"), {"j.json": text}, (4,))


def _network(name: str, text: Callable[[], str]) -> Case:
    return Case(f"network: {name}", ("--sim", "gen4", "plan", "x.yaml"), {"x.yaml": text}, (4,))


def _decoded(name: str, text: Callable[[], str | bytes], suffix: str = ".log", *codes: int) -> Case:
    return Case(f"decode {suffix}: {name}", ("decode", f"x{suffix}"), {f"x{suffix}": text}, codes or (4,))


def _dbc(name: str, text: Callable[[], str], *codes: int) -> Case:
    words = ("explain", "001#0102", "-d", "x.dbc")
    return Case(f"DBC: {name}", words, {"x.dbc": text}, codes or (4,))


def _crowded(count: int) -> str:
    """A message that *count* bits are signals of."""
    bits = "".join(f' SG_ s{bit} : {bit}|1@1+ (1,0) [0|0] "" X\n' for bit in range(count))
    return f"BO_ 1 a: 4000 X\n{bits}\n"


def _plain(count: int) -> str:
    """The usual messages, *count*, of eight signals each: 512 bytes."""
    line = ' SG_ Signal_{0}_{1} : {2}|8@1+ (0.1,-40) [-40|210.5] "degC" A,B\n'
    return "".join(
        f"BO_ {0x8000_0000 + message} Message_{message}: 8 A\n"
        f"{''.join(line.format(message, byte, 8 * byte) for byte in range(8))}\n"
        for message in range(count)
    )


def _family(name: str, text: Callable[[], str]) -> Case:
    files = {"q/simulated.toml": text, "q/x.eds": lambda: _EDS + "[1000]\nParameterName=n\nDataType=7\nAccessType=ro\n"}
    return Case(f"simulated.toml: {name}", ("--sim", "./q", "read", "1000"), files, (0, 4))


def _inflating(content: bytes, times: int = 1) -> bytes:
    """A BLF file with *content* in a container, packed, *times* times."""
    packed, whole = zlib.compress(content, 9), 144
    head = struct.pack("<4sLBBBBBBBBQQLL8H8H72x", b"LOGG", whole, 2, 0, 0, 0, 2, 6, 8, 1, whole, 1, 1, 1, *(0,) * 16)
    size = 32 + len(packed)
    place = struct.pack("<4sHHLL", b"LOBJ", 16, 1, size, 10) + struct.pack("<H6xL4x", 2, len(content))
    return head + (place + packed + bytes(size % 4)) * times


def _endless(content: bytes) -> bytes:
    """An object that says that it is 4 GB long, of which *content* is the beginning, or a part."""
    return struct.pack("<4sHHLL", b"LOBJ", 32, 1, 0xFFFF_FFF0, 1) + content


def _shared(keys: int, nodes: int) -> str:
    """Keys that nobody knows, which defaults bring to every node."""
    own = "".join(f"  n{number}: {{node_id: {number}}}\n" for number in range(1, nodes + 1))
    return "defaults:\n" + "".join(f"  heartbeat_pro{number}: 1\n" for number in range(keys)) + "nodes:\n" + own


def _sections(count: int, body: str = "") -> str:
    return _EDS + "".join(f"[{0x2000 + n // 256:04X}sub{n % 256:X}]\n{body}" for n in range(count))


def _many_objects(count: int, body: str) -> str:
    return _EDS + "".join(f"[{n:04X}]\nParameterName=n{n}\nDataType=7\nAccessType=rw\n{body}" for n in range(count))


def _numbers(digits: str) -> str:
    keys = ("SubNumber", "CompactSubObj", "ObjFlags", "DefaultValue", "LowLimit", "HighLimit", "PDOMapping", "DataType")
    return f"{_EDS}VendorNumber={digits}\n[2000]\nDataType=7\n" + "".join(f"{key}={digits}\n" for key in keys)


_NAME = "n" * _MB
_LONG_NAME = f"{_EDS}[2000]\nParameterName={_NAME}\nDataType=7\nAccessType=rw\n"
_LONG_TEXT = f"{_EDS}[2000]\nDataType=9\nAccessType=ro\nDefaultValue={_NAME * 5}\n"
_WIDE = f"{_EDS}[2000]\nParameterName=\U0001f600{'x' * (15 * _MB)}\nDataType=7\nAccessType=rw\n"
_LIST = f"{_EDS}[OptionalObjects]\n"
_FLOOD = [f"--bus-kwargs=k{number}=1" for number in range(20_000)]
_COMPACT = "CompactSubObj=254\n"
CASES = [
    _check("10 MB on one line", lambda: "x" * (10 * _MB), read=False),
    _check("a header of 10 MB", lambda: f"{_EDS}[{'x' * (10 * _MB)}]"),
    _check("a value of 10 MB", lambda: f"{_EDS}[2000]\nParameterName={'x' * (10 * _MB)}\nDataType=7\nAccessType=rw\n"),
    _check("10 MB of brackets", lambda: _EDS + "[" * (10 * _MB), read=False),
    _check("16 MB of wide letters", lambda: _WIDE),
    _check("450,000 bad lines", lambda: _EDS + "x\n" * 450_000),
    _check("10 MB of headers", lambda: _EDS + "[\n" * (5 * _MB), read=False),
    _check("10 MB of bad lines", lambda: _EDS + "x\n" * (5 * _MB), read=False),
    _check("65 MB", lambda: _EDS + "x" * (65 * _MB), read=False),
    _check("100,000 sections", lambda: _sections(100_000)),
    _check("a million sections", lambda: _sections(1_000_000), read=False),
    _check("100,000 times the same section", lambda: _EDS + "[2000]\nDataType=7\n" * 100_000),
    _check("100,000 unknown sections", lambda: _EDS + "".join(f"[x{n}]\n" for n in range(100_000))),
    _check("100,000 keys in a section", lambda: _EDS + "".join(f"k{n}={n}\n" for n in range(100_000))),
    _check("100,000 times the same key", lambda: _EDS + "k=1\n" * 100_000),
    _check("100,000 objects in a list", lambda: _LIST + "".join(f"{n}={n}\n" for n in range(100_000))),
    _check("SupportedObjects=9…9", lambda: f"{_EDS}[OptionalObjects]\nSupportedObjects={'9' * 40}\n1=0x2000\n"),
    _check("NrOfEntries=9…9", lambda: f"{_EDS}[2000]\n{_COMPACT}[2000Value]\nNrOfEntries={'9' * 40}\n1=1\n"),
    _check("NrOfTXPDO=512 and CompactPDO", lambda: f"{_EDS}NrOfTXPDO=512\nNrOfRXPDO=512\nCompactPDO=0xFF\n"),
    _check("numbers of a million digits", lambda: _numbers("9" * 1_000_000)),
    _check("hexadecimal numbers of a million digits", lambda: _numbers("0x" + "F" * 1_000_000)),
    _check("a sum of 500,000 terms", lambda: _numbers("$NODEID" + "+1" * 500_000)),
    _check("60,000 compact arrays of 254", lambda: _many_objects(60_000, _COMPACT), read=False),
    _check("60,000 objects that say CompactSubObj=0", lambda: _many_objects(60_000, "CompactSubObj=0\n")),
    _on_sim("900 compact arrays of 254", lambda: _many_objects(900, _COMPACT), "read", "nothing", codes=(2,)),
    _on_sim("60,000 compact arrays of 254", lambda: _many_objects(60_000, _COMPACT), "read", "nothing", codes=(4,)),
    _on_sim("60,000 objects", lambda: _many_objects(60_000, ""), "objects"),
    _on_sim("60,000 objects", lambda: _many_objects(60_000, ""), "read", "nothing", codes=(2,)),
    _on_sim("a name of 1 MB", lambda: _LONG_NAME, "objects"),
    _on_sim("a name of 1 MB", lambda: _LONG_NAME, "read", "n" * 99_999, codes=(2,)),
    _on_sim("a text of 5 MB", lambda: _LONG_TEXT, "read", "2000", codes=(5,)),
    _script("10 MB on one line", lambda: "x" * 9_999_999, 2),
    _script("10 MB of words", lambda: "map tpdo1" + " 6" * 4_000_000, 2, 4),
    _script("10 MB of objects", lambda: "map tpdo1" + " 6041" * 1_900_000, 1, 2, 4),
    _script("10 MB of quotes", lambda: "'\"" * 4_999_999, 2),
    _script("10 MB of line ends", lambda: "\n" * 9_999_999, 0),
    _script("10 MB of continuations", lambda: "\\\n" * 4_999_999, 0, 2),
    _script("11 MB", lambda: "#" * (11 * _MB), 4),
    _script("100,000 lines", lambda: "objects nothing\n" * 100_000, 4),
    _script("10,000 lines", lambda: "help pdo\n" * 10_000, 0),
    _script("a number of a million digits", lambda: f"write 1017 {'9' * 1_000_000}\n", 2),
    _script("a name of a million letters", lambda: f"read {'n' * 1_000_000}\n", 2),
    _settings("a nest of 90,000", lambda: "node = " + "[" * 90_000),
    _settings("10 MB", lambda: "#" * (10 * _MB)),
    _settings("a number of 90,000 digits", lambda: "node = " + "9" * 90_000),
    _settings("a key of 90,000 letters", lambda: "n" * 90_000 + " = 1"),
    _settings("tables in tables", lambda: "[" + "a." * 49_000 + "a]"),
    _journal("a nest of a million", lambda: "[" * 1_000_000),
    _journal("100 MB", lambda: " " * (100 * _MB)),
    _journal("a number of a million digits", lambda: f'{{"schema": "{SCHEMA}", "node": {"9" * 1_000_000}}}'),
    _journal("a million changes", lambda: f'{{"schema": "{SCHEMA}", "node": 1, "changes": [{"0," * 1_000_000}0]}}'),
    _network("5,000 unknown keys for 127 nodes", lambda: _shared(5_000, 127) + "  n1: {}\n"),
    _network("a number of 5,000 digits", lambda: f"nodes: {{a: {{node_id: 0{'1' * 5_000}}}}}\n"),
    _network("400 kB in one line", lambda: "nodes: [" + "{a: 1}, " * 50_000 + "]\n"),
    _network("short lines and commas", lambda: "nodes: {" + "a: 1,\n" * 39_000 + "}\n"),
    _network("1 MB of brackets", lambda: "nodes: " + "[" * (_MB - 8)),
    _network("1 MB of one word", lambda: "nodes: " + "x" * (_MB - 8)),
    _network("1 MB of comments", lambda: "#\n" * 500_000),
    _decoded("100 MB on one line", lambda: "x" * (100 * _MB)),
    _decoded("100 MB on one line", lambda: "date x\n" + "x" * (100 * _MB), ".asc"),
    _decoded("100 MB on one line", lambda: ";$FILEVERSION=2.1\n" + "x" * (100 * _MB), ".trc"),
    _decoded("128 MB of zeros", lambda: _inflating(bytes(1 << 27)), ".blf"),
    _decoded("1.6 GB in one object", lambda: _inflating(_endless(bytes(15 << 20)), 100), ".blf"),
    _decoded("an object in 200,000 containers", lambda: _inflating(_endless(b""), 200_000), ".blf"),
    _decoded("an object of 4 GB", lambda: _inflating(b"")[:144] + _endless(bytes(_MB)), ".blf"),
    _dbc("40,000 blank lines", lambda: "\n" * 40_000),
    _dbc("40,000 blank lines behind its version", lambda: 'VERSION ""\n' + "\n" * 40_000 + "BU_: x\n", 0, 4),
    _dbc("a frame of 30,000,000 bytes", lambda: "BO_ 1 a: 30000000 X\n SG_ s : 0|8@1+ (1,0) [0|0] \"\" X\n", 0, 4),
    _dbc("3,000 signals in 4,000 bytes", lambda: _crowded(3_000), 0, 4),
    _dbc("5 MB of 80,000 signals", lambda: _plain(10_000), 0),
    _dbc("5 MB of multiplexed signals", lambda: _plain(10_000).replace(" :", " m1 :"), 4),
    _dbc("a multiplexor of 4,000,000,000 values", lambda: f"{_crowded(2)}SG_MUL_VAL_ 1 s1 s0 0-4000000000;\n"),
    _dbc("8 MB of nodes", lambda: 'VERSION ""\nBU_: ' + "a " * (4 * _MB - 16)),
    _dbc("8 MB of comments", lambda: 'VERSION ""\n' + 'CM_ "";\n' * (_MB - 2), 0, 4),
    _dbc("1 MB of brackets", lambda: "BO_ 1 a: 8 X\n" + "(" * _MB),
    _family("3,000 blanks behind a bracket", lambda: 'about = """\n[' + " " * 3_000 + '\n"""\n'),
    _family("100,000 dots", lambda: "[" + "a." * 50_000 + "\n"),
    Case("20,000 times --bus-kwargs", ("-ivirtual", "-n1", *_FLOOD, "pdo"), {}, (5,)),
    Case("5,000 times --sim", (*["--sim=gen4"] * 5_000, "pdo"), {}, (2,)),
]  # fmt: skip

#: of those that do not take seconds each, how many are taken unless the run is long: `--fuzz 50000`
A_PART, LONG = 10, 50_000
SLOW = {
    *("eds check: 100,000 sections", "script: 10 MB on one line", "script: 10 MB of continuations"),
    *("eds check: 450,000 bad lines", "eds check: 100,000 times the same section", "script: 10,000 lines"),
    *("DBC: 3,000 signals in 4,000 bytes", "DBC: 8 MB of nodes", "DBC: 8 MB of comments", "DBC: 1 MB of brackets"),
    *("read nothing: 900 compact arrays of 254", "objects: 60,000 objects", "read nothing: 60,000 objects"),
    *("dvtcli.toml: tables in tables", "eds check: 60,000 objects that say CompactSubObj=0"),
}


#: Runs dvtcli under limits (CPU seconds, bytes) and prints what it took. A small process begins it: the peak memory of
#: a process counts that of the process it was forked from.
_MEASURE = """
import json, os, resource, subprocess, sys
seconds, size = map(int, sys.argv[1:3])
resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
resource.setrlimit(resource.RLIMIT_AS, (size, size))
child = subprocess.Popen([sys.executable, "-m", "dvtcli", *sys.argv[3:]], stdout=subprocess.DEVNULL)
_, status, used = os.wait4(child.pid, 0)
child.returncode = os.waitstatus_to_exitcode(status)
print(json.dumps([child.returncode, used.ru_utime + used.ru_stime, used.ru_maxrss]))
"""


def run(case: Case, folder: Path) -> tuple[int, str, float, float]:
    """Run *case* under limits: its exit code, what it said on stderr, CPU seconds and MB that it took."""
    for name, text in case.files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        content = text()
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())

    environment = {**os.environ, "HOME": str(folder), "XDG_STATE_HOME": str(folder), "XDG_DATA_HOME": str(folder)}
    with (folder / "stderr").open("wb") as stderr:
        measured = subprocess.run(
            [sys.executable, "-c", _MEASURE, str(2 * SECONDS), str(3 * MEGABYTES * _MB), *case.words],
            cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=stderr, check=True,
        )  # fmt: skip
    code, seconds, peak = json.loads(measured.stdout)
    said = (folder / "stderr").read_text(errors="replace")
    return code, said, seconds, peak / (1 << 20 if sys.platform == "darwin" else 1 << 10)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """All cases in a long run, else another part of the quick ones in each run."""
    chosen = CASES
    if metafunc.config.getoption("--fuzz") < LONG:
        chosen = part([case for case in CASES if case.name not in SLOW], A_PART, metafunc.config, "sizes")
    metafunc.parametrize("case", chosen, ids=lambda case: case.name)


@pytest.mark.drawn(2)
@pytest.mark.counted
def test_a_hostile_size_ends_in_time_and_in_memory(case: Case, tmp_path: Path) -> None:
    code, said, seconds, megabytes = run(case, tmp_path)
    assert "Traceback" not in said
    assert code in case.codes, said[:2000]
    assert case.silent in (None, not said), said[:2000]
    assert seconds < SECONDS
    assert megabytes < MEGABYTES
