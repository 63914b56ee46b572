"""What commands answer: values that `view` turns into text, and that say their own JSON document.

Field names of documents are stable (README, "Machine output"). A name is imported when it is first used: a command
needs two or three of them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dvtcli.results.access import LoggedIn as LoggedIn
    from dvtcli.results.changes import Changed as Changed
    from dvtcli.results.changes import Compared as Compared
    from dvtcli.results.changes import Stored as Stored
    from dvtcli.results.documents import Document as Document
    from dvtcli.results.documents import Result as Result
    from dvtcli.results.documents import finding_document as finding_document
    from dvtcli.results.documents import hex_bytes as hex_bytes
    from dvtcli.results.documents import json_value as json_value
    from dvtcli.results.dvt import DvtAnswer as DvtAnswer
    from dvtcli.results.files import Facts as Facts
    from dvtcli.results.files import FileFinding as FileFinding
    from dvtcli.results.files import FileReport as FileReport
    from dvtcli.results.frames import FrameSeen as FrameSeen
    from dvtcli.results.frames import Plotted as Plotted
    from dvtcli.results.frames import PlottedSignal as PlottedSignal
    from dvtcli.results.health import Check as Check
    from dvtcli.results.health import Diagnosis as Diagnosis
    from dvtcli.results.nodes import Commanded as Commanded
    from dvtcli.results.nodes import NodeListing as NodeListing
    from dvtcli.results.nodes import NodeRow as NodeRow
    from dvtcli.results.nodes import Synced as Synced
    from dvtcli.results.pdos import LastFrame as LastFrame
    from dvtcli.results.pdos import MappedName as MappedName
    from dvtcli.results.pdos import PdoListing as PdoListing
    from dvtcli.results.pdos import PdoRow as PdoRow
    from dvtcli.results.profiles import ProfileListing as ProfileListing
    from dvtcli.results.profiles import ProfileShown as ProfileShown
    from dvtcli.results.values import ObjectListing as ObjectListing
    from dvtcli.results.values import ObjectRow as ObjectRow
    from dvtcli.results.values import ValueRead as ValueRead
    from dvtcli.results.vpdos import VpdoListing as VpdoListing

_WHERE = {
    "Document": "documents",
    "Result": "documents",
    "hex_bytes": "documents",
    "json_value": "documents",
    "finding_document": "documents",
    "LastFrame": "pdos",
    "MappedName": "pdos",
    "PdoRow": "pdos",
    "PdoListing": "pdos",
    "ValueRead": "values",
    "ObjectRow": "values",
    "ObjectListing": "values",
    "Changed": "changes",
    "Stored": "changes",
    "Compared": "changes",
    "NodeRow": "nodes",
    "NodeListing": "nodes",
    "Commanded": "nodes",
    "Synced": "nodes",
    "LoggedIn": "access",
    "VpdoListing": "vpdos",
    "ProfileListing": "profiles",
    "ProfileShown": "profiles",
    "FrameSeen": "frames",
    "Plotted": "frames",
    "PlottedSignal": "frames",
    "FileFinding": "files",
    "FileReport": "files",
    "Facts": "files",
    "DvtAnswer": "dvt",
    "Check": "health",
    "Diagnosis": "health",
}


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"dvtcli.results has no {name}")
    return getattr(import_module(f"dvtcli.results.{_WHERE[name]}"), name)
