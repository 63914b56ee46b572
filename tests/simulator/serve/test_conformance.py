"""The tables of the strict device and of the calibrated families, over a link: real processes, raw SDO frames.

The data are those of the tests in one process, `tests/simulator/rows` and `stack_rows`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import can
import pytest

from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import Frame
from tests.simulator.bench import Aborted
from tests.simulator.rows import (
    ROWS,
    SAVE,
    SEGMENTS,
    SPECIFIERS,
    TOGGLES,
    UNANSWERED,
    UPLOADS,
    Row,
    check_download,
    check_segment,
    check_silence,
    check_specifier,
    check_toggle,
    check_upload,
)
from tests.simulator.serve.link import Link, linked
from tests.simulator.serve.served import Served
from tests.simulator.stack_rows import CELLS, Probe, Stack

Fresh = Callable[..., Link]


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fresh]:
    """`fresh(family, node_id)` is a node as it left the factory; one process serves all tests with it."""
    running: dict[tuple[str, ...], tuple[Served, can.BusABC]] = {}
    with ExitStack() as stack:

        def link(family: str, node_id: int = 1, *more: str) -> Link:
            words = (f"{family}@{node_id}", *more)
            if words not in running:
                running[words] = stack.enter_context(linked(tmp_path_factory.mktemp("sim"), *words))
            return Link(*running[words], node_id)

        yield link


@pytest.mark.drawn(12)
@pytest.mark.parametrize("row", ROWS, ids=str)
@pytest.mark.parametrize("segmented", [False, True], ids=["expedited", "segmented"])
def test_download(fresh: Fresh, row: Row, segmented: bool) -> None:
    check_download(fresh(row.family), row, segmented=segmented)


@pytest.mark.parametrize(("row", "index", "sub_index", "answer"), UPLOADS)
def test_upload_refused(fresh: Fresh, row: str, index: int, sub_index: int, answer: int) -> None:
    check_upload(fresh("generic").client, index, sub_index, answer)


@pytest.mark.parametrize("specifier", SPECIFIERS)
def test_a6_unknown_specifier(fresh: Fresh, specifier: int) -> None:
    check_specifier(fresh("generic").client, specifier)


@pytest.mark.parametrize("segment", SEGMENTS, ids=["download", "upload"])
def test_a6_segment_of_no_transfer(fresh: Fresh, segment: int) -> None:
    check_segment(fresh("generic").client, segment)


@pytest.mark.parametrize(("start", "segment"), TOGGLES, ids=["upload", "download"])
def test_a6_wrong_toggle_bit(fresh: Fresh, start: str, segment: str) -> None:
    check_toggle(fresh("generic").client, start, segment)


@pytest.mark.parametrize("request_", UNANSWERED)
def test_a7_silence(fresh: Fresh, request_: str) -> None:
    link = fresh("generic")
    link.nmt(NmtCommand.STOP)
    check_silence(link.client, request_)
    link.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    assert link.client.number(0x1000) == 0x20192


def test_e3_store_hardware_failure(fresh: Fresh) -> None:
    link = fresh("generic", 3, "--fault", "store-fails")
    with pytest.raises(Aborted) as caught:
        link.client.write(0x1010, 1, SAVE, 4)
    assert caught.value.code == 0x06060000


@pytest.mark.parametrize(
    ("command", "stored", "after"),
    [
        # 0x1017 is communication, 0x6060 is not; (0x1017, 0x6060) as read after the reset
        (NmtCommand.RESET_COMMUNICATION, False, (0, 1)),
        (NmtCommand.RESET_COMMUNICATION, True, (250, 1)),
        (NmtCommand.RESET_NODE, False, (0, 0)),
        (NmtCommand.RESET_NODE, True, (250, 1)),
    ],
)
def test_f2_resets(fresh: Fresh, command: NmtCommand, stored: bool, after: tuple[int, int]) -> None:
    link = fresh("generic")
    factory = link.client.number(0x1017), link.client.number(0x6060)
    link.client.write(0x1017, 0, 250, 2)
    link.client.write(0x6060, 0, 1, 1)
    if stored:
        link.client.write(0x1010, 1, SAVE, 4)
    link.nmt(NmtCommand.START)
    boot_up, *_ = link.exchange(Frame(0, bytes([command, 1])))[-2:]
    expected = tuple(value or default for value, default in zip(after, factory, strict=True))
    assert (boot_up.can_id, boot_up.data) == (0x701, b"\0")
    assert (link.client.number(0x1017), link.client.number(0x6060)) == expected
    assert link.sync() == [], "PRE-OPERATIONAL"


def test_f3_rpdos_of_another_length(fresh: Fresh) -> None:
    """RPDO1 of the generic node is a controlword, 2 bytes, on 0x201; its drive answers with TPDOs, too."""
    link = fresh("generic")

    def emergencies(data: str) -> list[bytes]:
        return [frame.data[:2] for frame in link.receive(Frame(0x201, bytes.fromhex(data))) if frame.can_id == 0x081]

    link.nmt(NmtCommand.START)
    assert emergencies("0600") == []
    assert link.client.number(0x6040) == 6
    assert emergencies("07") == [bytes.fromhex("1082")]
    assert link.client.number(0x6040) == 6
    assert emergencies("0F00AA") == [bytes.fromhex("2082")]
    assert link.client.number(0x6040) == 0x0F


@pytest.mark.drawn(10)
@pytest.mark.parametrize(("stack", "case", "wanted"), CELLS)
def test_cell(fresh: Fresh, stack: Stack, case: Callable[[Probe], str], wanted: str) -> None:
    assert case(Probe(stack, fresh(stack.family, stack.node_id))) == wanted
