"""The main job on every real EDS and DCF of a folder given with `--eds-corpus DIR`: map, verify, store, prove."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.datatypes import Kind
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
from dvtcli.domain.pdo import Direction, Pdo
from dvtcli.domain.ports import Frame
from dvtcli.domain.rules.mapped_object import FEEDS_TPDO, TAKES_RPDO
from tests.cli.commands.bench import Bench
from tests.real_files import real_files

_INITIATE_DOWNLOAD = 1
#: Files whose PDOs are all enabled as they come up (bit 31 of every COB-ID is 0): another value than one of a PDO that
#: is off is changed to see what a reset takes.
_ALL_ENABLED = {"ifm_rm9000.eds", "maxon_epos4-50-15-node1.dcf", "systec_iox4-8ai.eds"}


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    paths = real_files(metafunc.config)
    metafunc.parametrize("path", paths, ids=[path.name for path in paths])


def candidates(dictionary: ObjectDictionary, direction: Direction) -> list[OdEntry]:
    """Numbers that the file lets a PDO carry, or does not say anything of; the communication area's come last."""
    accesses = FEEDS_TPDO if direction is Direction.TPDO else TAKES_RPDO
    unknown = not dictionary.tells_mappability
    fitting = [
        entry
        for entry in dictionary.entries()
        if (entry.pdo_mapping or unknown)
        and entry.access in accesses
        and entry.data_type is not None
        and entry.data_type.kind in (Kind.INTEGER, Kind.UNSIGNED)
        and entry.bits in (8, 16, 32)
    ]
    return sorted(fitting, key=lambda entry: entry.index < 0x2000)


def is_static(dictionary: ObjectDictionary, pdo: Pdo) -> bool:
    """Whether the count or the first entry cannot be written."""
    entries = [dictionary.entry(pdo.mapping_index, sub_index) for sub_index in (0, 1)]
    return any(entry is not None and not entry.access.writable for entry in entries)


def watch_writes(bench: Bench) -> list[bytes]:
    """SDO downloads that reach the bus from now on."""
    bench.session.node()
    seen: list[bytes] = []

    def received(frame: Frame, sent: bool) -> None:
        if sent and 0x601 <= frame.can_id <= 0x67F and frame.data[0] >> 5 == _INITIATE_DOWNLOAD:
            seen.append(frame.data)

    assert bench.session._network is not None
    bench.session._network.bus.tap(received)
    return seen


def check_proof(bench: Bench, path: Path) -> None:
    """`store --prove`: proved with a canary in a PDO that is off, or by another one where all PDOs are on."""
    rows = bench.run("pdo --all --json").document["pdos"]
    off = {row["pdo"].upper() for row in rows if not row["enabled"]}
    assert bool(off) is (path.name not in _ALL_ENABLED)
    stored = bench.run("store --prove --json")
    document = stored.documents[-1]
    assert (document["stored"], document["differences"], document["lost"]) == (True, [], [])
    assert (document["by"], document["compared"]) == ("reset-node", len(rows))
    assert (stored.code, document["proved"], document["unproved"]) == (0, True, None), stored
    assert bool(off) is any(f" of {label})" in document["canary"] for label in off), document["canary"]


@pytest.mark.parametrize("direction", Direction)
def test_the_first_pdo_is_mapped_verified_stored_and_proved_or_refused_with_the_reason(
    path: Path, direction: Direction
) -> None:
    with Bench((str(path),), {"yes": True}, in_real_time=True) as bench:
        node = bench.session.node()
        dictionary, pdo = node.dictionary, Pdo(direction, 1)
        assert dictionary is not None
        writes = watch_writes(bench)
        if pdo.communication_index not in dictionary:
            assert bench.run(f"map {pdo} 2000").code == 1
            assert writes == []
            return
        factory = node.pdo(pdo)
        room = len(dictionary[pdo.mapping_index].entries) - 1
        chosen = candidates(dictionary, direction)[: min(2, room)]
        mapped = bench.run(f"map {pdo} {' '.join(entry.object for entry in chosen)}")
        if is_static(dictionary, pdo):
            assert mapped.code == 1
            assert "is static" in mapped.stderr
            assert writes == []
            return
        assert mapped.code == 0, mapped.stderr
        assert ("does not state whether" in mapped.stderr) is not dictionary.tells_mappability
        assert bench.run(f"verify {pdo}").code == 0
        (row,) = bench.run(f"pdo {pdo} --json").document["pdos"]
        assert [entry["object"] for entry in row["mapping"]] == [entry.object for entry in chosen]
        assert row["enabled"]
        if dictionary.entry(0x1010, 1) is None:
            stored = bench.run("store --prove")
            assert stored.code == 1
            assert "this device cannot store" in stored.stderr
            return
        check_proof(bench, path)
        assert bench.run(f"verify {pdo}").code == 0
        undone = bench.run("undo --all")
        if "an undo leaves it" in mapped.stderr:
            assert undone.code == 1
            assert "refuses that configuration" in undone.stderr
            assert not node.pdo(pdo).enabled
        else:
            assert undone.code == 0
            assert node.pdo(pdo) == factory


@pytest.mark.parametrize("direction", Direction)
def test_what_objects_offers_can_be_mapped(path: Path, direction: Direction) -> None:
    """Each on its own, in a dry run; what does not fit by its length or the family's advice is an exception."""
    with Bench((str(path),), {"yes": True, "dry_run": True}, in_real_time=True) as bench:
        dictionary = bench.session.node().dictionary
        pdo = Pdo(direction, 1)
        assert dictionary is not None
        if pdo.communication_index not in dictionary or is_static(dictionary, pdo):
            pytest.skip("no such PDO, or a static one")
        rows = bench.run(f"objects --mappable {direction} --json").document["objects"]
        assert rows
        for row in rows[:: max(1, len(rows) // 12)]:
            ran = bench.run(f"map {pdo} {row['object']} --json")
            rules = {finding["rule"] for finding in ran.document.get("findings", [])}
            assert ran.code == 0 or rules & {"pdo-length", "entry-length", "granularity", "read-write-object"}, ran
