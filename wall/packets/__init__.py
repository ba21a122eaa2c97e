"""The wire format: bytes to values and back, no I/O. Specified in docs/guide/packet_format.md."""
