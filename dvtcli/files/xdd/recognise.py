"""Whether XML is a CANopen device description, and what it is where it is none. Does not look at objects."""

from __future__ import annotations

from dvtcli.errors import InputFileError
from dvtcli.files.xdd.xml_tree import XmlTree

#: The published namespaces of CiA 311.
NAMESPACES = ("http://www.canopen.org/xml/1.0", "http://www.canopen.org/xml/1.1")
_ROOT = "ISO15745ProfileContainer"
_XDD = "an XDD or XDC (CiA 311) has the element CANopenObjectList"


def must_be_canopen(tree: XmlTree, source: str) -> None:
    """InputFileError, naming what it is instead, where *tree* is not CiA 311; *source* is its name for messages."""
    what = _other(tree)
    if what is not None:
        name, hint = what
        raise InputFileError(f"{source} is {name}", place=f"{source}:{tree.root.line}", why=_XDD, hint=hint)


def _other(tree: XmlTree) -> tuple[str, str | None] | None:
    """What it is, and what helps; None where it is CiA 311."""
    named = [tree.namespace, *tree.types]
    if any("powerlink" in name.lower() for name in named):
        return (
            "a description of an Ethernet POWERLINK device (EPSG DS 311), not of a CANopen one",
            "its maker may have an EDS or XDD of the CANopen variant",
        )
    if tree.root.name == "EtherCATInfo":
        hint = "the maker's EDS has the same objects, where the device speaks CANopen"
        return "a description of an EtherCAT device (ESI), not of a CANopen one", hint
    if next(tree.root.anywhere("CANopenObjectList"), None) is not None:
        return None
    if tree.root.name != _ROOT:
        return f"no XDD or XDC: its first element is {tree.root.name[:60]}", None
    return "no description of a CANopen device: it has no CANopenObjectList", None
