"""LSS slave: the state machine that receives a node-ID over the bus (CiA 305, layer setting services).

From requests (8 bytes, CAN-ID 0x7E5) to answers (8 bytes, 0x7E4), without clocks.
"""

from __future__ import annotations

from collections.abc import Collection

from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.objects import IDENTITY
from dvtcli.simulator.device.family import GENERIC, Family
from dvtcli.simulator.device.memory import Memory, ParameterAreas

SWITCH_GLOBAL, CONFIGURE_NODE_ID, CONFIGURE_BIT_TIMING = 0x04, 0x11, 0x13
ACTIVATE_BIT_TIMING, STORE_CONFIGURATION = 0x15, 0x17
SELECT, SELECTED, IDENTIFY, IDENTIFIED = range(0x40, 0x44), 0x44, range(0x46, 0x4C), 0x4F
IDENTIFY_UNCONFIGURED, IDENTIFIED_UNCONFIGURED, FAST_SCAN = 0x4C, 0x50, 0x51
INQUIRE, INQUIRE_NODE_ID = range(0x5A, 0x5E), 0x5E
#: error codes of the configuration services: out of range or not supported; the store's medium failed
NOT_SUPPORTED, MEDIUM_FAILED = 1, 2
#: indices of the standard's table of bit timings, in bit/s (CiA 305, table selector 0)
BIT_RATES = {0: 1_000_000, 1: 800_000, 2: 500_000, 3: 250_000, 4: 125_000, 6: 50_000, 7: 20_000, 8: 10_000}
#: what nobody runs at: a node that a bit timing has put out of reach
LOST_RATE = 0
#: fast scan: every unconfigured slave answers, and starts over
_SCAN_RESET = 0x80
#: which part of the identity each frame of *identify remote slave* speaks of
_IDENTIFY_PARTS = (0, 1, 2, 2, 3, 3)


class LssSlave:
    """The LSS slave of one node, with the present node-ID in *memory*.

    *pending* becomes the node-ID at the next communication reset, *stored* at power-on. *bit_rate* is the present bit
    rate (bit/s), None if frames take no time.
    """

    def __init__(self, memory: Memory, store: ParameterAreas, node_id: int, family: Family = GENERIC) -> None:
        self._memory = memory
        self._store = store
        self._family = family
        self.pending = self.stored = node_id
        self.bit_rate: int | None = None
        #: the accepted bit rates (bit/s), and the bit rate after power-on
        self.known_rates: Collection[int] = ()
        self.stored_rate: int | None = None
        #: faults: it keeps its bit rate after accepting another; it is lost after the activation
        self.keeps_rate = self.loses_rate = False
        #: for how long the node neither hears nor sends from now on, in ms; whoever obeys sets it back to 0
        self.quiet_ms = 0
        #: true if the node has just left the configuration state with its first node-ID
        self.woken = False
        #: the configured bit rate, effective after activation
        self._new_rate: int | None = None
        self.reset()

    def run_at(self, bit_rate: int | None, known_rates: Collection[int] | None = ()) -> None:
        """Run at *bit_rate* (bit/s) from now on, and after power-on.

        *known_rates* are the bit rates accepted over LSS; None: those of the standard's table.
        """
        self.bit_rate = self.stored_rate = bit_rate
        self.known_rates = tuple(BIT_RATES.values()) if known_rates is None else known_rates

    def reset(self, *, communication_only: bool = True) -> None:
        """Activate the pending node-ID, or the stored node-ID after a node reset.

        After a node reset, and at power-on, the stored bit rate applies.
        """
        if not communication_only:
            self.pending, self.bit_rate = self.stored, self.stored_rate
        self._new_rate = None
        self._memory.take_node_id(self.pending)
        self._configuring = self.woken = False
        #: the number of matching address parts so far, and the current part of a fast scan
        self._matched = self._scanned = 0

    def handle(self, request: bytes) -> bytes | None:
        """The answer to *request*; None for no answer."""
        if len(request) != 8:
            return None
        service, number = request[0], int.from_bytes(request[1:5], "little")
        if service == SWITCH_GLOBAL:
            self._switch(request[1])
        elif self._configuring and self._family.lss_echo and service in (FAST_SCAN, SELECT[-1]):
            return _frame(IDENTIFIED if service == FAST_SCAN else SELECTED)
        elif service in SELECT:
            return self._select(service - SELECT[0], number)
        elif service in IDENTIFY:
            return self._identify(service - IDENTIFY[0], number)
        elif service == IDENTIFY_UNCONFIGURED:
            return _frame(IDENTIFIED_UNCONFIGURED) if self._unconfigured else None
        elif service == FAST_SCAN:
            return self._scan(number, *request[5:8])
        elif self._configuring:
            return self._configure(request)
        return None

    @property
    def _unconfigured(self) -> bool:
        return self._memory.node_id == self.pending == UNCONFIGURED

    def _part(self, part: int) -> int:
        """A part of the LSS address, 0..3: vendor, product, revision, serial number."""
        return self._memory.number(IDENTITY, part + 1)

    def _switch(self, mode: int) -> None:
        if mode > 1:
            return
        left, self._configuring = self._configuring and not mode, mode == 1
        self._matched = self._scanned = 0
        waits = self._memory.node_id == UNCONFIGURED != self.pending
        self.woken = left and waits and self._family.lss_wakes

    def _select(self, part: int, number: int) -> bytes | None:
        """Take one of the four frames of *switch state selective*; a node with the whole address is selected."""
        fits = not self._configuring and part == (self._matched if part else 0) and number == self._part(part)
        self._matched = part + 1 if fits else 0
        if self._matched <= 3:
            return None
        self._configuring, self._matched = True, 0
        return _frame(SELECTED)

    def _identify(self, step: int, number: int) -> bytes | None:
        """Take one of the six frames of *identify remote slave*; a node within the ranges answers the last."""
        own = self._part(_IDENTIFY_PARTS[step])
        fits = (own == number, own == number, own >= number, own <= number, own >= number, own <= number)[step]
        self._matched = step + 1 if fits and step == (self._matched if step else 0) else 0
        if self._matched < len(IDENTIFY):
            return None
        self._matched = 0
        return _frame(IDENTIFIED)

    def _scan(self, number: int, bit: int, part: int, following: int) -> bytes | None:
        """Answer a fast scan request: does *part* equal *number* from bit *bit* upwards?"""
        if not self._unconfigured or self._configuring:
            return None
        if bit == _SCAN_RESET:
            self._scanned = 0
            return _frame(IDENTIFIED)
        known = bit <= 31 and part <= 3 and following <= 3 and part == self._scanned
        if not known or self._part(part) >> bit != number >> bit:
            return None
        self._scanned = following
        self._configuring = bit == 0 and following < part
        return _frame(IDENTIFIED)

    def _configure(self, request: bytes) -> bytes | None:
        """Carry out a service of the configuration state."""
        service = request[0]
        if service in INQUIRE:
            return _frame(service, self._part(service - INQUIRE[0]).to_bytes(4, "little"))
        if service == INQUIRE_NODE_ID:
            told = self.pending if self._family.lss_tells_pending else self._memory.node_id
            return _frame(service, bytes([told]))
        if service == CONFIGURE_NODE_ID:
            return _frame(service, bytes([self._take_node_id(request[1])]))
        if service == CONFIGURE_BIT_TIMING:
            return _frame(service, bytes([self._take_bit_timing(*request[1:3])]))
        if service == STORE_CONFIGURATION:
            return _frame(service, bytes([self._keep()]))
        if service == ACTIVATE_BIT_TIMING and self._new_rate is not None:
            self._activate(2 * int.from_bytes(request[1:3], "little"))
        return None

    def _take_node_id(self, node_id: int) -> int:
        if not (1 <= node_id <= 127 or node_id == UNCONFIGURED):
            return NOT_SUPPORTED
        self.pending = node_id
        return 0

    def _take_bit_timing(self, table: int, entry: int) -> int:
        rate = BIT_RATES.get(entry)
        if table or rate is None or rate not in self.known_rates:
            return NOT_SUPPORTED
        self._new_rate = rate
        return 0

    def _activate(self, quiet_ms: int) -> None:
        """Switch the bit rate within the first half of *quiet_ms*, and send nothing before its end."""
        self.quiet_ms = quiet_ms
        if self.loses_rate:
            self.bit_rate = LOST_RATE
        elif not self.keeps_rate:
            self.bit_rate = self._new_rate

    def _keep(self) -> int:
        if self._store.fails:
            return MEDIUM_FAILED
        if self._store.stores_nothing:
            return 0
        self.stored = self.pending
        self.stored_rate = self.bit_rate if self._new_rate is None else self._new_rate
        self._memory.stored_changes += 1
        return 0


def _frame(service: int, data: bytes = b"") -> bytes:
    return (bytes([service]) + data).ljust(8, b"\0")
