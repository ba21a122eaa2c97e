"""What work costs on a machine: CPU seconds and bytes of everything that the simulation does not do itself.

calibration.py measures them; they are kept as JSON, so that a wall can be planned for another machine than this one.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from wall.core.errors import ConfigError


@dataclass(frozen=True, slots=True, kw_only=True)
class Rates:
    """Costs measured on a machine: CPU seconds (`_s`) and bytes, each of one batch, sample, pixel, message or turn."""

    machine: str
    commit: str
    method: str  # of sampling
    cores: int
    batch_samples: float  # samples of a batch that is traced
    batch_s: float  # choosing, tracing and encoding one batch
    aim_s: float  # the first batch under an event, in addition: camera and objects move in the tracer
    replan_pixel_s: float  # of a region: the adaptive renderer refreshes its own deep buffer and scores its pixels
    sample_bytes: float  # of a packet, its header included
    insert_s: float  # decoding a packet and inserting its samples at the compositor
    refresh_pixel_s: float  # of a layer that is refreshed: reprojecting what it holds
    framelet_pixel_bytes: float  # of an image that one compositor sends to another
    pack_pixel_s: float
    unpack_pixel_s: float
    jpeg_pixel_bytes: float
    jpeg_pixel_s: float
    h264_pixel_bytes: float | None  # None: PyAV is not installed
    h264_pixel_s: float | None
    message_s: float  # one end of a heartbeat's way: made and sent, or received and read
    event_send_s: float  # sending an event to one rank: it is made once for all
    event_s: float  # reading an event at a rank, until its role knows it
    packet_s: float  # one end of a packet's way through a socket
    turn_s: float  # one turn of a loop beside all that, going to sleep included

    @property
    def samples_per_s(self) -> float:
        """Samples that one core traces and encodes in a second, its own refreshes not counted."""
        return self.batch_samples / self.batch_s

    @property
    def packet_bytes(self) -> int:
        """Bytes of one batch's packet."""
        return round(self.batch_samples * self.sample_bytes)

    def faster(self, *, tracing: float = 1.0, images: float = 1.0) -> Rates:
        """The same work in so many times less time: more cores, or a GPU. Messages cost what they did.

        `images`: what is done to pixels and to stored samples, at compositors and at renderers.
        """
        times = dict.fromkeys(("batch_s", "aim_s"), tracing)
        pixels = ("insert_s", "refresh_pixel_s", "pack_pixel_s", "unpack_pixel_s", "replan_pixel_s")
        times |= dict.fromkeys(pixels, images)
        return replace(self, **{name: getattr(self, name) / by for name, by in times.items()})

    def with_batch(self, samples: float) -> Rates:
        """The same work in batches of another size."""
        by = samples / self.batch_samples
        return replace(self, batch_samples=samples, batch_s=self.batch_s * by, insert_s=self.insert_s * by)


def load(path: Path) -> Rates:
    """Rates of a JSON file that `save` wrote. Raises ConfigError for any other file."""
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ConfigError(f"--rates {path}: {error}; wanted a file that wall plan --save-rates wrote") from None
    names = {f.name: f.type for f in fields(Rates)}
    values = values.get("rates", values) if isinstance(values, dict) else {}
    for name, kind in names.items():
        value = values.get(name)
        right = isinstance(value, str) if kind == "str" else (value is None and "None" in str(kind)) or _positive(value)
        if not right:
            raise ConfigError(f"--rates {path}: {name} is {value!r}; wanted {'text' if kind == 'str' else 'a number'}")
    return Rates(**{name: values[name] for name in names})


def _positive(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 <= value < float("inf")


def save(path: Path, rates: Rates) -> None:
    """Write rates as JSON."""
    path.write_text(json.dumps(asdict(rates), indent=2) + "\n", encoding="utf-8")
