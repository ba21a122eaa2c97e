"""What a running wall does when one of its processes dies, freezes or slows down: `wall measure faults`."""
