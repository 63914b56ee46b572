"""The two families calibrated to public stacks: what was observed of each, row by row, and how it is asked.

The data of two drivers: in-process (`test_stacks`) and over a link (`tests/simulator/serve/test_conformance`).
A cell is written as it was noted: `/` separates the writes of a case, `!` marks an aborted read, `cob= n= e1= e2=` is
TPDO1 read back. Columns: the first stack, the second one in OPERATIONAL and in PRE-OPERATIONAL.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import pytest

from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import Frame
from tests.simulator.bench import Aborted, Bench, Silent

SAVE, LOAD = b"save", b"load"


@dataclass(frozen=True)
class Stack:
    """A column: the node, and the mapping entries that its probes used."""

    family: str
    node_id: int
    operational: bool
    cob_id: int  # of TPDO1, enabled
    m8: int
    m16: int
    m32: int
    m64: int
    no_pdo: int  # an object that cannot be mapped
    rpdo_32: int
    read_only: int
    write_only: int = 0

    @property
    def rtr(self) -> int:
        return self.cob_id & 0x40000000


FIRST = Stack("canopennode", 5, False, 0x40000185, 0x60000108, 0x64010110, 0x21100120, 0x21000040, 0x21020010,
              0x21100220, 0x60000108)  # fmt: skip
SECOND = Stack("lely", 8, True, 0x188, 0x20050008, 0x20060010, 0x20070020, 0x20080040, 0x20330008,
               0x20070020, 0x20310008, 0x20320008)  # fmt: skip
IDLE = replace(SECOND, operational=False)


class Probe:
    """A node of *stack* and how it is asked."""

    def __init__(self, stack: Stack, bench: Bench) -> None:
        self.stack = stack
        self.bench = bench
        self.client = bench.client

    def write(self, index: int, sub_index: int, value: int, size: int, *, segmented: bool = False) -> str:
        send = self.client.write_segmented if segmented else self.client.write_bytes
        try:
            send(index, sub_index, value.to_bytes(size, "little"))
        except Aborted as abort:
            return f"{abort.code:08X}"
        except Silent:
            return "timeout"
        return "ok"

    def text(self, index: int, sub_index: int, data: bytes) -> str:
        return self.write(index, sub_index, int.from_bytes(data, "little"), len(data))

    def read(self, index: int, sub_index: int = 0) -> str:
        try:
            return f"{self.client.number(index, sub_index):X}"
        except Aborted as abort:
            return f"!{abort.code:08X}"
        except Silent:
            return "!timeout"

    def cob(self, value: int) -> str:
        return self.write(0x1800, 1, value, 4)

    def kind(self, value: int) -> str:
        return self.write(0x1800, 2, value, 1)

    def count(self, value: int) -> str:
        return self.write(0x1A00, 0, value, 1)

    def entry(self, sub_index: int, value: int) -> str:
        return self.write(0x1A00, sub_index, value, 4)

    def off(self) -> str:
        return self.cob(self.stack.cob_id | 1 << 31)

    def shown(self) -> str:
        cob, count, first, second = self.read(0x1800, 1), self.read(0x1A00), self.read(0x1A00, 1), self.read(0x1A00, 2)
        return f"cob={cob} n={count} e1={first} e2={second}"

    def sequence(self, *, kind: int | None = None) -> list[str]:
        stack = self.stack
        types = [] if kind is None else [self.kind(kind)]
        return [
            self.off(), *types, self.count(0), self.entry(1, stack.m8), self.entry(2, stack.m16), self.count(2),
            self.cob(stack.cob_id),
        ]  # fmt: skip

    def ready(self) -> Probe:
        """Mapped by the right sequence, in the column's NMT state."""
        self.sequence(kind=1)
        self.bench.nmt(NmtCommand.START if self.stack.operational else NmtCommand.ENTER_PRE_OPERATIONAL)
        return self

    def empty(self) -> Probe:
        """Ready, disabled and with count 0."""
        self.ready()
        self.off()
        self.count(0)
        return self

    def start(self) -> None:
        self.bench.nmt(NmtCommand.START)

    def mapped(self, *entries: int) -> str:
        """Entries, then their count, from an empty mapping."""
        self.empty()
        answers = [self.entry(sub_index, raw) for sub_index, raw in enumerate(entries, 1)]
        return "/".join([*answers, self.count(len(entries))])


def fresh(probe: Probe) -> str:
    return "/".join(probe.read(0x1800, sub_index) for sub_index in (0, 3, 4, 5, 6))


def b1(probe: Probe) -> str:
    answers = probe.sequence(kind=1)
    probe.start()
    (frame,) = [each for each in probe.bench.sync() if each.can_id == probe.stack.cob_id & 0x7FF]
    return f"{'/'.join(answers)} ¦ {probe.shown()} ¦ SYNC->{len(frame.data)} bytes {frame.data.hex()}"


def b2(probe: Probe) -> str:
    probe.start()
    return "/".join(probe.sequence())


def b5(probe: Probe) -> str:
    probe.ready().off()
    return f"{probe.entry(1, probe.stack.m16)}/{probe.shown()}"


def one(raw: Callable[[Stack], int], *, counted: bool = True, read: bool = False) -> Callable[[Probe], str]:
    """A case of one entry: what writing it answers, what is read back, what a count of 1 answers then."""

    def case(probe: Probe) -> str:
        probe.empty()
        answers = [probe.entry(1, raw(probe.stack))]
        answers += [probe.read(0x1A00, 1)] if read else []
        return "/".join(answers + ([probe.count(1)] if counted else []))

    return case


def many(entries: Callable[[Stack], tuple[int, ...]], *, read: bool = True) -> Callable[[Probe], str]:
    def case(probe: Probe) -> str:
        answer = probe.mapped(*entries(probe.stack))
        return f"{answer}/{probe.read(0x1A00)}" if read else answer

    return case


def c12(probe: Probe) -> str:
    probe.empty()
    return f"{probe.count(9)}/{probe.read(0x1A00)}"


def d1(probe: Probe) -> str:
    probe.ready()
    return f"{probe.off()}/{probe.write(0x1A00, 0, 0, 4)}"


def d3(probe: Probe) -> str:
    probe.empty()
    return f"{probe.write(0x1A00, 1, probe.stack.m8, 4, segmented=True)}/{probe.read(0x1A00, 1)}"


def d4(probe: Probe) -> str:
    probe.empty()
    return f"{probe.entry(1, probe.stack.m8)}/{probe.write(0x1A00, 0, 1, 1, segmented=True)}/{probe.read(0x1A00)}"


def e1(probe: Probe) -> str:
    probe.empty()
    return f"{probe.cob(probe.stack.cob_id)}/{probe.read(0x1800, 1)}"


def cob_case(wanted: Callable[[Stack], int], *, off: bool = False) -> Callable[[Probe], str]:
    def case(probe: Probe) -> str:
        probe.ready()
        if off:
            probe.off()
        return f"{probe.cob(wanted(probe.stack))}/{probe.read(0x1800, 1)}"

    return case


def e6(probe: Probe) -> str:
    probe.ready().off()
    answer = probe.cob(0x3A0)
    cob_id = probe.read(0x1800, 1)
    probe.start()
    sent = [frame for _ in range(8) for frame in probe.bench.sync() if frame.can_id == 0x3A0]
    return f"{answer} cob={cob_id} frames@3A0={len(sent)}"


def e7(probe: Probe) -> str:
    probe.ready()
    answers = []
    for can_id in (0x000, 0x080, 0x581, 0x601, 0x701):
        probe.off()
        answers.append(f"{can_id:03X}:{probe.cob(can_id)}")
    return "/".join(answers)


def e8(probe: Probe) -> str:
    probe.ready()
    probe.cob(1 << 31 | probe.stack.cob_id & 0x7FF)
    return f"{probe.cob(0x20012345)}/{probe.read(0x1800, 1)}"


def e9(probe: Probe) -> str:
    probe.ready()
    plain = 1 << 31 | probe.stack.cob_id & 0x7FF
    answers = []
    for value in (plain | 1 << 30, plain):
        answers += [probe.cob(value), probe.read(0x1800, 1)]
    return "/".join(answers)


def e10(probe: Probe) -> str:
    other = int(probe.read(0x1801, 1), 16) & 0x7FFFFFFF
    probe.ready().off()
    return f"{probe.cob(other | 1 << 31)}/{probe.cob(other)}"


def f1(probe: Probe) -> str:
    probe.ready().off()
    return "/".join(f"{kind}:{probe.kind(kind)}" for kind in (0, 1, 240, 241, 252, 253, 254, 255))


def f2(probe: Probe) -> str:
    probe.ready()
    return f"{probe.kind(2)}/{probe.kind(255)}"


def timed(sub_index: int, size: int, enabled: int) -> Callable[[Probe], str]:
    """A communication parameter while disabled, then *enabled* times while enabled."""

    def case(probe: Probe) -> str:
        probe.ready().off()
        answers = [probe.write(0x1800, sub_index, 10, size)]
        probe.cob(probe.stack.cob_id)
        answers += [probe.write(0x1800, sub_index, value, size) for value in (20, 0)[:enabled]]
        return "/".join(answers)

    return case


def g1(probe: Probe) -> str:
    probe.ready()
    probe.start()
    answer = (probe.kind(255), probe.write(0x1800, 5, 50, 2))[1]

    can_id = probe.stack.cob_id & 0x7FF
    operational = probe.bench.events(can_id, 551)
    probe.bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    idle = probe.bench.events(can_id, 551)
    return f"ev={answer} frames/0.55s={operational} in PREOP={idle} reset={probe.write(0x1800, 5, 0, 2)}"


def g2(probe: Probe) -> str:
    probe.sequence(kind=255)
    probe.start()
    return f"{len(probe.bench.receive(Frame(probe.stack.cob_id & 0x7FF, b'', remote=True)))} answers"


def h1(probe: Probe) -> str:
    probe.ready()
    entry, can_id = probe.stack.rpdo_32, 0x200 + probe.stack.node_id
    writes = ((0x1400, 1, 1 << 31 | can_id, 4), (0x1400, 2, 255, 1), (0x1600, 0, 0, 1), (0x1600, 1, entry, 4),
              (0x1600, 0, 1, 1), (0x1400, 1, can_id, 4))  # fmt: skip
    answer = "/".join([*(probe.write(*write) for write in writes), probe.read(0x1400, 1)])
    probe.start()
    codes = []
    for data in ("44332211", "0102", "887766559999"):
        codes += [frame.data[:2][::-1].hex() for frame in probe.bench.receive(Frame(can_id, bytes.fromhex(data)))]
        value = probe.client.number(entry >> 16, entry >> 8 & 0xFF)
        answer += f"/{len(data) // 2}B->{value:X}"
    return f"{answer} EMCY:{','.join(codes)}"


def rpdo(*entries: Callable[[Stack], int]) -> Callable[[Probe], str]:
    def case(probe: Probe) -> str:
        probe.ready()
        probe.write(0x1400, 1, 1 << 31 | 0x200 + probe.stack.node_id, 4)
        probe.write(0x1600, 0, 0, 1)
        answers = [probe.write(0x1600, sub, entry(probe.stack), 4) for sub, entry in enumerate(entries, 1)]
        return "/".join([*answers, probe.write(0x1600, 0, len(entries), 1)])

    return case


def h4(probe: Probe) -> str:
    probe.ready()
    probe.write(0x1400, 1, 1 << 31 | 0x200 + probe.stack.node_id, 4)
    answers = [probe.write(0x1400, 2, kind, 1) for kind in (1, 241, 255)]
    return "/".join([*answers, probe.write(0x1400, 3, 10, 2), probe.write(0x1400, 5, 10, 2)])


def signatures(index: int, *texts: bytes) -> Callable[[Probe], str]:
    return lambda probe: "/".join(probe.ready().text(index, 1, each) for each in texts)


def i2(probe: Probe) -> str:
    return f"{probe.text(0x1010, 1, SAVE)}/{probe.read(0x1010, 1)}"


def i2b(probe: Probe) -> str:
    probe.start()
    return probe.text(0x1010, 1, SAVE)


def j1(probe: Probe) -> str:
    """What was mapped by the right sequence is stored, then comes another mapping and a reset."""
    probe.ready()
    plain = probe.stack.cob_id & 0x7FF
    probe.off()
    probe.cob(plain)
    assert probe.text(0x1010, 1, SAVE) == "ok"
    return remapped(probe, NmtCommand.RESET_COMMUNICATION)


def remapped(probe: Probe, command: NmtCommand) -> str:
    probe.off()
    writes = probe.count(0), probe.entry(1, probe.stack.m8), probe.count(1), probe.cob(probe.stack.cob_id & 0x7FF)
    assert writes == ("ok",) * 4
    before = probe.shown()
    probe.bench.nmt(command)
    return f"{before} -> {probe.shown()}"


def j5(probe: Probe) -> str:
    """After J1, as it was observed."""
    j1(probe)
    return remapped(probe, NmtCommand.RESET_NODE)


def j2(probe: Probe) -> str:
    probe.bench.nmt(NmtCommand.STOP)
    answers = [probe.read(0x1000), probe.write(0x1017, 0, 0, 2)]
    probe.bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    return "/".join([*answers, probe.read(0x1000)])


def after(prepare: Callable[[Probe], Probe], *asked: Callable[[Probe], str]) -> Callable[[Probe], str]:
    return lambda probe: "/".join(ask(prepare(probe)) for ask in asked)


OK6 = "/".join(["ok"] * 6)
OK7 = f"{OK6}/ok"
MAPPED_1 = "cob=40000185 n=2 e1=60000108 e2=64010110"
MAPPED_2 = "cob=188 n=2 e1=20050008 e2=20060010"
FACTORY_2 = "cob=80000188 n=1 e1=20020008 e2=0"
SYNC_2 = f"{OK7} ¦ {MAPPED_2} ¦ SYNC->3 bytes 101111"
TIMER = "ev=ok frames/0.55s=11 in PREOP=0 reset=ok"
H1_2 = f"{OK6}/208/4B->11223344/2B->11223344/6B->55667788 EMCY:8210,8220"
ALL_IDS = "000:ok/080:ok/581:ok/601:ok/701:ok"
#: row: case, then the three columns; None where nothing was observed
ROWS: dict[str, tuple[Any, ...]] = {
    "A1": (lambda p: f"{p.read(0x1000)}/{p.read(0x1018, 1)}", "F0191/0", "0/0", "0/0"),
    "A2": (Probe.shown, "cob=40000185 n=2 e1=60000108 e2=60000208", FACTORY_2, FACTORY_2),
    "A3": (fresh, *["6/0/!06090011/0/0"] * 3),
    "A4": (lambda p: f"{p.read(0x1A00, 9)}/{p.read(0x1010, 1)}/{p.read(0x1011, 1)}",
           "!06090011/3/1", "!06090011/1/1", "!06090011/1/1"),
    "B1": (b1, f"{OK7} ¦ {MAPPED_1} ¦ SYNC->3 bytes 000000", SYNC_2, SYNC_2),
    "B2": (b2, OK6, OK6, OK6),
    "B3": (after(Probe.ready, lambda p: f"{p.entry(1, p.stack.m8)}/{p.shown()}"),
           f"06010000/{MAPPED_1}", f"ok/{MAPPED_2}", f"ok/{MAPPED_2}"),
    "B3b": (after(Probe.ready, lambda p: f"{p.entry(1, p.stack.m16)}/{p.read(0x1A00, 1)}"),
            "06010000/60000108", "06090030/20050008", "ok/20060010"),
    "B4": (after(Probe.ready, lambda p: f"{p.count(0)}/{p.shown()}"),
           f"06010000/{MAPPED_1}", f"06090030/{MAPPED_2}", "ok/cob=188 n=0 e1=20050008 e2=20060010"),
    "B5": (b5, "06010000/cob=C0000185 n=2 e1=60000108 e2=64010110",
           "06090030/cob=80000188 n=2 e1=20050008 e2=20060010", "ok/cob=80000188 n=2 e1=20060010 e2=20060010"),
    "B6": (after(Probe.ready, lambda p: p.count(2)), "06010000", "ok", "ok"),
    "C1": (one(lambda _: 0x5FFF0008, counted=False, read=True),
           "06020000/60000108", "06020000/20050008", "ok/5FFF0008"),
    "C2": (one(lambda s: s.m8 & 0xFFFF0000 | 0xEE08, counted=False, read=True),
           "06090011/60000108", "06090011/20050008", "ok/2005EE08"),
    "C3": (one(lambda s: s.no_pdo, read=True), "06040041/60000108/ok", "06040041/20050008/ok", "ok/20330008/ok"),
    "C4": (one(lambda _: 0x10080020, read=True), "06040041/60000108/ok", "06040041/20050008/ok", "ok/10080020/ok"),
    "C5": (one(lambda s: s.m8 & ~0xFF | 0x20), "06040041/ok", "ok/ok", "ok/ok"),
    "C6": (one(lambda s: s.m32 & ~0xFF | 0x08), "ok/ok", "ok/ok", "ok/ok"),
    "C7": (one(lambda s: s.m8 & ~0xFF | 0x04), "06040041/ok", "ok/ok", "ok/ok"),
    "C8": (one(lambda s: s.m8 & ~0xFF), "ok/06090030", "ok/ok", "ok/ok"),
    "C9": (many(lambda s: (s.m32,) * 3), "ok/ok/ok/06040042/0", "ok/ok/ok/06040042/0", "ok/ok/ok/ok/3"),
    "C10": (many(lambda s: (s.m64, s.m8)), "ok/ok/06040042/0", "ok/ok/06040042/0", "ok/ok/ok/2"),
    "C11": (many(lambda s: (s.m8,) * 8, read=False), *["/".join(["ok"] * 9)] * 3),
    "C12": (c12, "06040042/0", "ok/9", "ok/9"),
    "C13": (after(Probe.empty, lambda p: p.entry(9, p.stack.m8)), *["06090011"] * 3),
    "C14": (many(lambda s: (s.m8, 0)), *["ok/ok/ok/2"] * 3),
    "C15": (many(lambda s: (s.m8, s.m8), read=False), *["ok/ok/ok"] * 3),
    "C16": (one(lambda _: 0x00050008), "ok/ok", "06020000/ok", "ok/ok"),
    "C17": (one(lambda _: 0, counted=False, read=True), *["ok/0"] * 3),
    "D1": (d1, *["ok/06070012"] * 3),
    "D2": (after(Probe.empty, lambda p: p.write(0x1A00, 1, 0x6000, 2)), *["06070013"] * 3),
    "D3": (d3, "ok/60000108", "ok/20050008", "ok/20050008"),
    "D4": (d4, *["ok/ok/1"] * 3),
    "E1": (e1, "06090030/C0000185", "ok/188", "ok/188"),
    "E2": (cob_case(lambda s: s.cob_id + 0x20), "06090030/40000185", "06090030/188", "ok/1A8"),
    "E3": (after(Probe.ready, lambda p: p.cob(p.stack.cob_id)), *["ok"] * 3),
    "E4": (cob_case(lambda s: 1 << 31 | s.rtr | 0x3A0), "ok/C00003A0", "ok/800003A0", "ok/800003A0"),
    "E5": (cob_case(lambda _: 1 << 31), *["ok/80000000"] * 3),
    "E6": (e6, *["ok cob=3A0 frames@3A0=8"] * 3),
    "E7": (e7, "000:06090030/080:ok/581:06090030/601:06090030/701:06090030", ALL_IDS, ALL_IDS),
    "E8": (e8, "06090030/80000185", "ok/20012345", "ok/20012345"),
    "E9": (e9, "ok/C0000185/ok/80000185", "ok/C0000188/ok/80000188", "ok/C0000188/ok/80000188"),
    "E10": (e10, *["ok/ok"] * 3),
    "F1": (f1, "0:ok/1:ok/240:ok/241:06090030/252:06090030/253:06090030/254:ok/255:ok",
           "0:ok/1:ok/240:ok/241:06090030/252:ok/253:ok/254:ok/255:ok",
           "0:ok/1:ok/240:ok/241:ok/252:ok/253:ok/254:ok/255:ok"),
    "F2": (f2, *["ok/ok"] * 3),
    "F3": (timed(3, 2, 2), "ok/06090030/06090030", "ok/06090030/06090030", "ok/ok/ok"),
    "F4": (timed(5, 2, 2), *["ok/ok/ok"] * 3),
    "F5": (timed(6, 1, 1), "ok/06090030", "ok/06090030", "ok/ok"),
    "F6": (after(Probe.ready, lambda p: p.write(0x1800, 4, 0, 1)), *["06090011"] * 3),
    "G1": (g1, TIMER, TIMER, TIMER),
    "G2": (g2, *["0 answers"] * 3),
    "H1": (h1, f"{OK6}/205/4B->11223344/2B->11223344/6B->55667788 EMCY:8210", H1_2, H1_2),
    "H2": (rpdo(lambda s: s.read_only), "06040041/ok", "06010002/ok", "ok/ok"),
    "H3": (rpdo(lambda _: 0x00050008, lambda s: 0x64110110 if s is FIRST else s.m16), *["ok/ok/ok"] * 3),
    "H4": (h4, "ok/06090030/ok/06090011/ok", "ok/06090030/ok/ok/ok", "ok/ok/ok/ok/ok"),
    "H5": (one(lambda s: s.write_only), None, "06010001/ok", "ok/ok"),
    "I1": (signatures(0x1010, b"evas", LOAD, bytes(4)), *["08000020/08000020/08000020"] * 3),
    "I2": (i2, "ok/3", "ok/1", "ok/1"),
    "I2b": (i2b, "ok", "ok", "ok"),
    "I3": (signatures(0x1011, b"daol", SAVE), *["08000020/08000020"] * 3),
    "I4": (after(Probe.ready, lambda p: p.text(0x1011, 1, LOAD)), *["ok"] * 3),
    "J1": (j1,
           "cob=185 n=1 e1=60000108 e2=64010110 -> cob=185 n=1 e1=60000108 e2=64010110",
           *[f"cob=188 n=1 e1=20050008 e2=20060010 -> {FACTORY_2}"] * 2),
    "J2": (j2, "!timeout/timeout/F0191", "!timeout/timeout/0", "!timeout/timeout/0"),
    "J3": (lambda p: f"{p.write(0x1A04, 1, 0, 4)}/{p.write(0x1A04, 0, 0, 1)}", *["06020000/06020000"] * 3),
    "J4": (lambda p: f"{p.write(0x1018, 1, 0, 4)}/{p.write(0x1000, 0, 0, 4)}", *["06010002/06010002"] * 3),
    "J5": (j5,
           "cob=185 n=1 e1=60000108 e2=64010110 -> cob=185 n=2 e1=60000108 e2=64010110",
           *[f"cob=188 n=1 e1=20050008 e2=0 -> {FACTORY_2}"] * 2),
}  # fmt: skip
#: every cell as a parameter: column, case, answer
CELLS = [
    pytest.param(stack, case, wanted, id=f"{row}-{name}")
    for row, (case, *columns) in ROWS.items()
    for name, stack, wanted in zip(
        ("first", "second-operational", "second"), (FIRST, SECOND, IDLE), columns, strict=True
    )
    if wanted is not None
]
