"""Choose the CAN-ID for the TPDO of a link."""

from __future__ import annotations

from collections.abc import Collection
from itertools import chain

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.network.wanted_state import Endpoint
from dvtcli.domain.rules.can_id import FREE_POOL, restricted_use

#: Default CAN-IDs of SYNC, EMCY and TIME, which CiA 301 does not restrict.
_SERVICES = range(0x080, 0x101)
#: CAN-IDs of PDOs in the pre-defined connection set (CiA 301, 7.3.5).
_PREDEFINED = range(0x181, 0x580)


def may_keep(cob_id: CobId, used: Collection[int]) -> bool:
    """Whether a TPDO may use the CAN-ID of *cob_id* while others use *used*."""
    if not cob_id.fits_frame or cob_id.can_id in used:
        return False
    return cob_id.extended or not (restricted_use(cob_id.can_id) or cob_id.can_id in _SERVICES)


def free_can_id(producer: Endpoint, used: Collection[int]) -> int | None:
    """An unused CAN-ID for *producer*: its default in the pre-defined set, else the next free CAN-ID.

    None if all are in use. 0x680…0x6DF come before the defaults of other PDOs.
    """
    default = producer.pdo.default_can_id(producer.node_id)
    candidates = chain(() if default is None else (default,), FREE_POOL, _PREDEFINED)
    return next((can_id for can_id in candidates if may_keep(CobId(can_id), used)), None)
