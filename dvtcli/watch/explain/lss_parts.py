"""An LSS frame (CiA 305), byte by byte."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain import lss_services as lss
from dvtcli.watch.explain.parts import Bytes, FramePart

_ADDRESS = ("vendor-ID", "product code", "revision number", "serial number")
_RANGES = (*_ADDRESS[:2], "lowest revision", "highest revision", "lowest serial number", "highest serial number")
_NAMES = {
    lss.SWITCH_GLOBAL: "switch state global",
    lss.CONFIGURE_NODE_ID: "configure node-ID",
    lss.CONFIGURE_BIT_TIMING: "configure bit timing",
    lss.ACTIVATE_BIT_TIMING: "activate bit timing",
    lss.STORE_CONFIGURATION: "store configuration",
    lss.SELECTED: "a node is selected",
    lss.IDENTIFY_UNCONFIGURED: "identify nodes without a node-ID",
    lss.IDENTIFIED: "a node identifies itself",
    lss.IDENTIFIED_UNCONFIGURED: "a node without a node-ID identifies itself",
    lss.FAST_SCAN: "fast scan",
    lss.INQUIRE_NODE_ID: "inquire node-ID",
    **{lss.SELECT + n: f"switch state selective: {name}" for n, name in enumerate(_ADDRESS)},
    **{lss.IDENTIFY + n: f"identify: {name}" for n, name in enumerate(_RANGES)},
    **{lss.INQUIRE + n: f"inquire {name}" for n, name in enumerate(_ADDRESS)},
}
_RATES = {index: rate for rate, index in lss.BIT_TIMINGS.items()}
_REFUSALS = {
    lss.CONFIGURE_NODE_ID: lss.NODE_ID_REFUSED,
    lss.CONFIGURE_BIT_TIMING: lss.BIT_TIMING_REFUSED,
    lss.STORE_CONFIGURATION: lss.STORE_REFUSED,
}


def lss_parts(data: bytes, *, request: bool) -> Iterator[FramePart]:
    """Parts of a master's LSS *request*, or a slave's answer."""
    if not data:
        return
    cut, service = Bytes(data), data[0]
    yield cut.part(0, 8, "command specifier", _NAMES.get(service, "reserved, or not known"))
    there = 8 * len(data)
    fields = [field for field in _fields(cut, service, request=request) if field.start_bit + field.bits <= there]
    yield from fields
    yield from cut.rest(max([1, *((field.start_bit + field.bits) // 8 for field in fields)]), "reserved")


def _fields(cut: Bytes, service: int, *, request: bool) -> Iterator[FramePart]:
    if not request and service in _REFUSALS:
        code, own = cut.number(1, 1), cut.number(2, 1)
        yield cut.part(8, 8, "error code", lss.refusal(_REFUSALS[service], code, own) if code else "done")
        yield cut.part(16, 8, "the maker's error")
    elif service in range(lss.SELECT, lss.SELECT + 4) or service in range(lss.IDENTIFY, lss.IDENTIFY + 6):
        yield cut.part(8, 32, _NAMES[service].rpartition(": ")[2], str(cut.number(1, 4)))
    elif service == lss.SWITCH_GLOBAL:
        mode = {lss.WAITING: "waiting", lss.CONFIGURATION: "configuration"}.get(cut.number(1, 1), "reserved")
        yield cut.part(8, 8, "mode", mode)
    elif service == lss.CONFIGURE_NODE_ID or (service == lss.INQUIRE_NODE_ID and not request):
        yield cut.part(8, 8, "node-ID", "none" if cut.number(1, 1) == 0xFF else str(cut.number(1, 1)))
    elif service == lss.CONFIGURE_BIT_TIMING:
        table, index = cut.number(1, 1), cut.number(2, 1)
        yield cut.part(8, 8, "table selector", "the standard's" if not table else "the maker's, or reserved")
        rate = _RATES.get(index) if not table else None
        yield cut.part(16, 8, "table index", f"{rate} bit/s" if rate else "reserved, or the maker's")
    elif service == lss.ACTIVATE_BIT_TIMING:
        yield cut.part(8, 16, "switch delay", f"{cut.number(1, 2)} ms")
    elif service == lss.FAST_SCAN:
        yield cut.part(8, 32, "number asked for", f"{cut.number(1, 4)}")
        reset = cut.number(5, 1) == lss.SCAN_RESET
        yield cut.part(40, 8, "bit checked", "none: who is there" if reset else f"bits 31 to {cut.number(5, 1)}")
        for first, name in ((6, "part asked for"), (7, "part asked for next")):
            part = cut.number(first, 1)
            yield cut.part(8 * first, 8, name, _ADDRESS[part] if part < len(_ADDRESS) else "reserved")
    elif not request and service in range(lss.INQUIRE, lss.INQUIRE + 4):
        yield cut.part(8, 32, _ADDRESS[service - lss.INQUIRE], str(cut.number(1, 4)))
