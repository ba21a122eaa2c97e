"""`python -m wall.study.faults.lossy_link ONE OTHER LOSS DELAY_S`: a link that loses packets and is slow to deliver.

It makes two network devices (TAP, see the kernel's networking/tuntap) and carries frames between them, both ways: each
is lost with a chance of LOSS, else comes DELAY_S later, in order. It is what `tc netem` does where a kernel has it.
"""

from __future__ import annotations

import fcntl
import os
import random
import select
import signal
import struct
import sys
import time
from collections import deque

from wall.core.system import end_with_parent

TUNSETIFF, TAP, WITHOUT_HEADER = 0x400454CA, 0x0002, 0x1000  # linux/if_tun.h
LONGEST_FRAME = 1 << 16
MOST_WAITING = 8192  # frames of both ways; more are lost, as in any queue
SEED = 1


def device(name: str) -> int:
    """The descriptor of a new network device, which goes when it is closed."""
    descriptor = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    fcntl.ioctl(descriptor, TUNSETIFF, struct.pack("16sH14x", name.encode(), TAP | WITHOUT_HEADER))
    return descriptor


def carry(one: int, other: int, *, loss: float, delay_s: float) -> None:
    """Carry frames between two devices for ever."""
    chance = random.Random(SEED)
    to = {one: other, other: one}
    waiting: deque[tuple[float, int, bytes]] = deque()  # in the order of their time
    while True:
        patience = max(0.0, waiting[0][0] - time.monotonic()) if waiting else None
        for came in select.select([one, other], [], [], patience)[0]:
            try:
                frame = os.read(came, LONGEST_FRAME)
            except OSError:  # the device is down
                continue
            if chance.random() >= loss and len(waiting) < MOST_WAITING:
                waiting.append((time.monotonic() + delay_s, to[came], frame))
        while waiting and waiting[0][0] <= time.monotonic():
            _, there, frame = waiting.popleft()
            try:
                os.write(there, frame)
            except OSError:  # the device is down, or full
                continue


if __name__ == "__main__":
    end_with_parent(signal.SIGKILL)
    ends = device(sys.argv[1]), device(sys.argv[2])
    print("ready", flush=True)
    carry(*ends, loss=float(sys.argv[3]), delay_s=float(sys.argv[4]))
