"""The file and the device: another device's EDS changes nothing, and a family does not deny what the file has."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.device.file_fits import unlike_file
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.rules.mapped_object import RULES
from dvtcli.files.eds.reader import parse_eds
from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def bench(wire: Wire, eds: str | Path) -> Bench:
    return Bench((), {**wire.options, "yes": True, "eds": str(eds)})


def downloads(wire: Wire) -> list[bytes]:
    return [bytes(m.data) for m in wire.frames() if m.arbitration_id == 0x601 and m.data[0] >> 5 == 1]


@pytest.mark.parametrize(
    "line", ["map tpdo1 6041", "set tpdo1 --timer 20", "disable tpdo1", "clear tpdo1", "write 1017 500"]
)
def test_another_maker_s_file_changes_nothing(line: str) -> None:
    with Wire(device("tmcm")) as wire, bench(wire, family_eds("gen4")) as one:
        ran = one.run(line)
        assert ran.code == 6, ran.stdout
        said = "gen4.eds is about vendor 0x0000001E, node 1 is vendor 0x00000286"
        assert f"the EDS is another device's: {said}" in ran.stderr
        assert "--force" in ran.stderr
        assert downloads(wire) == []
        assert one.run(f"{line} --dry-run").code == 6
        assert one.run(f"{line} --force --json").documents[-1].get("state") != "unchanged"


def test_it_is_noted_once_for_reading() -> None:
    with Wire(device("tmcm")) as wire, bench(wire, family_eds("gen4")) as one:
        ran = one.run("read 1000")
        assert ran.code == 0
        assert ran.stderr.count("gen4.eds is about vendor 0x0000001E") == 1
        assert "changes need --force" in ran.stderr
        assert "gen4.eds" not in one.run("read 1000").stderr
        assert "gen4.eds is about" not in one.run("read 1000 --dry-run").stderr


@heavy
def test_doctor_warns_of_it() -> None:
    with Wire(device("tmcm")) as wire, bench(wire, family_eds("gen4")) as one:
        (document,) = one.run("doctor --json").documents
    (node,) = (check for check in document["checks"] if check["check"] == "node")
    assert node["verdict"] == "warn"
    assert "gen4.eds is about vendor 0x0000001E, node 1 is vendor 0x00000286" in node["text"]


def test_its_defaults_are_not_what_a_restore_is_measured_by() -> None:
    with Wire(device("tmcm")) as wire, bench(wire, family_eds("gen4")) as one:
        document = one.run("restore --prove --json").answer
        assert document["against"] == "what was stored before"
        assert document["differences"] == []
        ran = one.run("restore --prove")
    assert "the EDS is another device's, and nothing differs from what was stored before" in " ".join(
        ran.stdout.split()
    )


def test_undo_needs_no_file() -> None:
    with Wire(device("tmcm")) as wire:
        with bench(wire, family_eds("tmcm")) as one:
            assert one.run("set tpdo1 --sync 3").code == 0
        with bench(wire, family_eds("gen4")) as one:
            assert one.run("undo").code == 0


def test_the_right_file_and_one_of_the_library_are_not_doubted() -> None:
    with Wire(device("tmcm")) as wire, bench(wire, family_eds("tmcm")) as one:
        ran = one.run("set tpdo1 --sync 3")
        assert (ran.code, "is about" in ran.stderr) == (0, False)


def test_another_product_of_the_same_maker_is_another_device(tmp_path: Path) -> None:
    text = family_eds("gen4").read_text("latin-1")
    other = tmp_path / "other.eds"
    assert text.upper().count("0X0705302D") == 2, "ProductNumber, and the default of 0x1018:02"
    other.write_text(text.replace("0x0705302D", "0x07053030"), "latin-1")
    with Wire(device("gen4")) as wire, bench(wire, other) as one:
        ran = one.run("set tpdo1 --timer 20")
        assert ran.code == 6
        assert "other.eds is about product 0x07053030, node 1 is product 0x0705302D" in ran.stderr


@pytest.mark.parametrize(
    ("vendor", "product", "default", "identity", "unlike"),
    [
        ("0x1E", "0x5", "0x5", (0x1E, 5), ""),
        ("0x1E", "0x5", "0x5", (0x1F, 5), "vendor"),
        ("0x1E", "0x5", "0x5", (0x1E, 6), "product"),
        ("0x1E", "0x1", "0x5", (0x1E, 5), ""),
        ("", "", "0x5", (0x1F, 5), ""),
        ("0x0", "0x0", "0x0", (0x1F, 5), ""),
        ("0x1E", "0x5", "0x5", (0, 0), ""),
        ("0x1E", "0x5", "0x5", (None, None), ""),
    ],
)
def test_what_is_not_told_differs_from_nothing(
    vendor: str, product: str, default: str, identity: tuple[int | None, int | None], unlike: str
) -> None:
    text = (
        f"[DeviceInfo]\nVendorNumber={vendor}\nProductNumber={product}\n[1018]\nParameterName=Identity\nObjectType=0x9\n"
        "SubNumber=2\n[1018sub0]\nParameterName=n\nDataType=0x5\nAccessType=ro\nDefaultValue=2\n[1018sub2]\n"
        f"ParameterName=Product\nDataType=0x7\nAccessType=ro\nDefaultValue={default}\n"
        "[MandatoryObjects]\nSupportedObjects=1\n1=0x1018\n"
    )
    said = unlike_file(1, parse_eds(text.encode(), "some.eds").dictionary, identity)
    assert (f"about {unlike} " in said) if unlike else said == ""


def test_a_way_to_store_that_the_file_has_is_used_though_the_family_has_none(tmp_path: Path) -> None:
    """The profile was written for a firmware without 0x1010."""
    text = family_eds("roboteq").read_text("latin-1")
    store = (
        "\n[1010]\nParameterName=Store parameters\nObjectType=0x8\nSubNumber=2\n"
        "[1010sub0]\nParameterName=Highest sub-index\nObjectType=0x7\nDataType=0x5\nAccessType=ro\nDefaultValue=1\n"
        "[1010sub1]\nParameterName=Save all\nObjectType=0x7\nDataType=0x7\nAccessType=rw\nDefaultValue=1\n"
    )
    newer = tmp_path / "newer.eds"
    newer.write_text(text + store, "latin-1")
    with Bench((str(newer),), {"yes": True, "profile": "roboteq"}) as one:
        assert one.run("objects 1010").code == 0
        ran = one.run("set tpdo1 --timer 30")
        assert "`store` keeps it" in ran.stdout
        ran = one.run("store --json")
        assert ran.code == 0, ran.stdout
        assert (ran.document["object"], ran.document["stored"]) == ("1010:01", True)
    with Bench(("roboteq",), {"yes": True}) as one:
        assert one.run("store").code == 1, "that firmware has none"


@pytest.mark.drawn(4)
@pytest.mark.parametrize("family", ["generic", "gen4", "tmcm", "roboteq", "espac", "lely"])
@pytest.mark.parametrize("direction", ["tpdo", "rpdo"])
def test_what_is_listed_as_mappable_is_what_map_takes(family: str, direction: str) -> None:
    about_objects = {rule.name for rule in RULES}
    with Bench((family,), {"yes": True}) as one:
        node = one.session.node()
        assert node.dictionary is not None
        listed = {row["object"] for row in one.run(f"objects --mappable {direction} --json").document["objects"]}
        pdo = next(pdo for pdo in node.present() if pdo.direction == direction and not node.pdo(pdo).mpdo)
        taken = {
            entry.object
            for entry in node.dictionary.entries()
            if entry.bits and not refused(one, pdo, entry.object) & about_objects
        }
        sized = {entry.object for entry in node.dictionary.entries() if entry.bits}
        assert taken == listed & sized


def refused(one: Bench, pdo: Pdo, place: str) -> set[str]:
    """The rules by which `map` refuses the object at *place*."""
    from dataclasses import replace

    from dvtcli.device.proposal import proposal
    from dvtcli.domain.pdo import PdoMappingEntry
    from dvtcli.domain.rules import check_pdo, errors_in

    node = one.session.node()
    index, sub_index = int(place[:4], 16), int(place[5:], 16)
    now = node.known_pdos()[pdo]
    want = replace(now, mapping=(PdoMappingEntry(index, sub_index, node.length_of(index, sub_index) or 8),))
    return {finding.rule for finding in errors_in(check_pdo(proposal(node, pdo, now, want)))}
