"""Check or show an EDS or DCF file, or add it to the collection that nodes are recognised by."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from dvtcli.files.eds.reader import EdsFile
    from dvtcli.operations.results import Facts, FileReport


@click.command("eds", cls=DvtCommand, short_help=__doc__)
@click.argument("action", type=click.Choice(["check", "show", "add"]), metavar="check|show|add")
@click.argument("file", type=FILE)
def command(action: str, file: str) -> Facts | FileReport:
    """Read FILE and say what is in it; `check` names everything odd with its line.

    \b
    eds check drive.eds
    eds show drive.eds
    eds add drive.eds       found from now on by the node's identity
    """
    from dvtcli.errors import UsageError
    from dvtcli.files.eds.reader import read_eds

    try:
        eds = read_eds(Path(file))
    except OSError as failed:
        raise UsageError(
            f"{file}: {failed.strerror}", place=file, hint="eds takes the path of an EDS or DCF"
        ) from failed
    if action == "check":
        return _report(file, eds)
    return _facts(file, eds) if action == "show" else _added(file, eds)


def _added(file: str, eds: EdsFile) -> Facts:
    from dvtcli.files.eds.own_files import add
    from dvtcli.operations.results import Facts

    info = eds.dictionary.info
    target = add(Path(file), info)
    identity = f"vendor 0x{info.vendor_id:08X} product 0x{info.product_code:08X}"
    said = f"kept as {target}: nodes with {identity} use it from now on"
    return Facts("eds-added", (("file", file), ("kept", str(target))), (said,))


def _report(file: str, eds: EdsFile) -> FileReport:
    from dvtcli.operations.results import FileFinding, FileReport

    findings = tuple(FileFinding(f.line, str(f.severity), f.text) for f in sorted(eds.findings, key=lambda f: f.line))
    worst = 4 if any(finding.severity == "error" for finding in findings) else 0
    return FileReport(file, eds.sections, eds.understood, len(eds.dictionary), findings, worst)


def _facts(file: str, eds: EdsFile) -> Facts:
    from dvtcli.domain.pdo import Pdo
    from dvtcli.operations.results import Facts

    info = eds.dictionary.info
    pdos = {pdo for pdo in map(Pdo.at, eds.dictionary) if pdo is not None and pdo.communication_index in eds.dictionary}
    tpdos = sum(pdo.is_tpdo for pdo in pdos)
    number = {
        name: None if value is None else f"0x{value:08X}"
        for name, value in (
            ("vendor_id", info.vendor_id),
            ("product_code", info.product_code),
            ("revision", info.revision_number),
        )
    }
    rows = (
        ("file", file), ("vendor", info.vendor_name), ("product", info.product_name), *number.items(),
        ("objects", len(eds.dictionary)), ("tpdos", tpdos), ("rpdos", len(pdos) - tpdos),
        ("granularity", info.granularity), ("node_id", eds.node_id),
        ("dummies", None if info.dummies is None else [f"{index:04X}" for index in sorted(info.dummies)]),
    )  # fmt: skip
    text = tuple(f"  {name:<13} {_shown(value)}" for name, value in rows)
    return Facts("eds-info", rows, text)


def _shown(value: object) -> str:
    if isinstance(value, list):
        return " ".join(map(str, value)) or "none"
    return "-" if value in (None, "") else str(value)
