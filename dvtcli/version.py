"""Which dvtcli this is. The lowest brick of the house: everybody may say it."""

__version__ = "0.1.0"
