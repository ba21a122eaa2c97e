"""`python -m wall.study.faults.relay DESCRIPTOR PORT`: what comes to a listening socket goes to that port here.

The socket is of another network than the process is in: the only way between a host of namespaces and this machine.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
import sys

CHUNK = 1 << 16


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(OSError):
        while data := await reader.read(CHUNK):
            writer.write(data)
            await writer.drain()
    writer.close()


async def relay(listening: socket.socket, port: int) -> None:
    """Carry bytes both ways until cancelled."""

    async def carry(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            there, out = await asyncio.open_connection("127.0.0.1", port)
        except OSError:
            writer.close()  # nobody listens there
            return
        await asyncio.gather(_copy(reader, out), _copy(there, writer))

    async with await asyncio.start_server(carry, sock=listening) as server:
        await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(relay(socket.socket(fileno=int(sys.argv[1])), int(sys.argv[2])))
