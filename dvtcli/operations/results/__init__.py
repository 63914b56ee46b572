"""The results of commands, which have their own JSON documents; `view` turns them into text.

Field names of documents are stable (docs/how-to/json.md). Modules are imported at first use of a name: a command
needs two or three.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dvtcli.operations.results.changes import *  # noqa: F403
    from dvtcli.operations.results.checks import *  # noqa: F403
    from dvtcli.operations.results.comparisons import *  # noqa: F403
    from dvtcli.operations.results.documents import *  # noqa: F403
    from dvtcli.operations.results.facts import *  # noqa: F403
    from dvtcli.operations.results.failures import *  # noqa: F403
    from dvtcli.operations.results.frames import *  # noqa: F403
    from dvtcli.operations.results.learnt import *  # noqa: F403
    from dvtcli.operations.results.library_files import *  # noqa: F403
    from dvtcli.operations.results.lss_nodes import *  # noqa: F403
    from dvtcli.operations.results.networks import *  # noqa: F403
    from dvtcli.operations.results.nodes import *  # noqa: F403
    from dvtcli.operations.results.pdos import *  # noqa: F403
    from dvtcli.operations.results.values import *  # noqa: F403

#: Every public name of this room, by module.
NAMES: dict[str, tuple[str, ...]] = {
    "changes": (
        "Changed",
        "ChangedNodes",
        "Stored",
    ),
    "checks": (
        "SEVERITIES",
        "FileRule",
        "FileFinding",
        "Judged",
        "FileReport",
        "FileReports",
        "Report",
        "Reported",
        "NetworkFinding",
        "NetworkReport",
        "NetworksChecked",
        "RecordingFinding",
        "RecordingReport",
        "RecordingsChecked",
    ),
    "comparisons": ("Compared", "ComparedNodes", "ObjectDifference", "WholeCompared"),
    "documents": (
        "Document",
        "CASES",
        "Short",
        "Answer",
        "brief",
        "R",
        "Rows",
        "Result",
        "hex_bytes",
        "json_value",
        "finding_document",
        "lacking_documents",
        "physical_document",
    ),
    "failures": (
        "not_proved",
        "missing_error",
        "not_as_before",
        "not_as_wanted",
        "compared_text",
        "not_obeyed",
        "together",
    ),
    "frames": (
        "BusEvent",
        "FrameSeen",
        "PlottedSignal",
        "Plotted",
        "part_document",
        "FrameExplained",
        "TracedFrame",
        "Traced",
        "NO_END",
        "Outcome",
        "OfFrames",
        "FrameToSend",
        "FramesSent",
        "FramesToReplay",
        "Replayed",
    ),
    "learnt": ("Difference", "LearntDevice", "LearnForecast", "Wanted", "WantedState", "HabitRow", "HabitListing"),
    "library_files": (
        "AddedFile",
        "LibraryAdded",
        "LibraryRow",
        "LibraryListing",
        "ProfileRow",
        "ProfileListing",
        "ProfileShown",
    ),
    "lss_nodes": ("LssNode", "LssFound", "LssGiven", "LssChanged", "LssBitRate", "ReceivedAt", "BitRateFound"),
    "networks": (
        "NetworkPlanned",
        "network_findings",
        "action",
        "differing",
        "NetworkApplied",
        "Measured",
        "FrameLoad",
        "NetworkLoad",
        "need_document",
    ),
    "nodes": (
        "NodeRow",
        "NodeListing",
        "Commanded",
        "Synced",
        "LoggedIn",
        "ProgramLoaded",
        "SyncSource",
        "SyncCheck",
        "FaultRow",
        "Faults",
        "FaultSeen",
    ),
    "pdos": ("MappedName", "LastFrame", "ListedRow", "PdoRow", "PdoListing", "PinRow", "VpdoRow", "VpdoListing"),
    "values": (
        "ValueRead",
        "ObjectRow",
        "ObjectListing",
        "EntryUnread",
        "RecordRead",
        "MOST_POINTS",
        "ValuesRead",
        "ObjectCourse",
        "ValuesWatched",
    ),
    "facts": (
        "Facts",
        "DvtAnswer",
        "Verdict",
        "Check",
        "Diagnosis",
    ),
}
_MODULES = {name: module for module, names in NAMES.items() for name in names}

if not TYPE_CHECKING:  # for a type checker a name that is not there is a mistake

    def __getattr__(name: str) -> Any:
        if name not in _MODULES:
            raise AttributeError(f"dvtcli.operations.results has no {name}")
        found = globals()[name] = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
        return found
