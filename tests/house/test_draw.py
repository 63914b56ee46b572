"""The drawing sees every way in which a file names another: nothing can be imported behind its back."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.house.draw import House, main

pytestmark = pytest.mark.together

WAYS = {
    "import dvtcli.device.node": "top",
    "from dvtcli.device import node": "top",
    "from dvtcli.device.node import Node": "top",
    "from ..device import node": "top",
    "def f():\n    from dvtcli.device.node import Node": "lazy",
    "if TYPE_CHECKING:\n    from dvtcli.device.node import Node": "type",
    "import_module('dvtcli.device.node')": "named",
    "WHAT = 'node'\nimport_module(f'dvtcli.device.{WHAT}')": "named",
    "import_module('dvtcli.device.' + 'no' + 'de')": "named",
    "CODE = 'from dvtcli.device.node import Node'": "named",
    "COMMAND = [executable, '-m', 'dvtcli.device.node']": "named",
}


def built(folder: Path, **files: str) -> Path:
    """A package with a few rooms; *files* are texts of `room__file`."""
    package = folder / "dvtcli"
    for room in ("domain", "device"):
        (package / room).mkdir(parents=True)
        (package / room / "__init__.py").write_text("")
    (package / "__init__.py").write_text("")
    texts = {"domain__pdo": "", "device__node": "", **files}
    for name, text in texts.items():
        (package / f"{name.replace('__', '/')}.py").write_text(text)
    return package


@pytest.mark.parametrize("line", WAYS)
def test_every_way_of_importing_is_an_arrow(tmp_path: Path, line: str) -> None:
    house = House(built(tmp_path, domain__pdo=line))
    assert {(arrow.source, arrow.target, arrow.how) for arrow in house.outward()} == {
        ("domain/pdo.py", "device/node.py", WAYS[line])
    }
    assert main(["--package", str(tmp_path / "dvtcli")]) == 1


def test_names_of_documents_and_words_in_prose_are_none(tmp_path: Path) -> None:
    text = (
        '"""See dvtcli.device.node."""\nSCHEMA = "dvtcli.device/1"\nFILE = "dvtcli.toml"\nNAME = f"dvtcli.{SCHEMA}/1"\n'
    )
    assert House(built(tmp_path, domain__pdo=text)).arrows == ()


def test_arrows_in_the_order_are_no_fault(tmp_path: Path) -> None:
    package = built(tmp_path, device__node="from dvtcli.domain.pdo import Pdo")
    house = House(package)
    assert [str(arrow) for arrow in house.arrows] == ["device/node.py:1 -> domain/pdo.py (top)"]
    assert house.outward() == []
    assert main(["--package", str(package)]) == 0


def test_a_circle_inside_a_room_is_found_through_a_lazy_and_a_type_only_import(tmp_path: Path) -> None:
    files = {
        "device__a": "from dvtcli.device import b",
        "device__b": "def f():\n    import dvtcli.device.c",
        "device__c": "if TYPE_CHECKING:\n    from dvtcli.device.a import A",
        "device__d": "from dvtcli.device import a",
    }
    house = House(built(tmp_path, **files))
    assert house.circles() == [["device/a.py", "device/b.py", "device/c.py"]]
    assert house.outward() == []


def test_a_room_in_no_table_may_be_imported_by_none(tmp_path: Path) -> None:
    package = built(tmp_path, domain__pdo="from dvtcli import elsewhere", elsewhere="")
    assert [arrow.target for arrow in House(package).outward()] == ["elsewhere.py"]
