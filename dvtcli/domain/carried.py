"""What a file lets PDOs do with an object: take it, or send it. Does not know what a PDO maps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.object_dictionary import Access

if TYPE_CHECKING:
    from dvtcli.domain.object_dictionary import OdEntry


def rpdo_may_take(entry: OdEntry) -> bool:
    """Whether an RPDO can take it (CiA 306, 4.6.3.2); where PDOMapping is left out it is 0, but not for rww."""
    if entry.access is Access.RWW:
        return entry.pdo_mapping is not False
    return bool(entry.pdo_mapping) and entry.access in (Access.RW, Access.WO)


def pdo_may_carry(entry: OdEntry) -> bool:
    """Whether an RPDO can take it, or a TPDO send it."""
    return bool(entry.pdo_mapping) or rpdo_may_take(entry)


def may_be_commanded(entry: OdEntry) -> bool:
    """Whether a PDO can carry it, and a master write it."""
    return pdo_may_carry(entry) and entry.access.writable
