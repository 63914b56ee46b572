"""The keys of an EDS or DCF (CiA 306, and SRDOs of EN 50325-5), and what becomes of each in a converted file."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum


class Carried(Enum):
    """What becomes of a key when a file is converted."""

    #: the dictionary has its value, or it is written anew
    HELD = "held"
    #: it stays as it stands: of a device's kind, in an EDS and a DCF; of one node, in a DCF
    KEPT = "kept"
    KEPT_OF_A_NODE = "kept of a node"
    #: it is lost, and the conversion says so
    LOST = "lost"


#: stands for the sections of objects and sub-indices
OBJECT = "object"
_BIT_RATES_KBIT = (10, 20, 50, 125, 250, 500, 800, 1000)
#: By section, in the standard's spelling. Unit, Factor and Description of an object are common but not standard.
KEYS: Mapping[str, Mapping[str, Carried]] = {
    "fileinfo": dict.fromkeys(
        ("FileName", "FileVersion", "FileRevision", "EDSVersion", "Description", "CreationTime", "CreationDate",
         "CreatedBy", "ModificationTime", "ModificationDate", "ModifiedBy", "LastEDS"), Carried.HELD,
    ),
    "deviceinfo": {
        "VendorName": Carried.HELD, "VendorNumber": Carried.HELD, "ProductName": Carried.HELD,
        "ProductNumber": Carried.HELD, "RevisionNumber": Carried.HELD, "OrderCode": Carried.HELD,
        **{f"BaudRate_{rate}": Carried.HELD for rate in _BIT_RATES_KBIT},
        "SimpleBootUpMaster": Carried.HELD, "SimpleBootUpSlave": Carried.HELD, "Granularity": Carried.HELD,
        "DynamicChannelsSupported": Carried.HELD, "CompactPDO": Carried.HELD, "GroupMessaging": Carried.HELD,
        "NrOfRXPDO": Carried.HELD, "NrOfTXPDO": Carried.HELD, "LSS_Supported": Carried.HELD,
        "CANopenSafetySupported": Carried.KEPT,
        "NG_Slave": Carried.LOST, "NG_Master": Carried.LOST, "NrOfNG_MonitoredNodes": Carried.LOST,
    },
    "devicecomissioning": {
        "NodeID": Carried.HELD, "NodeName": Carried.HELD, "NodeRefd": Carried.KEPT_OF_A_NODE,
        "Baudrate": Carried.HELD, "NetNumber": Carried.HELD, "NetworkName": Carried.HELD,
        "NetRefd": Carried.KEPT_OF_A_NODE, "CANopenManager": Carried.HELD, "LSS_SerialNumber": Carried.HELD,
    },
    OBJECT: {
        "ParameterName": Carried.HELD, "ObjectType": Carried.HELD, "DataType": Carried.HELD,
        "AccessType": Carried.HELD, "DefaultValue": Carried.HELD, "PDOMapping": Carried.HELD, "LowLimit": Carried.HELD,
        "HighLimit": Carried.HELD, "SubNumber": Carried.HELD, "CompactSubObj": Carried.HELD, "ObjFlags": Carried.HELD,
        "ParameterValue": Carried.HELD, "Denotation": Carried.HELD, "UploadFile": Carried.KEPT_OF_A_NODE,
        "DownloadFile": Carried.KEPT_OF_A_NODE, "ParamRefd": Carried.KEPT_OF_A_NODE, "SRDOMapping": Carried.KEPT,
        "InvertedSRAD": Carried.KEPT, "Unit": Carried.HELD, "Factor": Carried.HELD, "Description": Carried.LOST,
    },
}  # fmt: skip


def keys_that_are(carried: Carried, *sections: str) -> frozenset[str]:
    """The keys of *sections* (none: all), in lower case, that are *carried* so."""
    tables = (KEYS[section] for section in sections or KEYS)
    return frozenset(key.lower() for table in tables for key, found in table.items() if found is carried)
