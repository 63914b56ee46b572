"""CAN-IDs of the pre-defined connection set (CiA 301, 7.3.3) and of LSS (CiA 305); a *base* is without its node-ID."""

from __future__ import annotations

NMT_ID, SYNC_ID, TIME_ID = 0x000, 0x080, 0x100
EMCY_BASE, SDO_RESPONSE_BASE, SDO_REQUEST_BASE, HEARTBEAT_BASE = 0x080, 0x580, 0x600, 0x700
LSS_REQUEST_ID, LSS_RESPONSE_ID = 0x7E5, 0x7E4
