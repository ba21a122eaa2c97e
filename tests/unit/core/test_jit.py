"""A compiled kernel is found again as long as nothing that it is made of has changed."""

from __future__ import annotations

import ast
import errno
import fcntl
import gc
import os
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from numba.core.event import Event, Listener, install_listener

import wall
from wall.core import jit, kernel_cache
from wall.core.garbage import OBJECTS_A_COLLECTION

PACKAGE = Path(wall.__file__).parent
KERNELS = sorted(PACKAGE.rglob("kernels/*.py"))


def parsed(path: Path) -> set[Path]:
    """The `wall` files that a file imports from, by Python's own parser."""
    found = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "wall":
            for name in (node.module, *(f"{node.module}.{alias.name}" for alias in node.names)):
                found.add(PACKAGE.joinpath(*str(name).split(".")[1:]).with_suffix(".py"))
    return {file for file in found if file.exists()}


@pytest.mark.parametrize("path", KERNELS, ids=lambda path: f"{path.parts[-3]}/{path.stem}")
def test_hash_covers_every_imported_file(path: Path) -> None:
    ahead, found = [path], set[Path]()
    while ahead:
        if (file := ahead.pop()) not in found:
            found.add(file)
            ahead += parsed(file)
    assert found <= kernel_cache._with_imports(path)


def test_imports_are_found_however_they_are_written(tmp_path: Path) -> None:
    source = tmp_path / "source.py"
    source.write_text(
        "from wall.core.data import Rect\n"
        "from wall.geometry import (\n    cameras,  # and a word\n    eyes as both,\n)\n"
        "def late():\n    from wall.scene.needs import needs\n"
    )
    names = {str(file.relative_to(PACKAGE)) for file in kernel_cache._imports(source)}
    assert names == {"core/data.py", "geometry/cameras.py", "geometry/eyes.py", "scene/needs.py"}


def test_an_edit_of_an_imported_file_changes_the_hash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "wall"
    package.mkdir()
    (package / "user.py").write_text("from wall.used import VALUE\n")
    (package / "other.py").write_text("")
    (package / "used.py").write_text("VALUE = 1\n")
    monkeypatch.setattr(kernel_cache, "PACKAGE", package)

    def forget() -> None:
        for known in (kernel_cache._imports, kernel_cache._digest, kernel_cache.source_hash):
            known.cache_clear()

    def fresh() -> list[str]:
        forget()
        return [kernel_cache.source_hash(package / name) for name in ("user.py", "other.py")]

    try:
        before = fresh()
        (package / "used.py").write_text("VALUE = 2\n")
        after = fresh()
    finally:
        forget()
    assert after[0] != before[0]
    assert after[1] == before[1]


class Gone:
    """Stands for a class of arguments that a later version has elsewhere."""


@pytest.mark.usefixtures("compiled_only")
def test_a_cache_that_names_a_class_which_is_gone_is_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    source = tmp_path / "kernel_file.py"
    source.write_text("def twice(x):\n    return 2 * x\n", encoding="utf-8")
    scope: dict[str, Any] = {}
    exec(compile(source.read_text(encoding="utf-8"), str(source), "exec"), scope)
    first = jit.kernel(scope["twice"])
    Path(first._cache.cache_path).mkdir()
    first._cache._cache._cache_file._save_index({Gone: "twice.nbc"})
    monkeypatch.delattr(sys.modules[__name__], "Gone")
    again = jit.kernel(scope["twice"])
    assert again(21) == 42
    assert sum(again.stats.cache_misses.values()) == 1
    third = jit.kernel(scope["twice"])
    monkeypatch.setattr(third.targetctx, "refresh", lambda: pytest.fail("numba's tables are for compiling alone"))
    assert third(21) == 42
    assert sum(third.stats.cache_hits.values()) == 1


@pytest.mark.usefixtures("compiled_only")
def test_of_two_processes_that_save_at_once_none_finds_the_kernel_of_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The one saves while the other has read the index and not yet written its kernel; the lock cannot be had."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(kernel_cache, "LONGEST_LOCK_S", 0.0)
    source = tmp_path / "kernel_file.py"
    source.write_text("def twice(x):\n    return 2 * x\n", encoding="utf-8")
    scope: dict[str, Any] = {}
    exec(compile(source.read_text(encoding="utf-8"), str(source), "exec"), scope)
    kernels = [jit.kernel(scope["twice"]) for _ in range(3)]
    Path(kernels[0]._cache.cache_path).mkdir()
    one, other, later = (kernel._cache._cache._cache_file for kernel in kernels)
    write = one._save_data

    def write_late(name: str, data: str) -> None:
        other._load_index = dict  # as it was before either of them began
        other.save("other", "other's")
        write(name, data)

    one._save_data = write_late
    one.save("one", "one's")
    assert later.load("one") in ("one's", None), "else it is compiled again"
    assert later.load("other") in ("other's", None), "not the other's"


@pytest.mark.usefixtures("compiled_only")
def test_a_kernel_that_a_full_disk_does_not_keep_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    kernel = jit.kernel(lambda x: 2 * x)
    full = Mock(side_effect=OSError(errno.ENOSPC, "No space left on device"))
    monkeypatch.setattr(kernel._cache._cache._cache_file, "_save_data", full)
    assert kernel(21) == 42
    assert full.called


@pytest.mark.usefixtures("compiled_only")
def test_sources_that_change_under_a_process_do_not_give_its_kernels_their_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    source, text = tmp_path / "kernel_file.py", "def twice(x):\n    return 2 * x\n"
    source.write_text(text, encoding="utf-8")
    scope: dict[str, Any] = {}
    exec(compile(text, str(source), "exec"), scope)
    kernel = jit.kernel(scope["twice"])
    source.write_text(text.replace("2 * x", "3 * x"), encoding="utf-8")
    assert kernel(21) == 42
    (tmp_path / "as_it_was.py").write_text(text, encoding="utf-8")
    assert Path(kernel._cache.cache_path).name == kernel_cache.source_hash(tmp_path / "as_it_was.py")
    assert list(Path(kernel._cache.cache_path).glob("*.nbc"))


@pytest.mark.usefixtures("compiled_only")
def test_a_kernel_whose_cache_cannot_be_read_is_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    kernel = jit.kernel(lambda x: 2 * x)
    monkeypatch.setattr(kernel._cache._cache._cache_file, "_load_index", Mock(side_effect=PermissionError))
    assert kernel(21) == 42
    assert not list(tmp_path.rglob("*.nbc")), "nor left behind where no index tells of it"


def test_a_process_that_calls_no_kernel_does_not_look_at_the_cache(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels"), "NUMBA_DISABLE_JIT": "0"}
    command = [sys.executable, "-c", "import wall.tracing.kernels.trace"]
    subprocess.run(command, env=environment, check=True, timeout=60)
    assert not (tmp_path / "kernels").exists()


def test_a_lock_that_another_never_gives_back_is_waited_for_no_longer_than_said(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    with open(path, "w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with kernel_cache.locked(path, 0.05):
            pass
        with pytest.raises(BlockingIOError), open(path, "w") as other:
            fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
    with kernel_cache.locked(path, 5.0), pytest.raises(BlockingIOError), open(path, "w") as other:
        fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)


def test_where_a_file_system_has_no_locks_nothing_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(file: object, operation: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    monkeypatch.setattr(kernel_cache.time, "sleep", lambda seconds: pytest.fail("it waits"))
    with kernel_cache.locked(tmp_path / "lock", 300.0):
        pass


def test_garbage_is_collected_less_often_while_a_kernel_is_compiled_and_as_before_afterwards() -> None:
    seen: list[int] = []

    class Watch(Listener):
        def on_start(self, event: Event) -> None:
            seen.append(gc.get_threshold()[0])

        def on_end(self, event: Event) -> None:
            pass

    before = gc.get_threshold()
    with install_listener("numba:compile", Watch()):  # type: ignore[no-untyped-call]
        assert jit._from_python(lambda x: x + 1)(1) == 2

    assert seen == [OBJECTS_A_COLLECTION]
    assert gc.get_threshold() == before < (OBJECTS_A_COLLECTION,)


@pytest.mark.parametrize("home", ["no home", "a file"])
def test_a_user_without_a_folder_to_write_to_has_a_cache_of_its_own(
    home: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", "" if home == "no home" else str(tmp_path / "file"))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    if home == "no home":
        monkeypatch.setattr(Path, "home", Mock(side_effect=RuntimeError("no home")))
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    found = kernel_cache.cache_root()
    assert found == tmp_path / f"wall-kernels-{os.getuid()}"
    assert stat.S_IMODE(found.stat().st_mode) == 0o700
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    assert kernel_cache.cache_root().name != "wall-kernels-12345", "one that another user made is not used"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "mine"))
    assert kernel_cache.cache_root() == tmp_path / "mine" / "wall" / "kernels"


def test_a_kernel_that_a_thread_compiles_is_finished_before_its_process_ends(tmp_path: Path) -> None:
    source = tmp_path / "compiles.py"
    source.write_text(
        "import threading\n"
        "import numba.core.event as event\n"
        "from wall.core import jit\n"
        "jit.LONGEST_WAIT_S = 60.0\n"
        "kernel = jit.kernel\n"
        "begun = threading.Event()\n"
        "class Begun(event.Listener):\n"
        "    def on_start(self, event): begun.set()\n"
        "    def on_end(self, event): pass\n"
        "event.register('numba:compile', Begun())\n"
        "@kernel\n"
        "def total(values):\n"
        "    return sum([value * 2 for value in values])\n"
        "threading.Thread(target=total, args=((1, 2),), daemon=True).start()\n"
        "assert begun.wait(60)\n"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}
    ended = subprocess.run([sys.executable, source], env=environment, capture_output=True, text=True, timeout=120)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert list(tmp_path.rglob("*.total-*.nbc"))


@pytest.mark.parametrize("first", ["numba", "wall"])
def test_what_is_imported_first_does_not_change_how_kernels_are_compiled(first: str, tmp_path: Path) -> None:
    source = tmp_path / "compiles.py"
    source.write_text(
        f"import {first}\n"
        "import numba\n"
        "from numba.core import event\n"
        "from wall.core import jit\n"
        "class Watch(event.Listener):\n"
        "    def on_start(self, event): print(numba.config.SLP_VECTORIZE, end=' ')\n"
        "    def on_end(self, event): print(numba.config.SLP_VECTORIZE, end=' ')\n"
        "plain, bits, other = (make(lambda x: x + 1) for make in (jit.kernel, jit.bit_kernel, numba.njit))\n"
        "event.register('numba:compile', Watch())\n"
        "bits(1.0)\n"
        "plain(1)\n"
        "other(1)\n"
        "assert numba.config.SLP_VECTORIZE == 1\n"
    )
    unset = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    environment = {**unset, "NUMBA_CACHE_DIR": str(tmp_path)}
    ended = subprocess.run([sys.executable, source], env=environment, capture_output=True, text=True, timeout=120)
    assert (ended.returncode, ended.stdout.split(), ended.stderr) == (0, ["0", "1", "1", "1", "1", "1"], "")
