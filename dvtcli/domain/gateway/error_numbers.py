"""The gateway's own error numbers (CiA 309-3, internal error codes). SDO abort codes stand beside them in answers."""

from __future__ import annotations

from enum import IntEnum


class GatewayError(IntEnum):
    """What a gateway answers where it is not the node that refuses."""

    NOT_SUPPORTED = 100
    SYNTAX = 101
    INTERNAL_STATE = 102
    TIME_OUT = 103
    NO_DEFAULT_NET = 104
    NO_DEFAULT_NODE = 105
    UNSUPPORTED_NET = 106
    UNSUPPORTED_NODE = 107
    HEARTBEAT_STARTED = 202
    HEARTBEAT_LOST = 203
    WRONG_NMT_STATE = 204
    PDO_USED = 400
    PDO_LENGTH = 401
    LSS = 501
    LSS_NODE_ID = 502
    LSS_BIT_RATE = 503
    LSS_STORE = 504
    OUT_OF_MEMORY = 600

    @property
    def text(self) -> str:
        """The number's meaning in words."""
        return _TEXTS[self]


_TEXTS = {
    GatewayError.NOT_SUPPORTED: "Request not supported",
    GatewayError.SYNTAX: "Syntax error",
    GatewayError.INTERNAL_STATE: "Request not processed due to internal state",
    GatewayError.TIME_OUT: "Time-out",
    GatewayError.NO_DEFAULT_NET: "No default net set",
    GatewayError.NO_DEFAULT_NODE: "No default node set",
    GatewayError.UNSUPPORTED_NET: "Unsupported net",
    GatewayError.UNSUPPORTED_NODE: "Unsupported node",
    GatewayError.HEARTBEAT_STARTED: "Heartbeat started",
    GatewayError.HEARTBEAT_LOST: "Heartbeat lost",
    GatewayError.WRONG_NMT_STATE: "Wrong NMT state",
    GatewayError.PDO_USED: "PDO already used",
    GatewayError.PDO_LENGTH: "PDO length exceeded",
    GatewayError.LSS: "LSS error",
    GatewayError.LSS_NODE_ID: "LSS node-ID not supported",
    GatewayError.LSS_BIT_RATE: "LSS bit rate not supported",
    GatewayError.LSS_STORE: "LSS parameter storing failed",
    GatewayError.OUT_OF_MEMORY: "Out of memory",
}


class GatewayRequestError(ValueError):
    """A request that is answered with *error*; the text says why, for people."""

    def __init__(self, error: GatewayError, why: str) -> None:
        super().__init__(why)
        self.error = error
