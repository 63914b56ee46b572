"""Convert a file of gateway lines (CiA 309-3) to commands, whose writes go through a plan like `write`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.gateway_requests import REQUIRED, Nmt, Order, Read, Write, parse_request
from dvtcli.domain.gateway_words import HEX, TYPES, GatewayRequestError
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.domain.gateway_requests import Command, Request

#: the beginning of a comment that is executed
_MARK = "#!"
_NUMBERED = ("bool", "u", "i", "r")
#: the only network number
_NET = 1


class GatewayScript:
    """Converts the lines of a file in order; `set node` and `set sdo_timeout` apply to the following lines."""

    def __init__(self) -> None:
        self._node: int | None = None
        self._options: list[str] = []

    def words(self, line: str, place: str) -> list[str]:
        """Return the command of *line* at *place*, empty for none. Raises UsageError if there is no equivalent.

        A comment `#! require` is a command, so that a plan's requirements apply wherever its lines run.
        """
        bare = line.strip()
        if bare.startswith(REQUIRED):
            return bare.removeprefix(_MARK).split()
        if bare.startswith(_MARK) and not bare.startswith(f"{_MARK}/"):  # `#!/…` names an interpreter
            raise UsageError(
                f"{place}: a line that begins with `{_MARK}` is a check, but this check is unknown",
                place=place,
                hint=f"write `{REQUIRED}4:identity …` or `{REQUIRED}4:power-off`; a comment begins with `# `",
            )
        try:
            request = parse_request(line)
        except GatewayRequestError as wrong:
            raise UsageError(f"{place}: {wrong}", place=place, hint="CiA 309-3: [1] 4 w 0x1800 2 u8 255") from wrong
        if request is None:
            return []
        if request.net not in (None, _NET):
            raise UsageError(f"{place}: unknown net {request.net}; the bus is net {_NET}", place=place)
        return self._meant(request, place)

    def _meant(self, request: Request, place: str) -> list[str]:
        node = self._node if request.node is None else request.node
        command = request.command
        match command:
            case Read():
                return ["read", _object(node, command), *_type(command.data_type), *self._options]
            case Write():
                return ["write", _object(node, command), *_value(command), *self._options]
            case Nmt(nmt):
                target = [] if node is None else ["all" if node == 0 else str(node)]
                return ["nmt", nmt.word, *target]
        return self._set(command, place)

    def _set(self, command: Command, place: str) -> list[str]:
        """Apply a `set` to the following lines."""
        match command:
            case Order("set node", (node_id,)):
                self._node = node_id
                return []
            case Order("set sdo_timeout", (milliseconds,)):
                self._options = ["--timeout", f"{milliseconds / 1000:g}"]
                return []
            case Order("set network", (1,)):
                return []
        name = f"`{command.name}`" if isinstance(command, Order) else "a PDO of the gateway itself"
        raise UsageError(
            f"{place}: {name} is for a gateway, not for a file of lines",
            place=place,
            hint="run takes r, w, start, stop, preop, reset, set node and set sdo_timeout",
        )


def _object(node: int | None, command: Read | Write) -> str:
    where = "" if node is None else f"{node}:"
    return f"{where}{command.index:04X}:{command.sub_index:02X}"


def _type(name: str | None) -> list[str]:
    return [] if name is None else ["--as", TYPES[name].short]


def _value(command: Write) -> list[str]:
    """Return value and type for `write`: numbers and texts as such, all else as bytes."""
    kind = TYPES[command.data_type]
    if command.data_type != HEX and kind.short.startswith(_NUMBERED) and kind.short != "us":
        value = kind.decode(command.data)
        return [str(int(value) if isinstance(value, bool) else value), "--as", kind.short]
    if kind.short == "vs":
        text = command.data.decode("ascii")
        return [f"@{text}" if text.startswith("@") else text, "--as", "vs"]
    return [command.data.hex(), "--as", "os"]
