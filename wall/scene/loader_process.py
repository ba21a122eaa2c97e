"""Models and data from files, read by a process of their own: their parsers are others' code, and get limits.

`python -m wall.scene.loader_process DESCRIPTOR PARENT` is that process. It imports what reads the files, which others
then do without, and ends when all are read.
"""

from __future__ import annotations

import fcntl
import os
import pickle
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from wall.core.errors import SceneError
from wall.core.system import available_bytes, die_with, own_module

if TYPE_CHECKING:
    from wall.config.scene import Up
    from wall.scene.model import Source

MODEL_SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")
LEAST_S, S_PER_MB = 60.0, 2.0  # of processor time: ten times what a mesh of 328,000 triangles takes in these formats
MOST_TIMES = 20.0  # as long, until a process that gets no core is given up
END_S = 2.0  # for a process that has closed its end
LEAST_BYTES = 1 << 28  # of memory, however little is left
REMEDY = "wanted: fewer triangles, or fewer and smaller textures"


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A file that is to be read, by which function, and how much that may take."""

    path: Path
    reader: tuple[str, str]  # module and name
    arguments: tuple[Any, ...]
    options: dict[str, Any] = field(default_factory=dict)
    seconds: float  # of processor time
    memory: int | None  # bytes; None: what is left is not told


def load_models(paths: Sequence[Path], up: Up = "auto", *, textures_given: bool = False) -> list[Source]:
    """Read model files, see loading.load. Raises SceneError, also for one that takes too long or too much memory."""
    reader, options = ("wall.scene.loading", "load"), {"textures_given": textures_given}
    return load_apart([load_request(path, reader, path, up, **options) for path in paths])


def load_request(path: Path, reader: tuple[str, str], *arguments: Any, **options: Any) -> Request:
    """A request for a file with the usual limits. `reader`: module and name of a function of these arguments."""
    memory = available_bytes()
    return Request(
        path=path, reader=reader, arguments=arguments, options=options, seconds=seconds_for(path),
        memory=None if memory is None else max(LEAST_BYTES, memory),
    )  # fmt: skip


def seconds_for(path: Path) -> float:
    """The processor time that reading a file may take; of a .gltf, its buffers stand beside it."""
    try:
        files = path.parent.iterdir() if path.suffix.lower() == ".gltf" else [path]
        return LEAST_S + S_PER_MB * sum(file.stat().st_size for file in files if file.is_file()) / 1e6
    except OSError:  # which who reads it says in its own words
        return LEAST_S


def load_apart(requests: Sequence[Request]) -> list[Any]:
    """Read them one after the other in one process. Returns what their readers do. Raises SceneError, as these do."""
    if not requests:
        return []
    command, environment = own_module(__name__)
    reader, writer = (_above_standard(end) for end in os.pipe())
    with open(reader, "rb") as results:
        try:
            process = subprocess.Popen(
                [*command, str(writer), str(os.getpid())], env=environment, pass_fds=(writer,),
                stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, process_group=0,  # Ctrl-C is for those who end it
            )  # fmt: skip
        except OSError as error:
            raise SceneError(f"{requests[0].path}: what reads files cannot be started: {error}") from error
        finally:
            os.close(writer)
        patience = MOST_TIMES * sum(each.seconds for each in requests)
        limit = threading.Timer(patience, process.kill)
        limit.daemon = True
        limit.start()
        try:
            return _received(process, requests, results)
        finally:
            limit.cancel()
            limit.join()  # who forks next has no thread
            process.kill()
            process.wait()


def _above_standard(descriptor: int) -> int:
    """The same pipe under a number that is none of a standard stream's, which may be closed."""
    above = fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, 3)
    os.close(descriptor)
    return above


def _received(process: subprocess.Popen[bytes], requests: Sequence[Request], results: BinaryIO) -> list[Any]:
    found: list[Any] = []
    assert process.stdin is not None
    began = time.monotonic()
    try:
        with process.stdin:
            pickle.dump(requests, process.stdin)
        for _ in requests:
            result = pickle.load(results)
            if isinstance(result, str):
                raise SceneError(result)
            found.append(result)
    except (OSError, EOFError, pickle.UnpicklingError) as error:
        raise SceneError(_why(process, requests[len(found)], time.monotonic() - began)) from error
    return found


def _why(process: subprocess.Popen[bytes], request: Request, seconds: float) -> str:
    """What ended the process while it read a file, after so long in all."""
    with suppress(subprocess.TimeoutExpired):
        process.wait(END_S)
    process.kill()
    code = process.wait()
    if code == -signal.SIGXCPU:
        return f"{request.path}: reading it takes more than {request.seconds:.0f} s of processor time; {REMEDY}"
    how = f"signal {-code}, {signal.strsignal(-code)}" if code < 0 else f"exit code {code}"
    return f"{request.path}: cannot be read; what reads it ended with {how} after {seconds:.0f} s"


def main(descriptor: int, parent: int) -> None:
    """Be the process that reads."""
    die_with(parent)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    requests: list[Request] = pickle.load(sys.stdin.buffer)
    with open(descriptor, "wb") as results:
        for request in requests:
            module, name = request.reader
            reader = getattr(import_module(module), name)
            _limit(resource.RLIMIT_CPU, round(time.process_time() + request.seconds))
            if request.memory is not None:
                pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
                _limit(resource.RLIMIT_AS, pages * resource.getpagesize() + request.memory)
            try:
                result = reader(*request.arguments, **request.options)
            except SceneError as error:
                result = str(error)
            except MemoryError:
                left = f"{(request.memory or 0) / 1e9:.2f} GB"
                result = f"{request.path}: reading it takes more than the {left} of memory that are left; {REMEDY}"
            try:
                pickle.dump(result, results, protocol=5)
            except MemoryError:
                sys.exit(f"{request.path}: no memory is left to hand it over")
            results.flush()


def _limit(what: int, most: int) -> None:
    hard = resource.getrlimit(what)[1]
    resource.setrlimit(what, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
