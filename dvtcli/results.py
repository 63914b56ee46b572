"""The result types of the Python API, for type hints and `isinstance`. Contains no code."""

from dvtcli.device.change.applied import Progress
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.lss_services import LssAddress
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.plan import Plan, Step
from dvtcli.domain.ports import Frame
from dvtcli.domain.rules import Finding
from dvtcli.domain.store import Proof
from dvtcli.operations.api.calls import Message
from dvtcli.operations.results.changes import Changed, Stored
from dvtcli.operations.results.checks import FileFinding, FileReport, FileReports, FileRule, NetworksChecked
from dvtcli.operations.results.comparisons import Compared, ObjectDifference, WholeCompared
from dvtcli.operations.results.frames import FramesSent, Replayed
from dvtcli.operations.results.learnt import Difference, LearnForecast, LearntDevice
from dvtcli.operations.results.library_files import (
    AddedFile,
    LibraryAdded,
    LibraryListing,
    LibraryRow,
    ProfileListing,
    ProfileRow,
    ProfileShown,
)
from dvtcli.operations.results.lss_nodes import LssBitRate, LssChanged, LssFound, LssGiven, LssNode
from dvtcli.operations.results.networks import NetworkApplied, NetworkLoad, NetworkPlanned
from dvtcli.operations.results.nodes import (
    Commanded,
    FaultRow,
    Faults,
    LoggedIn,
    NodeListing,
    NodeRow,
    ProgramLoaded,
    SyncCheck,
    Synced,
    SyncSource,
)
from dvtcli.operations.results.pdos import ListedRow, MappedName, PdoListing, PdoRow, PinRow, VpdoListing, VpdoRow
from dvtcli.operations.results.values import EntryUnread, ObjectListing, ObjectRow, RecordRead, ValueRead

__all__ = [
    "AddedFile",
    "Changed",
    "CobId",
    "Commanded",
    "Compared",
    "Difference",
    "EntryUnread",
    "FaultRow",
    "Faults",
    "FileFinding",
    "FileReport",
    "FileReports",
    "FileRule",
    "Finding",
    "Frame",
    "FramesSent",
    "LearnForecast",
    "LearntDevice",
    "LibraryAdded",
    "LibraryListing",
    "LibraryRow",
    "ListedRow",
    "LoggedIn",
    "LssAddress",
    "LssBitRate",
    "LssChanged",
    "LssFound",
    "LssGiven",
    "LssNode",
    "MappedName",
    "Message",
    "NetworkApplied",
    "NetworkLoad",
    "NetworkPlanned",
    "NetworksChecked",
    "NodeListing",
    "NodeRow",
    "ObjectDifference",
    "ObjectListing",
    "ObjectRow",
    "Pdo",
    "PdoCommunicationParameter",
    "PdoConfig",
    "PdoListing",
    "PdoMappingEntry",
    "PdoRow",
    "PinRow",
    "Plan",
    "ProfileListing",
    "ProfileRow",
    "ProfileShown",
    "ProgramLoaded",
    "Progress",
    "Proof",
    "RecordRead",
    "Replayed",
    "Step",
    "Stored",
    "SyncCheck",
    "SyncSource",
    "Synced",
    "ValueRead",
    "VpdoListing",
    "VpdoRow",
    "WholeCompared",
]
