"""What commands answer: values that `view` turns into text, and that say their own JSON document.

Field names of documents are stable (docs/reference/json.md). A name is imported when it is first used: a command
needs two or three of them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dvtcli.operations.results.changes import Changed as Changed
    from dvtcli.operations.results.changes import ChangedNodes as ChangedNodes
    from dvtcli.operations.results.changes import Compared as Compared
    from dvtcli.operations.results.changes import ComparedNodes as ComparedNodes
    from dvtcli.operations.results.changes import Stored as Stored
    from dvtcli.operations.results.device_profiles import ProfileListing as ProfileListing
    from dvtcli.operations.results.device_profiles import ProfileShown as ProfileShown
    from dvtcli.operations.results.diagnosis import Check as Check
    from dvtcli.operations.results.diagnosis import Diagnosis as Diagnosis
    from dvtcli.operations.results.documents import Document as Document
    from dvtcli.operations.results.documents import Result as Result
    from dvtcli.operations.results.documents import finding_document as finding_document
    from dvtcli.operations.results.documents import hex_bytes as hex_bytes
    from dvtcli.operations.results.documents import json_value as json_value
    from dvtcli.operations.results.dvt import DvtAnswer as DvtAnswer
    from dvtcli.operations.results.files import Facts as Facts
    from dvtcli.operations.results.files import FileFinding as FileFinding
    from dvtcli.operations.results.files import FileReport as FileReport
    from dvtcli.operations.results.frames import FrameSeen as FrameSeen
    from dvtcli.operations.results.frames import Plotted as Plotted
    from dvtcli.operations.results.frames import PlottedSignal as PlottedSignal
    from dvtcli.operations.results.logged_in import LoggedIn as LoggedIn
    from dvtcli.operations.results.nodes import Commanded as Commanded
    from dvtcli.operations.results.nodes import NodeListing as NodeListing
    from dvtcli.operations.results.nodes import NodeRow as NodeRow
    from dvtcli.operations.results.nodes import Synced as Synced
    from dvtcli.operations.results.pdos import LastFrame as LastFrame
    from dvtcli.operations.results.pdos import MappedName as MappedName
    from dvtcli.operations.results.pdos import PdoListing as PdoListing
    from dvtcli.operations.results.pdos import PdoRow as PdoRow
    from dvtcli.operations.results.values import ObjectListing as ObjectListing
    from dvtcli.operations.results.values import ObjectRow as ObjectRow
    from dvtcli.operations.results.values import ValueRead as ValueRead
    from dvtcli.operations.results.vpdos import VpdoListing as VpdoListing

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
    "ChangedNodes": "changes",
    "Compared": "changes",
    "ComparedNodes": "changes",
    "NodeRow": "nodes",
    "NodeListing": "nodes",
    "Commanded": "nodes",
    "Synced": "nodes",
    "LoggedIn": "logged_in",
    "VpdoListing": "vpdos",
    "ProfileListing": "device_profiles",
    "ProfileShown": "device_profiles",
    "FrameSeen": "frames",
    "Plotted": "frames",
    "PlottedSignal": "frames",
    "FileFinding": "files",
    "FileReport": "files",
    "Facts": "files",
    "DvtAnswer": "dvt",
    "Check": "diagnosis",
    "Diagnosis": "diagnosis",
}


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"dvtcli.operations.results has no {name}")
    return getattr(import_module(f"dvtcli.operations.results.{_WHERE[name]}"), name)
