"""The indices of CiA 301's objects, and the CAN-IDs of its pre-defined connection set, have one place each."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from itertools import chain

import pytest

from dvtcli.domain import can_ids, objects
from tests.house.laws.source_tree import SourceTree

pytestmark = pytest.mark.together

HOUSE = SourceTree.of_the_package()
HOMES = {"domain/objects.py", "domain/can_ids.py"}
NUMBERS = {value for home in (objects, can_ids) for value in vars(home).values() if isinstance(value, int)}
RANGES = [value for value in vars(objects).values() if isinstance(value, range)]
#: as they are written: 4096 is no index, and 0x80 no CAN-ID
LITERALS = {f"0x{number:03X}" for number in NUMBERS} | {f"range(0x{one.start:X}, 0x{one.stop:X})" for one in RANGES}
#: other meanings of such a number
MAY_DEFINE = {
    "simulator/device/plant.py:_STANDS": "a bit of the statusword",
    "bus/error_frames.py:_RESTARTED": "a bit of an error frame",
    "simulator/device/plant.py:_HALT": "a bit of the controlword",
    "cli/dvt/words.py:_FIRST_OBJECT": "the lowest index",
    "files/network/key_values.py:_HEX_FROM": "the lowest index",
    "watch/recording_checks/recording_rules.py:_TPDO": "a bit of the function code",
}


def defined(file: str, text: str, module: ast.Module) -> Iterator[str]:
    """Constants of a module, or of its classes, that are an index or a CAN-ID of the standard, also one of several."""
    lines = text.splitlines()
    bodies = [module.body]
    for body in bodies:  # which grows
        bodies += [node.body for node in body if isinstance(node, ast.ClassDef)]
    for one in chain.from_iterable(bodies):
        targets = one.targets if isinstance(one, ast.Assign) else [getattr(one, "target", None)]
        if isinstance(one, ast.Assign | ast.AnnAssign) and one.value is not None and targets[0] is not None:
            yield from (f"{file}:{name}" for name in _literals(lines, targets[0], one.value))


def _literals(lines: list[str], target: ast.expr, value: ast.expr) -> Iterator[str]:
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        for each, its in zip(target.elts, value.elts, strict=False):
            yield from _literals(lines, each, its)
        return
    if value.lineno == value.end_lineno:  # a number, an address or a range stands on one line
        written = lines[value.lineno - 1].encode()[value.col_offset : value.end_col_offset].decode()
        address = re.fullmatch(r"\((0x\w+), \d+\)", written)  # an index and a sub-index
        if (address[1] if address else written) in LITERALS:
            yield ast.unparse(target)


def test_no_other_module_defines_them() -> None:
    found = {place for file, tree in HOUSE if file not in HOMES for place in defined(file, HOUSE.texts[file], tree)}
    assert found == MAY_DEFINE.keys()


@pytest.mark.parametrize("text", [
    "_HEARTBEAT = 0x1017",
    "SYNC, TIME = 0x1005, 0x1012",
    "_REQUESTS, _LONGEST = 0x600, 8",
    "_REVISION = (0x1018, 3)",
    "SDO_SERVERS = range(0x1200, 0x1280)",
    "HEARTBEAT: int = 0x700",
    "class Bus:\n    sync = 0x080",
])  # fmt: skip
def test_it_bites(text: str) -> None:
    assert list(defined("device/new.py", text, ast.parse(text)))


@pytest.mark.parametrize("text", ["_BACKLOG = 4096", "_ABORT = 0x80", "_IDENTITY = IDENTITY", "TEXTS = {0x1000: 'x'}"])
def test_other_constants_pass(text: str) -> None:
    assert not list(defined("device/new.py", text, ast.parse(text)))
