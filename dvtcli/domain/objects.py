"""Indices of communication objects, by their names in CiA 301 and CiA 302, without their number: `COB_ID_SYNC`."""

from __future__ import annotations

# CiA 301, 7.5.2
DEVICE_TYPE, ERROR_REGISTER, ERROR_FIELD = 0x1000, 0x1001, 0x1003
COB_ID_SYNC, CYCLE_PERIOD, SYNC_WINDOW, SYNC_OVERFLOW = 0x1005, 0x1006, 0x1007, 0x1019
GUARD_TIME, LIFE_TIME_FACTOR = 0x100C, 0x100D
STORE_PARAMETERS, RESTORE_PARAMETERS = 0x1010, 0x1011
COB_ID_TIME, COB_ID_EMCY, INHIBIT_TIME_EMCY = 0x1012, 0x1014, 0x1015
CONSUMER_HEARTBEAT, PRODUCER_HEARTBEAT, IDENTITY, ERROR_BEHAVIOUR = 0x1016, 0x1017, 0x1018, 0x1029
#: Date and time as the stamp of a configuration (`Stamp` in `domain/store.py`).
VERIFY_CONFIGURATION = 0x1020
MODULE_LIST = 0x1027
#: Sub-index 1 is the COB-ID to the server, 2 that from it, 3 the other side's node-ID.
SDO_SERVERS, SDO_CLIENTS = range(0x1200, 0x1280), range(0x1280, 0x1300)
#: SDO servers after the default one, and SDO clients: their COB-IDs can be set.
FURTHER_SDO_SERVERS, FURTHER_SDO_CHANNELS = range(0x1201, 0x1280), range(0x1201, 0x1300)
#: One sub-index per program, 1..254 (CiA 302-3).
PROGRAM_DATA, PROGRAM_CONTROL, PROGRAM_IDENTIFICATION, FLASH_STATUS = 0x1F50, 0x1F51, 0x1F56, 0x1F57

# CiA 302-2: the NMT master, and what it expects of each node
NMT_STARTUP, SLAVE_ASSIGNMENT, REQUEST_NMT, REQUEST_GUARDING, BOOT_TIME = 0x1F80, 0x1F81, 0x1F82, 0x1F83, 0x1F89
EXPECTED_DEVICE_TYPE, EXPECTED_VENDOR, EXPECTED_PRODUCT = 0x1F84, 0x1F85, 0x1F86
EXPECTED_REVISION, EXPECTED_SERIAL = 0x1F87, 0x1F88
CONCISE_DCF, EXPECTED_DATE, EXPECTED_TIME = 0x1F22, 0x1F26, 0x1F27

# EN 50325-5
SAFETY, SRDO_COMMUNICATION, SRDO_MAPPING = range(0x1300, 0x1400), range(0x1301, 0x1341), range(0x1381, 0x13C1)
SAFETY_VALID, SAFETY_SIGNATURES = 0x13FE, 0x13FF

# Areas of the object dictionary (CiA 301, 7.4.1)
COMMUNICATION_AREA, MANUFACTURER_AREA, PROFILE_AREA = (
    range(0x1000, 0x2000),
    range(0x2000, 0x6000),
    range(0x6000, 0xA000),
)
#: Index distance between logical devices, such as the axes of a drive (CiA 301, 7.4.1; CiA 402-2, 7)
LOGICAL_DEVICE = 0x800
#: Objects that CiA 301 requires of every device.
MANDATORY = (DEVICE_TYPE, ERROR_REGISTER, IDENTITY)


def in_first(index: int) -> int:
    """The first logical device's index for *index* in `PROFILE_AREA`, which starts at a multiple of the distance."""
    return PROFILE_AREA.start + index % LOGICAL_DEVICE
