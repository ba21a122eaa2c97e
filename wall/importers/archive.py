"""Files that a description names: in a zip together with it, or beside it in its folder."""

from __future__ import annotations

import zipfile
from functools import cached_property
from pathlib import Path, PurePosixPath

from wall.core.errors import ConfigError
from wall.core.files import read_file
from wall.importers.report import NotThisFormat

MOST_BYTES = 1 << 28  # of one file: a warp of 4096x2160 pixels has 106 MB
MOST_FILES = 4096


class Files:
    """What a description names: read by its path, whatever its case, or by its file name alone."""

    def __init__(self, path: Path, folder: str = "") -> None:
        """`path`: of the archive, or of the description; `folder`: where a conversion's own files go, beside its YAML.

        Raises ConfigError where an archive cannot be read.
        """
        self.path, self.folder, self._zip = path, folder, None
        if not path.is_file() or not zipfile.is_zipfile(path):  # a pipe can be opened once, by who reads the text
            return
        try:
            self._zip = zipfile.ZipFile(path)
        except (OSError, zipfile.BadZipFile, NotImplementedError) as error:
            raise ConfigError(f"{path}: is no archive that can be read ({error})") from None
        if (count := len(self._zip.infolist())) > MOST_FILES:
            raise ConfigError(f"{path}: has {count} files; accepted: at most {MOST_FILES}")

    @cached_property
    def _names(self) -> dict[str, str]:
        """By path in lower case: the names of all files."""
        if self._zip is not None:
            names = [item.filename for item in self._zip.infolist() if not item.is_dir()]
        else:
            names = [item.name for item in self.path.parent.iterdir() if item.is_file()]
        return {name.lower(): name for name in names}

    @property
    def is_archive(self) -> bool:
        """Whether it is a zip, which holds its description too."""
        return self._zip is not None

    def description(self) -> str:
        """The text of an archive's XML, of several mpcdi.xml. Raises NotThisFormat where it has none."""
        found = [name for name in self._names if name.endswith(".xml")]
        chosen = next((name for name in found if PurePosixPath(name).name == "mpcdi.xml"), (found or [""])[0])
        if not chosen:
            raise NotThisFormat(f"{self.path}:1:1: the archive has no mpcdi.xml; accepted: an MPCDI archive")
        return (self.read(chosen) or b"").decode("utf-8-sig", "replace")

    def read(self, name: str) -> bytes | None:
        """The bytes of a file; None where there is none. Raises ConfigError for one that cannot be read."""
        key = name.strip().replace("\\", "/").lower().removeprefix("./")
        short = {PurePosixPath(path).name: whole for path, whole in self._names.items()}
        found = self._names.get(key) or short.get(PurePosixPath(key).name)
        if found is None:
            return None
        try:
            if self._zip is None:
                return read_file(self.path.parent / found, MOST_BYTES)
            with self._zip.open(found) as file:
                data = file.read(MOST_BYTES + 1)
        except (OSError, zipfile.BadZipFile, RuntimeError, NotImplementedError, EOFError) as error:
            raise ConfigError(f"{self.path}: {found} cannot be read ({error})") from None
        if len(data) > MOST_BYTES:
            raise ConfigError(f"{self.path}: {found} has more than {MOST_BYTES} bytes")
        return data
