"""Samples in the GPU's memory: only new ones travel, the dead leave there, and all keep their order."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.deepbuffer.kernels.expire import AGES
from wall.reconstruction.gpu.device import GROUP, Device, GpuError
from wall.reconstruction.picture import Store

WORD_BYTES = 4
WORDS = {"place": 3, "colour": 3, "screen": 3, "state": 2, "name": 1}  # of a sample in each array
LIT_WORDS = {"surface": 1, "albedo": 3}  # beside, where samples are lit anew


class GpuStore:
    """Arrays of samples, as `Store` has them on the CPU but item after item; `count` of them are in use."""

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
        self.arrays = {name: self._reserve(words * capacity) for name, words in self._words.items()}
        self._spare = {words: self._reserve(words * capacity) for words in set(WORDS.values())}
        self.weight = self._reserve(capacity)  # of each sample in the picture; while packing, its rank in its group
        self._groups = self._reserve(-(-capacity // GROUP) + 1)
        self.ages = device.context.buffer(np.zeros(AGES + 1, np.uint32))

    def append(self, staged: Store, n: int) -> None:
        """Copy the first `n` samples of a store on the CPU behind the others."""
        parts: dict[str, NDArray[np.generic]] = {
            "place": staged.place[:, :n].T, "colour": staged.colour[:n, :3], "screen": staged.screen[:, :n].T,
            "state": staged.state[:, :n].T, "name": staged.name[:n],
            "surface": staged.surface[:n], "albedo": staged.albedo[:, :n].T,
        }  # fmt: skip
        for name, words in self._words.items():
            self.arrays[name].write(np.ascontiguousarray(parts[name]), offset=words * WORD_BYTES * self.count)
        self.count += n

    def pack(self) -> None:
        """Close ranks: who is not in the picture leaves."""
        if self.count == 0:
            return
        groups = -(-self.count // GROUP)
        run = self.device.compute
        run("count", self.count, (self.arrays["screen"], self.weight, self._groups))
        run("scan", groups, (self._groups,), groups=1)
        for name, words in self._words.items():
            to = self._spare[words]
            run("pack", self.count, (self.weight, self._groups, self.arrays[name], to), words=words)
            self.arrays[name], self._spare[words] = to, self.arrays[name]
        self.count = int(np.frombuffer(self._groups.read(WORD_BYTES, offset=WORD_BYTES * groups), np.uint32)[0])

    def read(self) -> tuple[Float32, Float32]:
        """(2, count) and (3, count) float32: times and confidences, places in the picture."""
        state, screen = (
            np.frombuffer(self.arrays[name].read(WORDS[name] * WORD_BYTES * self.count), np.float32)
            if self.count
            else np.zeros(0, np.float32)
            for name in ("state", "screen")
        )
        return np.array(state.reshape(-1, 2).T, order="C"), np.array(screen.reshape(-1, 3).T, order="C")

    def drop_oldest(self, share: float) -> None:
        """That share of the samples, and what is as old, leaves."""
        state = np.frombuffer(self.arrays["state"].read(2 * WORD_BYTES * self.count), np.float32)
        latest = np.quantile(state[::2], share)
        self.device.compute("leave", self.count, (self.arrays["state"], self.arrays["screen"]), latest=latest)
        self.pack()

    def limit_age(self, now: np.float32, wanted: int) -> None:
        """Leave in `ages` the last class of age of which samples may stay for `wanted` living ones to be left."""
        self.device.compute("ages", self.count, (self.arrays["screen"], self.arrays["state"], self.ages), now=now)
        self.device.compute("oldest", AGES, (self.ages,), groups=1, wanted=wanted)

    def shift(self, later: np.float32) -> None:
        """Set all times back."""
        if self.count:
            self.device.compute("shift", self.count, (self.arrays["state"],), stride=2, offset=0, later=later)

    def _reserve(self, words: int) -> Any:
        return reserve(self.device, words)


def reserve(device: Device, words: int) -> Any:
    """A buffer of 4-byte words. Raises GpuError where memory ends."""
    try:
        return device.context.buffer(reserve=max(words, 1) * WORD_BYTES)
    except Exception as error:  # moderngl raises nothing narrower
        problem = f"{words * WORD_BYTES} bytes on {device.renderer}: {error}"
        raise GpuError(problem, wanted="smaller panels, fewer samples_per_pixel") from error
