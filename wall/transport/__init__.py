"""How bytes travel: in one process (loopback) or between processes (ZeroMQ), behind one interface."""
