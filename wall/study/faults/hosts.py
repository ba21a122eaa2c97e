"""Hosts made of namespaces of this machine: each has a network, a name, a clock and an identity of its own.

They hang on one switch, as hosts of a cluster do, and need no rights but that to make a namespace of users. All of it
ends with the process that made it, whatever ends that: each namespace is held by a process that reads from it.
Processes have the numbers that they have on this machine, so that they can be watched, stopped and ended from here.
"""

from __future__ import annotations

import contextlib
import os
import select
import shlex
import shutil
import socket
import stat
import subprocess
import sys
import uuid
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import urlsplit

from wall.core.errors import RunError
from wall.study.speed.runs import mpirun

NETWORK = "10.77.0"
BEGINS_S = 5.0  # for a command that makes a part of this
CLOCK_S = 1000.0  # by which each host's monotonic clock is ahead of that of the one before
BURST, QUEUE_MS = "16kb", 200  # of a slow link: what may go at once, and how long a packet waits before it is dropped
RANK = b"OMPI_COMM_WORLD_RANK="
HOLD = "echo $$; exec cat >/dev/null"  # tells its process number, and ends with the one that made it


class Hosts:
    """Hosts h1, h2, ..., the first of which is the head's; `close` them."""

    def __init__(self, count: int, folder: Path) -> None:
        """`folder`: for files that hosts see. Raises RunError where this machine lets nobody make them."""
        self.names = tuple(f"h{number}" for number in range(1, count + 1))
        self._folder, self._held = folder, list[subprocess.Popen[str]]()
        self._holders = set[int]()
        self._relays: list[subprocess.Popen[bytes]] = []
        self._links = dict[str, subprocess.Popen[bytes]]()  # by host
        try:
            self._make()
        except BaseException:
            self.close()
            raise

    def _make(self) -> None:
        if missing := [name for name in ("unshare", "nsenter", "ip", "tc") if shutil.which(name) is None]:
            raise RunError(f"hosts of namespaces: {' and '.join(missing)} not found; wanted: util-linux and iproute2")
        folder, known = self._folder, self._folder / "hosts"
        folder.mkdir(parents=True, exist_ok=True)
        lines = (f"{NETWORK}.{number} {name}\n" for number, name in enumerate(self.names, start=1))
        known.write_text("127.0.0.1 localhost\n" + "".join(lines), encoding="utf-8")
        self._switch = self._hold(["unshare", "-U", "-r", "-n"])
        self._in_switch(
            "ip link set lo up && ip link add wall type bridge && ip link set wall up && "
            f"ip addr add {NETWORK}.254/24 dev wall"
        )
        self._processes: dict[str, int] = {}
        inside = self.beside("unshare", "-n", "-u", "-m", "-T", "-f")
        for number, name in enumerate(self.names, start=1):
            (folder / f"{name}.machine").write_text(f"{uuid.uuid4()}\n", encoding="utf-8")
            self._processes[name] = pid = self._hold([*inside, f"--monotonic={number * CLOCK_S:.0f}"])
            self._in_switch(
                f"ip link add {name} type veth peer name eth0 netns {pid} && ip link set {name} master wall up"
            )
            self.run(
                name,
                f"ip link set lo up && ip addr add {NETWORK}.{number}/24 dev eth0 && ip link set eth0 up && "
                f"hostname {name} && mount -t tmpfs none /dev/shm && "
                f"mount --bind {shlex.quote(str(known.resolve()))} /etc/hosts && "
                f"mount --bind {shlex.quote(str((folder / f'{name}.machine').resolve()))} "
                "/proc/sys/kernel/random/boot_id",
            )
        self._holders |= {pid for name in self.names for pid in self.processes(name)}
        self._agent = folder / "agent"  # what mpirun calls in place of ssh
        each = "".join(f"{name}) process={pid};;\n" for name, pid in self._processes.items())
        enter = 'exec nsenter -t $process -n -u -m -T sh -c "$*"'
        text = f"#!/bin/sh\nhost=$1; shift\ncase $host in\n{each}esac\n{enter}\n"
        self._agent.write_text(text, encoding="utf-8")
        self._agent.chmod(self._agent.stat().st_mode | stat.S_IXUSR)

    def _hold(self, inside: Sequence[str]) -> int:
        """The number of a process that holds a namespace until this one ends."""
        process = subprocess.Popen(
            [*inside, "sh", "-c", HOLD], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True,
        )  # fmt: skip
        self._held.append(process)
        assert process.stdout is not None
        if not (said := process.stdout.readline()):
            raise RunError(f"hosts of namespaces: {shlex.join(inside)}: {process.communicate()[1].strip()}")
        return int(said)

    def _entered(self, pid: int, *namespaces: str) -> list[str]:
        return ["nsenter", "-t", str(pid), *namespaces, "--preserve-credentials"]

    def _in_switch(self, script: str) -> None:
        self._run(self.beside("sh", "-c", script), script)

    def run(self, host: str, script: str) -> None:
        """Run shell commands on a host. Raises RunError where one fails."""
        self._run(self.at(host, "sh", "-c", script), f"{host}: {script}")

    def _run(self, command: Sequence[str], what: str) -> None:
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=BEGINS_S)
        except subprocess.TimeoutExpired:
            raise RunError(f"hosts of namespaces: {what}: did not end within {BEGINS_S:g} s") from None
        if done.returncode:
            raise RunError(f"hosts of namespaces: {what}: {done.stderr.strip() or done.returncode}")

    def at(self, host: str, *command: str) -> list[str]:
        """A command that runs on a host."""
        return [*self._entered(self._processes[host], "-U", "-n", "-u", "-m", "-T"), *command]

    def beside(self, *command: str) -> list[str]:
        """A command that runs on the network of the hosts, but on none of them."""
        return [*self._entered(self._switch, "-U", "-n"), *command]

    @property
    def addresses(self) -> list[str]:
        """Those of the hosts, in their order."""
        return [f"{NETWORK}.{number}" for number in range(1, len(self.names) + 1)]

    def mpirun(self, ranks: int, *options: str) -> list[str]:
        """A launcher of a run, the head alone on its host, by mpirun of Open MPI 5. Raises RunError without one."""
        if (program := mpirun()) is None:
            raise RunError("mpirun is missing: install the extra `local`")
        others = max(1, len(self.names) - 1)
        counts = [1, *((ranks - 1 + k) // others for k in reversed(range(others)))]
        if len(self.names) == 1:
            counts = [ranks]
        slots = ",".join(f"{name}:{count}" for name, count in zip(self.names, counts, strict=True) if count)
        own = ("--prtemca", "plm_ssh_agent", str(self._agent), "--host", slots, "--bind-to", "none")
        return self.at(self.names[0], program, *own, *options, "-n", str(ranks))

    def cut(self, host: str) -> None:
        """Pull out a host's cable."""
        self._in_switch(f"ip link set {host} down")

    def join(self, host: str) -> None:
        """Plug it in again."""
        self._in_switch(f"ip link set {host} up")

    def slow(self, host: str, bits_per_s: int) -> None:
        """Let a host send no more than so much: what waits for longer than QUEUE_MS is dropped."""
        self.run(host, f"tc qdisc replace dev eth0 root tbf rate {bits_per_s} burst {BURST} latency {QUEUE_MS}ms")

    def speed_up(self, host: str) -> None:
        """Let it send as fast as it can again."""
        self.run(host, "tc qdisc del dev eth0 root")

    def degrade(self, host: str, *, loss: float, delay_s: float) -> None:
        """Let that share of the packets from and to a host be lost, and the others come so many seconds later."""
        near, far = f"{host}-near", f"{host}-far"
        program = [sys.executable, "-m", "wall.study.faults.lossy_link", near, far, f"{loss:g}", f"{delay_s:g}"]
        link = subprocess.Popen(self.beside(*program), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
        self._links[host] = link
        assert link.stdout is not None
        if not select.select([link.stdout], [], [], BEGINS_S)[0] or not link.stdout.readline():
            raise RunError(f"hosts of namespaces: {host}: its link cannot lose packets; wanted: /dev/net/tun")
        self._in_switch(
            f"ip link add {host}-wall type bridge && ip link set {host}-wall up && "
            f"ip link set {near} master {host}-wall up && ip link set {far} master wall up && "
            f"ip link set {host} master {host}-wall"
        )

    def repair(self, host: str) -> None:
        """Let all packets through again."""
        self._in_switch(f"ip link set {host} master wall && ip link del {host}-wall")
        self._end_link(self._links.pop(host))

    @staticmethod
    def _end_link(link: subprocess.Popen[bytes]) -> None:
        link.kill()
        link.communicate()

    def processes(self, host: str) -> list[int]:
        """All that run on a host for others than this."""
        network, found = os.readlink(f"/proc/{self._processes[host]}/ns/net"), list[int]()
        for entry in Path("/proc").iterdir():
            with contextlib.suppress(OSError):
                if entry.name.isdecimal() and os.readlink(entry / "ns/net") == network:
                    found.append(int(entry.name))
        return sorted(set(found) - self._holders - {relay.pid for relay in self._relays})

    @property
    def ahead_s(self) -> float:
        """By how much the first host's monotonic clock is ahead of this machine's."""
        return CLOCK_S

    def of(self, rank: int) -> str:
        """The host of a rank."""
        pid = self.ranks()[rank]
        return next(name for name in self.names if pid in self.processes(name))

    def ranks(self) -> dict[int, int]:
        """Processes by the ranks that MPI has given them."""
        found = dict[int, int]()
        for pid in (pid for host in self.names for pid in self.processes(host)):
            with contextlib.suppress(OSError):
                variables = Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
                found |= {int(each[len(RANK) :]): pid for each in variables if each.startswith(RANK)}
        return dict(sorted(found.items()))

    def reached(self, host: str, port: int) -> int:
        """A port of this machine that leads to one of a host's loopback, such as that of a page."""
        with socket.create_server(("127.0.0.1", 0)) as listening:
            program = [sys.executable, "-m", "wall.study.faults.relay", str(listening.fileno()), str(port)]
            self._relays.append(subprocess.Popen(self.at(host, *program), pass_fds=(listening.fileno(),)))
            return int(listening.getsockname()[1])

    def page(self, address: str) -> str:
        """Where a page of the first host is found from here."""
        parts = urlsplit(address)
        assert parts.port is not None
        return parts._replace(netloc=f"127.0.0.1:{self.reached(self.names[0], parts.port)}").geturl()

    def close(self) -> None:
        """End everything on them, and them."""
        for relay in self._relays:
            relay.kill()
            relay.wait()
        for link in self._links.values():
            self._end_link(link)
        for process in reversed(self._held):
            process.kill()
            process.communicate()
