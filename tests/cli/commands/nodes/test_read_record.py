"""`read 1018`: a record or an array with all its sub-indices; what is not a record stays as it is."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import dvtcli
from dvtcli import errors
from dvtcli.domain.abort import Abort
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.bus.devices import device, dictionary, unknown
from tests.cli.commands.bench import Bench
from tests.virtual_time import VirtualTimeBus


@pytest.fixture
def gen4() -> Iterator[Bench]:
    with Bench(("gen4@1",)) as made:
        yield made


@pytest.fixture
def nameless() -> Iterator[Bench]:
    """A node without an EDS."""
    with Bench((), {"node": 1, "profile": "generic"}, VirtualTimeBus([unknown(1)])) as made:
        yield made


def test_all_sub_indices_with_names_and_types(gen4: Bench) -> None:
    lines = gen4.run("read 1018").stdout.splitlines()
    assert [line.split()[0] for line in lines] == [f"0x1018:{sub:02X}" for sub in range(5)]
    assert lines[1] == "0x1018:01  Identity object.Vendor-ID = 30 (0x0000001E)  u32"


def test_the_document_only_grows(gen4: Bench) -> None:
    whole, alone = gen4.run("read 1018 --json").document, gen4.run("read 1018:0 --json").document
    entries = whole.pop("entries")
    assert whole == alone
    assert [(one["object"], one["type"]) for one in entries] == [(f"1018:{sub:02X}", "u32") for sub in range(1, 5)]
    assert entries[0]["value"] == 30


def test_missing_entries_are_left_out(gen4: Bench) -> None:
    """0x1800:04 is reserved, and not there."""
    objects = [one["object"] for one in gen4.run("read 1800 --json").document["entries"]]
    assert objects == ["1800:01", "1800:02", "1800:03", "1800:05"]


@pytest.mark.parametrize("words", ["6041", "1000", "1018:0", "0x1018:00", "1018:1", "statusword"])
def test_one_value_stays_one(gen4: Bench, words: str) -> None:
    document = gen4.run(f"read {words} --json").document
    assert "entries" not in document
    value, *bits = gen4.run(f"read {words}").stdout.splitlines()
    assert len(bits) == ("Statusword = switch on disabled (0x0250)" in value)


def test_among_several_objects(gen4: Bench) -> None:
    values = gen4.run("read 6041 1018 1000 --json").document["values"]
    assert [(one["object"], len(one.get("entries", ()))) for one in values] == [
        ("6041:00", 0), ("1018:00", 4), ("1000:00", 0),
    ]  # fmt: skip
    assert len(gen4.run("read 6041 1018 1000").stdout.splitlines()) == 7


def test_again_and_again_it_is_sub_index_0(gen4: Bench) -> None:
    first = gen4.run("read 1018 --every 1ms --for 1ms --json").documents[0]
    assert [(one["object"], one["value"]) for one in first["values"]] == [("1018:00", 4)]


def test_as_a_type(gen4: Bench) -> None:
    """It is that of each entry; all that it does not fit are named together."""
    entries = gen4.run("read 1018 --as i32 --json").document["entries"]
    assert {one["type"] for one in entries} == {"i32"}
    refused = gen4.run("read 1018 --as u8")
    assert refused.code == gen4.run("read 1018:1 --as u8").code == 5
    assert all(f"1018:{sub:02X} (4 bytes)" in refused.stderr for sub in range(1, 5))


def test_a_file_takes_one_value(gen4: Bench) -> None:
    refused = gen4.run("read 1018 -o identity.bin")
    refused.failed(2, "a file is for one")
    assert "read 1018:1 -o FILE" in refused.stderr


def test_without_an_eds_the_standards_records_are_known(nameless: Bench) -> None:
    """Also their names; an object of the maker's is a value, since nobody knows more."""
    document = nameless.run("read 1018 --json").document
    assert [one["name"] for one in document["entries"]] == [
        "vendor-ID", "product code", "revision number", "serial number",
    ]  # fmt: skip
    assert "entries" not in nameless.run("read 1017 --json").document
    names = [one["name"] for one in nameless.run("read 1400 --json").document["entries"]]
    assert names[:2] == ["COB-ID", "transmission type"]


def test_an_error_history() -> None:
    """An array of as many entries as sub-index 0 says, which may be none."""
    with Bench((), {"sim": ("generic",), "fault": ("emcy=0x3210",)}) as bench:
        document = bench.run("read 1003 --json").document
        assert document["value"] == len(document["entries"]) == 1
        assert document["entries"][0]["value"] & 0xFFFF == 0x3210
        assert bench.run("faults --clear").code == 0
        assert bench.run("read 1003 --json").document["entries"] == []


def test_a_program_is_not_read_by_the_way() -> None:
    with Bench(("loader@1",)) as bench:
        ran = bench.run("read 1F50")
        said = "not read: a DOMAIN is read alone, into a file; `dvtcli --sim loader@1 read 1F50:01 -o FILE` does"
        assert (ran.code, said in ran.stdout) == (0, True), ran
        entry = bench.run("read 1F50 --json").document["entries"][0]
        assert (entry["value"], entry["abort"]) == (None, None)


def test_an_entry_that_is_refused_is_named() -> None:
    family = load_family("generic")._replace(absent={(0x1018, 2): Abort.DEVICE_STATE})
    bus = VirtualTimeBus([StrictDevice(dictionary("generic"), family, 1)])
    with Bench((), {"node": 1, "profile": "generic"}, bus) as bench:
        ran = bench.run("read 1018")
        assert ran.code == 1
        assert "0x1018:02  product code  not read: 0x08000022" in ran.stdout
        assert "0x1018:03" in ran.stdout
        entry = bench.run("read 1018 --json").document["entries"][1]
        assert (entry["value"], entry["abort"]) == (None, "0x08000022")


def test_of_several_nodes() -> None:
    with Bench((), {"node": (1, 3), "profile": "generic"}, VirtualTimeBus([device(1), device(3)])) as bench:
        documents = bench.run("read 1018 --json").documents
        assert [(one["node"], len(one["entries"])) for one in documents] == [(1, 4), (3, 4)]


def test_a_program_reads_it_too(gen4: Bench) -> None:
    with dvtcli.simulate("gen4") as bus:
        record = bus.node().record("1018")
        assert record.document() == gen4.run("read 1018 --json").document
        assert bus.node().record(0x1018).value == bus.node().read("1018").value == 4
        with pytest.raises(errors.UsageError, match="not a record"):
            bus.node().record("6041")
