"""The strict device itself, without I/O: bytes and times in, frames out."""
