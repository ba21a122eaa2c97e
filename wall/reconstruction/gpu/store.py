"""The sample store in the GPU's memory: only new samples travel, and all keep their order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.deepbuffer.kernels.evict import AGES
from wall.deepbuffer.store import SampleStore
from wall.reconstruction.gpu.device import GROUP, TIME, WORD_BYTES, Device, GpuError
from wall.reconstruction.gpu.readback import Readback

WORDS = {"position": 3, "radiance": 3, "screen_position": 3, "state": 2, "object_id": 1}  # of a sample in each array
LIT_WORDS = {"surface": 2, "albedo": 3}  # beside, where samples are lit anew


class GpuStore:
    """Arrays of samples, as SampleStore has them on the CPU but item after item; `count` of them are in use.

    `state` is time and confidence, `surface` the normal and the light visibility mask.
    """

    def __init__(self, device: Device, capacity: int, *, lit: bool) -> None:
        """Raises GpuError if so many samples do not fit."""
        self.device, self.capacity, self.count = device, capacity, 0
        self._words = WORDS | LIT_WORDS if lit else WORDS
        largest = capacity * max(WORDS.values()) * WORD_BYTES
        if largest > device.largest_buffer:
            raise GpuError(
                f"{capacity} samples take {largest} bytes in one buffer, {device.renderer} has {device.largest_buffer}",
                wanted="smaller panels, fewer samples_per_pixel",
            )
        self.arrays = {name: device.reserve(words * capacity) for name, words in self._words.items()}
        self._spare = {words: device.reserve(words * capacity) for words in set(WORDS.values())}
        self.weight = device.reserve(capacity)  # of each sample in the image; while packing, its rank in its group
        self._groups = device.reserve(-(-capacity // GROUP) + 1)
        self.ages = device.buffer(np.zeros(AGES + 1, np.uint32))
        self._readback = Readback(device)

    def append(self, staged: SampleStore, n: int) -> None:
        """Copy the first `n` samples of a store on the CPU behind the others."""
        parts: dict[str, NDArray[np.generic]] = {
            "position": staged.position[:, :n].T, "radiance": staged.radiance[:n, :3],
            "screen_position": staged.screen_position[:, :n].T, "object_id": staged.object_id[:n],
            "state": np.column_stack([staged.time[:n], staged.confidence[:n]]),
            "surface": np.column_stack([staged.normal[:n], staged.light_visibility[:n]]),
            "albedo": staged.albedo[:, :n].T,
        }  # fmt: skip
        for name, words in self._words.items():
            self.device.write(self.arrays[name], parts[name], offset=words * WORD_BYTES * self.count)
        self.count += n

    def pack(self) -> None:
        """Compact the store: samples that are not in the image are removed."""
        if self.count == 0:
            return
        groups = -(-self.count // GROUP)
        run = self.device.compute
        run("count", self.count, (self.arrays["screen_position"], self.weight, self._groups))
        run("scan", groups, (self._groups,), groups=1)
        for name, words in self._words.items():
            to = self._spare[words]
            run("pack", self.count, (self.weight, self._groups, self.arrays[name], to), words=words)
            self.arrays[name], self._spare[words] = to, self.arrays[name]
        total = np.zeros(1, np.uint32)
        self._readback.read(self._groups, total, first=groups)
        self.count = int(total[0])

    def read(self, name: str) -> Float32:
        """(words, count) float32: an array of floats."""
        some = min(1 << self.count.bit_length(), self.capacity)  # few different sizes: each keeps a texture
        values = np.zeros((some, WORDS[name]), np.float32)
        self._readback.read(self.arrays[name], values)
        return np.array(values[: self.count].T, order="C")

    def doubt(self, doubted: NDArray[np.uint8], *, unlit: bool) -> None:
        """Take confidence from the samples of doubted objects, (n + 1,); see deepbuffer.kernels.doubt."""
        if self.count == 0:
            return
        objects = self.device.buffer(doubted.astype(np.float32))
        albedo = self.arrays["albedo"] if unlit else self.arrays["state"]
        buffers = (self.arrays["state"], self.arrays["object_id"], objects, albedo)
        self.device.compute("doubt", self.count, buffers, unlit=int(unlit))

    def reject_cut_away(self, planes: Float32) -> None:
        """Reject the samples beyond planes, (n + 1, k, 4); see deepbuffer.kernels.cuts."""
        if self.count == 0:
            return
        buffers = (
            *(self.arrays[name] for name in ("position", "object_id", "state")),
            self.device.buffer(planes),
        )
        self.device.compute("cut_away", self.count, buffers, planes_per_object=planes.shape[1])

    def drop_oldest(self, share: float) -> None:
        """Remove that share of the samples, and what is as old."""
        latest = np.quantile(self.read("state")[TIME], share)
        self.device.compute("evict", self.count, (self.arrays["state"], self.arrays["screen_position"]), latest=latest)
        self.pack()

    def limit_age(self, now: np.float32, wanted: int) -> None:
        """Leave in `ages` the last class of age that may stay, so that `wanted` samples of the image do."""
        buffers = (self.arrays["screen_position"], self.arrays["state"], self.ages)
        self.device.compute("ages", self.count, buffers, now=now)
        self.device.compute("cutoff", AGES, (self.ages,), groups=1, wanted=wanted)

    def shift(self, later: np.float32) -> None:
        """Subtract `later` from all times."""
        if self.count:
            self.device.compute("shift", self.count, (self.arrays["state"],), stride=2, offset=TIME, later=later)
