"""Scanner and dispatcher lists of multiplexed PDOs are shown with the PDO, and named in frames."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.pdo import ListedObjects, listed_objects
from tests.cli.commands.bench import Bench, beside
from tests.cli.commands.bus import device

U8, U16 = st.integers(0, 0xFF), st.integers(0, 0xFFFF)


def test_a_multiplexed_tpdo_shows_its_scanner_list() -> None:
    with Bench(("mpdo",)) as bench:
        shown = bench.run("pdo tpdo1").stdout
        document = bench.run("pdo tpdo1 --json").document["pdos"][0]["listed"]
    assert "1FA0:01  2000:01 Speed.Wheel\n" in shown
    assert "1FA0:02  2001:01…2001:03 Temperature.Sensor 1\n" in shown
    assert [(row["entry"], row["object"], row["count"], row["source"]) for row in document] == [
        ("1FA0:01", "2000:01", 1, None), ("1FA0:02", "2001:01", 3, None)
    ]  # fmt: skip


def test_a_multiplexed_rpdo_shows_its_dispatcher_list() -> None:
    with Bench(("mpdo",)) as bench:
        shown = bench.run("pdo rpdo1").stdout
        document = bench.run("pdo rpdo1 --json").document["pdos"][0]["listed"]
    assert "1FD0:02  node 9 2001:01…2001:02 -> 2100:02…2100:03 Received.Value 2\n" in shown
    assert document[0] == {"entry": "1FD0:01", "object": "2100:01", "count": 1, "name": "Received.Value 1",
                           "source_node": 9, "source": "2000:01"}  # fmt: skip


def test_without_an_eds_the_device_is_asked() -> None:
    with Bench((), {"node": 1}, beside([device("mpdo")])) as bench:
        shown = bench.run("pdo tpdo1").stdout
    assert "1FA0:02  2001:01…2001:03\n" in shown


@pytest.mark.parametrize("pdo", ["tpdo2", "rpdo2", "tpdo3"])
def test_other_pdos_have_no_list(pdo: str) -> None:
    with Bench(("mpdo",)) as bench:
        ran = bench.run(f"pdo {pdo} --json")
        assert "1FA0:" not in bench.run(f"pdo {pdo}").stdout
    assert ran.document["pdos"][0]["listed"] is None


def test_an_empty_list_is_said_to_be_so() -> None:
    with Bench(("mpdo",), {"yes": True}) as bench:
        for entry in (1, 2):
            assert bench.run(f"write 1FA0:{entry:02X} 0").code == 0
        assert "that list is empty, or cannot be read" in bench.run("pdo tpdo1").stdout


def test_explain_names_the_objects_of_an_entry() -> None:
    with Bench(("mpdo",)) as bench:
        scanned = bench.run("explain 601#23A01F0202012003").stdout
        unknown = bench.run("explain 67E#23A01F0100002001").stdout
    assert "= 2001:02…2001:04 Temperature.Sensor 2" in scanned
    assert "1FA0:01 scanned objects 1 = 2000:00" in unknown


@given(U8, U16, U8)
def test_a_scanner_entry_is_read_as_the_standard_lays_it_out(count: int, index: int, sub_index: int) -> None:
    raw = count << 24 | index << 8 | sub_index
    assert listed_objects(0x1FA5, raw) == (ListedObjects(index, sub_index, count) if raw else None)


@given(U8, U16, U8, U16, U8, U8)
def test_a_dispatcher_entry_too(count: int, index: int, sub: int, source: int, source_sub: int, node: int) -> None:
    raw = count << 56 | index << 40 | sub << 32 | source << 16 | source_sub << 8 | node
    wanted = ListedObjects(index, sub, count, node, (source, source_sub)) if raw else None
    assert listed_objects(0x1FD0, raw) == wanted
