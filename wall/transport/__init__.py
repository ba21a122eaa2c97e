"""How bytes travel: in one process (loopback) or between processes (ZeroMQ, shared memory), behind one interface."""
