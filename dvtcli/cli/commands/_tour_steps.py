"""The steps of the tour: what is explained, the line that shows it, and the exit code it ends with. Data only."""

from __future__ import annotations

from typing import NamedTuple


class TourStep(NamedTuple):
    """One step; *code* is 1 where the line shows a refusal."""

    text: str
    line: str
    code: int = 0


STEPS = (
    TourStep("A PDO is a CAN frame that a node sends (TPDO) or takes (RPDO) by itself.\nThis node has some:", "pdo"),
    TourStep("What could a TPDO carry? The object dictionary says it:", "objects velocity --mappable tpdo"),
    TourStep(
        "Map two objects into TPDO1, to be sent on every SYNC. dvtcli checks the\n"
        "whole plan first, then disables the PDO, writes, enables it, and reads back:",
        "map tpdo1 statusword velocity_actual_value --sync 1",
    ),
    TourStep("This is the frame now, byte by byte:", "pdo tpdo1"),
    TourStep(
        "What cannot work never reaches the node. The vendor-ID is not mappable, and\n"
        "the error says so, with what the device would have answered:",
        "map tpdo1 6041 1018:1",
        1,
    ),
    TourStep("--dry-run tries a line on an exact twin of the node; nothing is written:", "clear tpdo2 --dry-run"),
    TourStep("Start the node and send a SYNC, and the frame comes:", "verify tpdo1 --frame --yes"),
    TourStep("So far it is in the node's RAM. Let it survive a reset, and prove that:", "store --prove"),
    TourStep("Put back what the last change replaced:", "undo"),
)
