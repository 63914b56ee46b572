"""The exception for an SDO abort of a simulated device."""

from __future__ import annotations


class Refusal(Exception):
    """The device aborts an SDO request with *code*; *reason* is the value of its extended error object."""

    def __init__(self, code: int, reason: int | None = None) -> None:
        super().__init__(f"0x{code:08X}")
        self.code = int(code)
        self.reason = reason
