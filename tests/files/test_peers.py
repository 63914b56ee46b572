"""python-canopen and dcfgen open what dvtcli writes, wherever they opened the original."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from datetime import datetime
from functools import partial
from pathlib import Path

import pytest
from canopen.objectdictionary import import_od

from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.files.carried_over import differences, without_values
from dvtcli.files.device_file import (
    DEVICE_SUFFIXES,
    EDS_SUFFIXES,
    device_file_bytes,
    parse_device_file,
    read_device_file,
)
from dvtcli.files.eds.write_dcf import Commissioned, write_dcf
from tests.corpus.oddities import ODDITIES, odd_files
from tests.house.source import PACKAGE
from tests.process import documents, run
from tests.real_files import real_files
from tests.small_eds import plain, var

WHEN = datetime(2026, 1, 2, 3, 4)
NODE_ID = 5
FAMILIES = sorted(PACKAGE.glob("families/*/*.eds"))


def canopen_refuses(data: bytes, name: str) -> str | None:
    """Why python-canopen does not open *data*; None if it does."""
    try:
        text = io.StringIO(data.decode())
        text.name = name
        import_od(text, NODE_ID)
    except Exception as why:  # noqa: BLE001 - whatever it raises is its word
        return f"{type(why).__name__}: {why}"
    return None


def dcfgen_refuses(data: bytes, name: str, folder: Path) -> str | None:
    """Why dcf-tools, which dcfgen reads files with, does not open *data*; None if it does."""
    import dcf

    path = folder / name
    path.write_bytes(data)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            dcf.Device.from_dcf(str(path), {"NODEID": NODE_ID})
        except Exception as why:  # noqa: BLE001 - whatever it raises is its word
            return f"{type(why).__name__}: {why}; {'; '.join(str(one.message) for one in said)}"
    return None


def written(path: Path) -> Iterator[tuple[str, bytes]]:
    """What dvtcli makes of the device file at *path*: the name and the bytes of each file."""
    held = read_device_file(path).dictionary
    for name in ("made.eds", "made.dcf"):
        yield name, _made(held, name)
    for between in ("made.xdd", "made.xdc"):
        through = parse_device_file(_made(held, between), between).dictionary
        yield f"{between}.eds", _made(through, f"{between}.eds")
        yield f"{between}.dcf", _made(through, f"{between}.dcf")
    if path.suffix.lower() in EDS_SUFFIXES:
        values = {
            (entry.index, entry.sub_index): value
            for entry in held.entries()
            if (value := entry.initial(NODE_ID)) is not None
        }
        yield (
            "backup.dcf",
            write_dcf(path.read_bytes(), path.name, values, Commissioned("backup.dcf", NODE_ID, WHEN, 250)).data,
        )


def _made(dictionary: ObjectDictionary, name: str) -> bytes:
    has_values = name.endswith((".dcf", ".xdc"))
    return device_file_bytes(dictionary if has_values else without_values(dictionary), name, "made for a test", WHEN)


def newly_refused(path: Path, folder: Path) -> dict[str, str]:
    """The files made of *path* that a peer refuses though it opens the original.

    Of an XDD, which no peer reads, canopen must open what is made: dcfgen refuses every REAL with a fraction.
    """
    data = path.read_bytes()
    is_xml = path.suffix.lower() not in EDS_SUFFIXES
    found: dict[str, str] = {}
    for peer, refuses in (("canopen", canopen_refuses), ("dcfgen", partial(dcfgen_refuses, folder=folder))):
        if peer == "dcfgen" if is_xml else refuses(data, path.name):
            continue
        refusals = ((name, refuses(made, name)) for name, made in written(path))
        found |= {f"{peer} {name}": why for name, why in refusals if why}
    return found


@pytest.mark.needs("dcf")
@pytest.mark.parametrize("path", FAMILIES, ids=lambda path: path.stem)
def test_peers_open_what_is_made_of_the_files_of_families(path: Path, tmp_path: Path) -> None:
    assert canopen_refuses(path.read_bytes(), path.name) is None
    assert newly_refused(path, tmp_path) == {}


@pytest.mark.needs("dcf")
@pytest.mark.parametrize("family", ["gen4", "generic"])
def test_a_file_without_units_gets_none_that_dcfgen_would_refuse(family: str, tmp_path: Path) -> None:
    lines = (PACKAGE / "families" / family / f"{family}.eds").read_bytes().splitlines(keepends=True)
    path = tmp_path / "bare.eds"
    path.write_bytes(b"".join(line for line in lines if not line.startswith((b"Unit=", b"Factor="))))
    assert dcfgen_refuses(b"".join(lines), "whole.eds", tmp_path) is not None
    assert dcfgen_refuses(path.read_bytes(), path.name, tmp_path) is None
    assert newly_refused(path, tmp_path) == {}


@pytest.mark.needs("dcf")
@pytest.mark.drawn(3)
@pytest.mark.parametrize("number", range(len(ODDITIES)))
def test_peers_open_what_is_made_of_odd_files(number: int, tmp_path: Path) -> None:
    assert newly_refused(odd_files(number + 1)[-1].write(tmp_path), tmp_path) == {}


@pytest.mark.needs("dcf")
@pytest.mark.parametrize("name", ["plain.eds", "plain.dcf"])
@pytest.mark.parametrize("path", FAMILIES, ids=lambda path: path.stem)
def test_peers_open_a_plain_file_of_each_family(path: Path, name: str, tmp_path: Path) -> None:
    """Units, modules and safety keys, which dcfgen refuses, are left out, and named; all else stays."""
    done = run(("eds", "convert", str(path), str(tmp_path / name), "--plain", "--json"), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    data = (tmp_path / name).read_bytes()
    assert canopen_refuses(data, name) is None
    assert dcfgen_refuses(data, name, tmp_path) is None
    before, after = read_device_file(path), parse_device_file(data, name)
    lost = {difference.what for difference in differences(before.dictionary, after.dictionary)}
    assert lost <= {"unit", "factor"}
    said = " ".join(documents(done.stdout)[0]["losses"])
    assert all(word in said for word in LOST.get(path.stem, ()))


#: what a plain file of a family lacks
LOST = {
    "coupler": ("15 sections", "[SupportedModules]"), "espac": ("unit of",), "gen4": ("unit of",),
    "generic": ("unit of",), "roboteq": ("unit of",), "safety": ("SRDOMapping", "CANopenSafetySupported"),
    "tmcm": ("unit of",),
}  # fmt: skip


@pytest.mark.parametrize("words", [("gen4", "p.xdd"), ("gen4", "p.xdc"), ("net.yaml", "p.dbc"), ("net.yaml", "p.cdcf")])
def test_only_an_eds_or_dcf_is_plain(words: tuple[str, str], tmp_path: Path) -> None:
    (tmp_path / "net.yaml").write_text("nodes: {a: {node_id: 5, dcf: gen4}}\n")
    done = run(("eds", "convert", *words, "--plain"), cwd=tmp_path)
    assert (done.returncode, f"{words[1]} is not an EDS or DCF; only these can be plain" in done.stderr) == (2, True)
    assert not (tmp_path / words[1]).exists()


@pytest.mark.needs("dcf")
def test_peers_open_what_is_made_of_real_files(pytestconfig: pytest.Config, tmp_path: Path) -> None:
    files = real_files(pytestconfig, DEVICE_SUFFIXES)
    if not files:
        pytest.skip("--eds-corpus names no folder")
    assert {path.name: refused for path in files if (refused := newly_refused(path, tmp_path))} == {}


@pytest.mark.needs("dcf")
def test_a_key_that_was_absent_stays_absent(tmp_path: Path) -> None:
    path = tmp_path / "bare.eds"
    path.write_text(plain().text())
    assert "Granularity" not in path.read_text()
    assert newly_refused(path, tmp_path) == {}
    for name, made in written(path):
        assert not [line for line in made.decode().splitlines() if line.endswith("=")], name


@pytest.mark.needs("dcf")
@pytest.mark.parametrize("code", [0x0008, 0x0011])
@pytest.mark.parametrize("value", ["1", "-3", "0"])
def test_a_whole_real_is_written_without_a_point(code: int, value: str, tmp_path: Path) -> None:
    device = plain()
    device.variable(0x2000, var("Scale", code, value, LowLimit=value))
    path = tmp_path / "reals.eds"
    path.write_text(device.text())
    assert newly_refused(path, tmp_path) == {}
