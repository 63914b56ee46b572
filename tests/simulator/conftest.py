"""The scripted server of the bus tests, for what stands between a bus and simulated nodes."""

from tests.bus.conftest import channel, serve

__all__ = ["channel", "serve"]
