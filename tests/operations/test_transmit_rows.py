"""Rows of the transmit list as text, as frames, and in the user's settings."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.pdo import PdoMappingEntry
from dvtcli.domain.ports import Frame
from dvtcli.errors import UsageError
from dvtcli.files.settings_file import with_table
from dvtcli.operations.frames.transmit_rows import TransmitRow, frame_of, keep_rows, kept_rows, rounds, transmit_row
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from tests.surroundings import HOMES


@given(
    st.sampled_from(["185#1027", "18FF0102#00", "7A0#R", "0x185 10 27", "rpdo1 6040=15", "5:tpdo2 speed=3rpm x=1"]),
    st.none() | st.integers(1, 3_600_000),
    st.sampled_from(["", *"123456789"]),
)
def test_what_is_written_is_read_back(frame: str, every_ms: int | None, key: str) -> None:
    row = TransmitRow(frame, None if every_ms is None else every_ms / 1000, key)
    assert str(transmit_row(str(row))) == str(row)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no frame"), ("every 5s", "not a frame"), ("185", "no data"), ("xyz", "not a frame"),
        ("185#10 every 0ms", "a period is"), ("185#10 every soon", "a period is"),
        ("185#10 every 4000s", "a period is"),
        ("185#10 key 0", "a key is"), ("185#10 key 11", "a key is"), ("rpdo1", "OBJECT=VALUE"),
        ("rpdo1 6040 15", "OBJECT=VALUE"),
    ],
)  # fmt: skip
def test_what_is_no_row_is_refused(text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        transmit_row(text)


def test_rows_with_sdo_requests_are_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path))
    session = Session(Options(sim=("gen4",)))
    rows = ["185#1027", "601#2B005001D2040000 key 1", "rpdo1 6040=15"]
    keep_rows(session, "can0", [transmit_row(row) for row in rows])
    assert [str(row) for row in kept_rows(session, "can0")] == [rows[0], rows[2]]
    assert not [path for path in tmp_path.rglob("*") if path.is_file() and b"D204" in path.read_bytes()]


def test_frames_that_are_late_by_a_period_are_left_out() -> None:
    clock = [10.0]
    counted: list[tuple[int, int]] = []
    due = rounds(
        transmit_row("185#10 every 100ms"), Frame(0x185, b"\x10"), lambda: clock[0],
        lambda sent, left: counted.append((sent, left)),
    )  # fmt: skip
    times = []
    for now_s in (10.0, 10.01, 10.15, 10.75, 10.76, 10.85):
        clock[0] = now_s
        times.append(round(next(due)[0], 6))
    assert times == [0.0, 0.1, 0.2, 0.7, 0.8, 0.9]
    assert counted == [(0, 0), (1, 0), (2, 0), (3, 4), (4, 4), (5, 4)]


@pytest.fixture
def session() -> Session:
    return Session(Options(sim=("gen4",)))


def mapped(session: Session, *entries: PdoMappingEntry) -> None:
    from dvtcli.domain.object_syntax import MappedObject
    from dvtcli.domain.pdo import Pdo
    from dvtcli.domain.request import PdoRequest
    from dvtcli.operations.changes.change import configure

    objects = tuple(MappedObject(entry.index, entry.sub_index, entry.bits) for entry in entries)
    configure(session, session.node(), {Pdo.parse("rpdo1"): PdoRequest(objects=objects, enabled=True)})


CONTROLWORD, VELOCITY = PdoMappingEntry(0x6040, 0, 16), PdoMappingEntry(0x60FF, 0, 32)


@pytest.mark.parametrize(
    ("values", "last", "data"),
    [
        ("6040=15", None, "0F 00 00 00 00 00"),
        ("6040=15", "01 02 03 04 05 06", "0F 00 03 04 05 06"),
        ("60FF=-2", "01 02 03 04 05 06", "01 02 FE FF FF FF"),
        ("0x60FF:0=0x10 controlword=0xFFFF", None, "FF FF 10 00 00 00"),
        ("target_velocity=5rpm", None, "00 00 05 00 00 00"),
    ],
)
def test_a_pdo_by_name(session: Session, values: str, last: str | None, data: str) -> None:
    with session:
        mapped(session, CONTROLWORD, VELOCITY)
        held = None if last is None else bytes.fromhex(last)
        frame = frame_of(session, transmit_row(f"rpdo1 {values}"), lambda _address: held)
    assert (frame.can_id, frame.data) == (0x201, bytes.fromhex(data))


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("rpdo1 6041=1", "RPDO1 has no 6041"), ("rpdo1 speed=1", "has no speed"), ("rpdo1 6040=70000", "65535"),
        ("rpdo1 6040=x", "'x'"), ("rpdo1 604=1", "has no 604"), ("rpdo5 6040=1", "is off"),
        ("1:rpdo1 60FF=9999999999", "2147483647"),
    ],
)  # fmt: skip
def test_what_is_no_value_of_the_pdo_is_refused(session: Session, row: str, said: str) -> None:
    with session:
        mapped(session, CONTROLWORD, VELOCITY)
        with pytest.raises(UsageError, match=said):
            frame_of(session, transmit_row(row), lambda _address: None)


_TEXT = st.text(st.characters(exclude_categories=["Cs", "Cc"]), max_size=8)
_TABLES = st.dictionaries(_TEXT, st.lists(_TEXT, max_size=3), max_size=4)


@given(
    _TABLES, _TABLES, st.sampled_from(["", "node = 5  # ours\n", "[aliases]\nv = 'read 606C'\n\n[bus.x]\nsim='g'\n"])
)
def test_a_table_is_changed_and_nothing_else(
    first: dict[str, list[str]], second: dict[str, list[str]], text: str
) -> None:
    before = tomllib.loads(text)
    once = with_table(text, "transmit", first)
    twice = with_table(once, "transmit", second)
    for written, table in ((once, first), (twice, second)):
        assert tomllib.loads(written) == before | ({"transmit": table} if table else {})
    assert with_table(twice, "transmit", second) == twice


def test_comments_and_lines_that_stay_are_kept() -> None:
    text = '[aliases]  # ours\n# speed\nv = "read 606C"  # rpm\nw = "watch 6041"\n\n[bus.a]\nsim = "gen4"\n'
    changed = with_table(text, "aliases", {"v": "read 606C", "w": "watch 6040"})
    assert changed.startswith('[aliases]  # ours\n# speed\nv = "read 606C"  # rpm\n')
    assert changed.count("6041") == 0


@pytest.mark.parametrize("text", ['transmit = {sim = ["1#"]}\n', '[transmit]\nsim = [\n  "1#",\n]\n'])
def test_a_table_in_another_form_is_left_alone(text: str) -> None:
    with pytest.raises(ValueError, match="transmit"):
        with_table(text, "transmit", {"can0": ["2#"]})
