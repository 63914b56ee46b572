"""The table of `rows`, in one process: what the strict device answers."""

from __future__ import annotations

import pytest

from dvtcli.domain.nmt import NmtState
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.simulator.bench import Aborted, Client, InProcess, booted
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


@pytest.mark.drawn(25)
@pytest.mark.parametrize("row", ROWS, ids=str)
@pytest.mark.parametrize("segmented", [False, True], ids=["expedited", "segmented"])
def test_download(row: Row, segmented: bool) -> None:
    check_download(InProcess(booted(row.family)), row, segmented=segmented)


@pytest.mark.parametrize(("row", "index", "sub_index", "answer"), UPLOADS)
def test_upload_refused(row: str, index: int, sub_index: int, answer: int) -> None:
    check_upload(Client.on(booted()), index, sub_index, answer)


@pytest.mark.parametrize("specifier", SPECIFIERS)
def test_a6_unknown_specifier(specifier: int) -> None:
    check_specifier(Client.on(booted()), specifier)


@pytest.mark.parametrize("segment", SEGMENTS, ids=["download", "upload"])
def test_a6_segment_of_no_transfer(segment: int) -> None:
    check_segment(Client.on(booted()), segment)


@pytest.mark.parametrize(("start", "segment"), TOGGLES, ids=["upload", "download"])
def test_a6_wrong_toggle_bit(start: str, segment: str) -> None:
    check_toggle(Client.on(booted()), start, segment)


@pytest.mark.parametrize("request_", UNANSWERED)
@pytest.mark.parametrize("state", [NmtState.STOPPED, NmtState.INITIALISING])
def test_a7_silence(request_: str, state: NmtState) -> None:
    device = booted()
    device.state = state
    check_silence(Client.on(device), request_)


def test_e3_store_hardware_failure() -> None:
    device = booted()
    device.areas.fails = True
    with pytest.raises(Aborted) as caught:
        Client.on(device).write(0x1010, 1, SAVE, 4)
    assert caught.value.code == 0x06060000


def test_e2_store_only_pre_operational_without_an_extended_error() -> None:
    device = booted()
    family = device.family._replace(pre_operational_writes=((0x1010, 0x1010),))
    device = StrictDevice(device.dictionary, family, 1)
    device.state = NmtState.OPERATIONAL
    with pytest.raises(Aborted) as caught:
        Client.on(device).write(0x1010, 1, SAVE, 4)
    assert caught.value.code == 0x08000022


def test_every_row_about_a_download_has_a_case() -> None:
    named = "A1 A2 A3 A4 A5 B1 B2 B3 B4 B5 B6 B7 B8 B9 B10 B11 C1 C2 C3 C4 C5 C6 C7 C8 D1 D2 D3 E1 E2 E4 F1"
    assert {row.row for row in ROWS} == set(named.split())
