"""What is wrong with a simulated device all the time: its memory, its flash, its bit rate, how it obeys NMT.

Does not know faults that happen at one transfer (`faulty`).
"""

from __future__ import annotations

from dvtcli.simulator.device.fault_kinds import FaultKind
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice


def break_device(device: StrictDevice, fault: Fault) -> None:
    """Let *device* have *fault* from now on; ValueError where it lacks what would fail."""
    if fault.kind.of_bit_rate:
        _mistime(device, fault)
    elif fault.kind is FaultKind.IGNORES_NMT:
        device.ignores_nmt = True
    elif fault.kind.of_flash:
        _break_flash(device, fault.kind)
    else:
        _break_memory(device, fault.kind)


def _mistime(device: StrictDevice, fault: Fault) -> None:
    """What is wrong with the device's bit rate."""
    lss = device.lss
    match fault.kind:
        case FaultKind.BIT_RATE:
            lss.run_at(fault.code, lss.known_rates)
        case FaultKind.NO_BIT_TIMING:
            lss.known_rates = ()
        case FaultKind.KEEPS_BIT_RATE:
            lss.keeps_rate = True
        case FaultKind.LOSES_BIT_RATE:
            lss.loses_rate = True


def _break_memory(device: StrictDevice, kind: FaultKind) -> None:
    store = device.areas
    match kind:
        case FaultKind.STORE_FAILS:
            store.fails = True
        case FaultKind.STORES_NOTHING:
            store.stores_nothing = True
        case FaultKind.SAVES_ITSELF:
            store.saves_itself = True
        case FaultKind.KEEPS_RAM:
            store.keeps_ram = True
        case FaultKind.RESTORES_NOTHING:
            store.restores_nothing = True


def _break_flash(device: StrictDevice, kind: FaultKind) -> None:
    loader = device.loader
    if loader is None:
        raise ValueError(f"{kind}: the node has no boot loader: no program can be downloaded")
    loader.fails, loader.alters = kind is FaultKind.FLASH_FAILS, kind is FaultKind.FLASH_ALTERS
