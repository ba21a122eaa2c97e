"""The compact body of sample packets: samples sorted by place, told by their differences. See docs/packet_format.md."""
