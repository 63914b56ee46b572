"""What users type at each family, line by line: the sequences of the fault matrix, and the states they start in."""

from __future__ import annotations

from dataclasses import dataclass

FAMILIES = ("generic", "gen4", "espac", "tmcm", "roboteq")


@dataclass(frozen=True)
class Start:
    """How a device is found: its NMT state, and whether its RAM differs from what is stored."""

    operational: bool
    modified: bool

    def __str__(self) -> str:
        return f"{'op' if self.operational else 'preop'}{'-modified' if self.modified else ''}"

    @classmethod
    def named(cls, text: str) -> Start:
        return next(start for start in STARTS if str(start) == text)


STARTS = (Start(True, True), Start(False, True), Start(True, False), Start(False, False))

_GENERIC = {
    "map-tpdo": ["map tpdo1 6401:1 606C 6041 --cob-id 0x1A1 --sync 1"],
    "map-rpdo": ["map rpdo2 60FF 6040 --cob-id 0x3B1 --event"],
    "set": ["set tpdo2 --cob-id 0x1B2 --type 254 --inhibit 10 --timer 100"],
    "set-live": ["set tpdo1 --timer 250"],
    "enable": ["enable tpdo3 rpdo3"],
    "disable": ["disable tpdo1 rpdo1"],
    "clear": ["clear tpdo1 tpdo2 rpdo1"],
    "undo": ["set tpdo1 --timer 12", "clear rpdo2", "undo --all"],
    "write": ["write 1006 20000", "write 1800:5 99"],
    "script": [
        "map tpdo1 6401:1 606C 6041 --cob-id 0x1A1 --sync 1",
        "map rpdo1 6040 60FF --cob-id 0x2B1",
        "set tpdo2 --type 10 --timer 0",
        "enable tpdo3",
    ],
    "restore": ["restore --prove"],
    "store": ["map tpdo1 6064 6061", "store"],
}

_MOTOR = {
    "map-tpdo": ["map tpdo1 6C01:1 606C 6041 --cob-id 0x1A1 --sync 1"],
    "map-rpdo": ["map rpdo2 60FF 6040 --cob-id 0x3B1"],
    "set": ["set tpdo2 --cob-id 0x1B2 --type 254 --inhibit 20 --timer 100"],
    "set-live": ["set tpdo1 --timer 250"],
    "enable": ["enable tpdo4 rpdo1"],
    "disable": ["disable tpdo1 rpdo2"],
    "clear": ["clear tpdo1 tpdo2 rpdo2"],
    "undo": ["set tpdo1 --timer 12", "clear rpdo2", "undo --all"],
    "script": [
        "map tpdo1 6C01:1 606C 6041 --cob-id 0x1A1 --sync 1",
        "map tpdo3 5100:1 5100:4 --timer 500",
        "set tpdo2 --type 10 --timer 0",
        "map rpdo1 6040 60FF",
    ],
    "restore": ["restore --prove"],
    "store": ["map tpdo1 606C 6077", "store"],
}

_STEPPER = {
    "map-tpdo": ["map tpdo1 6041 6061 2702 --cob-id 0x1A1 --sync 1"],
    "map-rpdo": ["map rpdo3 607A 2703:1 --cob-id 0x3B1"],
    "set": ["set tpdo2 --cob-id 0x1B2 --inhibit 10 --timer 100"],
    "set-live": ["set tpdo1 --timer 250"],
    "disable": ["disable tpdo1 rpdo1"],
    "clear": ["clear tpdo1 tpdo2 rpdo1"],
    "undo": ["set tpdo1 --timer 12", "clear rpdo2", "undo --all"],
    "enable": ["disable tpdo3 rpdo3", "enable tpdo3 rpdo3"],
    "script": [
        "map tpdo1 6041 6061 2702 --cob-id 0x1A1 --sync 1",
        "map rpdo3 607A 2703:1 --cob-id 0x3B1",
        "set tpdo2 --inhibit 10 --timer 50",
    ],
    "restore": ["restore --prove"],
    "store": ["map tpdo1 6064 6061", "store"],
}

_WITHOUT_STORE = {
    "map-tpdo": ["map tpdo1 2106:5 2100:1 2100:2 --cob-id 0x1A1 --sync 1"],
    "map-rpdo": ["map rpdo1 2005:1 2005:2 --cob-id 0x2B1"],
    "set": ["set tpdo1 --cob-id 0x1B2 --type 254 --inhibit 10 --timer 100"],
    "set-live": ["set tpdo1 --timer 250"],
    "enable": ["enable tpdo2 rpdo2"],
    "disable": ["disable tpdo1 rpdo3"],
    "clear": ["clear tpdo1 rpdo3 rpdo4"],
    "undo": ["set tpdo1 --timer 12", "clear rpdo3", "undo --all"],
    "script": [
        "map tpdo1 2106:5 2100:1 2100:2 --cob-id 0x1A1 --sync 1",
        "map tpdo2 2106:6 2106:8",
        "map rpdo1 2005:1 2005:2 --cob-id 0x2B1",
        "set tpdo1 --timer 0 --inhibit 5",
    ],
}

SEQUENCES: dict[str, dict[str, list[str]]] = {
    "generic": _GENERIC,
    "gen4": _MOTOR,
    "espac": _MOTOR,
    "tmcm": _STEPPER,
    "roboteq": _WITHOUT_STORE,
    "gen4-master": {name: _MOTOR[name] for name in ("map-tpdo", "set", "clear")},
}
#: nodes that rule the network themselves: their NMT state is an object, written by downloads that count as steps
MASTERS = ("gen4-master",)

#: what goes wrong at step k, by name; `{k}`, `{k1}` and `{k2}` are that step and the two after it
TRANSIENT: dict[str, tuple[str, ...]] = {
    "refuse": ("refuse@{k}=0x06040041",),
    "refuse-state": ("refuse@{k}=0x08000022",),
    "refuse-local": ("refuse@{k}=0x08000021",),
    "lose-request": ("lose-request@{k}",),
    "lose-response": ("lose-response@{k}",),
    "late-0.3s": ("late@{k}=0.3",),
    "late-0.7s": ("late@{k}=0.7",),
    "late-3s": ("late@{k}=3",),
    "duplicate": ("duplicate@{k}",),
    "foreign": ("foreign@{k}",),
    "malformed": ("malformed@{k}",),
    "toggle": ("toggle@{k}",),
    "reset-0.05s": ("reset@{k}=0.05",),
    "reset-0.6s": ("reset@{k}=0.6",),
    "reset-3s": ("reset@{k}=3",),
    "refuse+refuse": ("refuse@{k}=0x06040041", "refuse@{k1}=0x08000000"),
    "refuse+lost": ("refuse@{k}=0x06040041", "lose-response@{k2}"),
    "lost+reset": ("lose-response@{k}", "reset@{k1}=0.4"),
    "refuse+reset": ("refuse@{k}=0x06040041", "reset@{k1}=0.4"),
    "late+lost": ("late@{k}=0.7", "lose-request@{k1}"),
}
LASTING: dict[str, tuple[str, ...]] = {
    "silent": ("silent@{k}",),
    "power-loss": ("silent@{k}",),
    "bus-error": ("bus-error@{k}",),
    "refuse+silent": ("refuse@{k}=0x06040041", "silent@{k2}"),
    "lost+bus-error": ("lose-response@{k}", "bus-error@{k1}"),
}
#: a restart of which nobody hears anything
UNHEARD = "reset-at-read-without-boot-up"
#: what goes wrong at the k-th answer to a read-back: `{k}` counts the uploads since the last download
AT_READ: dict[str, tuple[str, ...]] = {
    "reset-after-read-0.05s": ("reset-after-read@{k}=0.05",),
    "reset-after-read-0.6s": ("reset-after-read@{k}=0.6",),
    "reset-at-read-0.05s": ("reset-at-read@{k}=0.05",),
    "reset-at-read-0.6s": ("reset-at-read@{k}=0.6",),
    UNHEARD: ("reset-at-read@{k}=0.05", "no-boot-up"),
}
FAULTS = {**TRANSIENT, **LASTING, **AT_READ}
