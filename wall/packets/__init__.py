"""The wire format: bytes to values and back, no I/O. Specified in docs/packet_format.md."""
