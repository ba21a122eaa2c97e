"""Progressive sampling: while the input rests, stages of ever more samples a pixel, shown tile by tile.

An input is answered by one coarse pass over the region that takes 1 / target_hz at most: several samples a pixel, one,
or one for a block of pixels, whatever the time allows. A few samples of each tile tell which of them the input has
changed most surely: the pass begins with these, so that a change is soon seen wherever it is. Then stages follow, each
of twice as many samples as the one before, from paths one surface longer until all are reached. A stage begins anew
where its paths are longer, so that no mean is of two kinds, and else adds to the one before; its tiles are shown as
they are complete, so that no pixel gets noisier. Between stages it rests; a new input breaks it off after one batch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import srgb_encoded
from wall.core.data import SAMPLE, Event, Float32, Rect, Samples
from wall.sampling.base import Targets
from wall.sampling.pixel_means import PixelMeans, footprint_of

GRID = 8  # tiles along each edge of the region
LARGEST_TILE = 256  # pixels along an edge: its records fit in one packet
COARSEST = 8  # edge of the largest block of pixels that one sample stands for, pixels
MOST_PROBES = 1 / 16  # of the samples of a coarse pass
ROUNDING = 1.0  # display codes: what noise there is at least
NEWEST_SHARE = 0.25  # of the newest batch in the moving mean of a sample's time


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """What stages follow each other."""

    first_stage: int = 8  # samples a pixel of the first one
    samples_per_pixel: int = 4096  # after which it ends, unless edits say otherwise
    rest_s: float = 0.5  # between stages
    target_hz: float = 15.0  # of coarse passes
    first_depth: int = 4  # surfaces of the first stage's paths
    depth: int = 8  # of the longest


class Tile:
    """A tile's means, and the record of each pixel's newest sample."""

    def __init__(self, rect: Rect, seed: int) -> None:
        self.rect, self._seed = rect, seed
        self.samples, self.square_error = 0, 0.0  # a pixel as shown; an estimate, of display codes squared
        self._shown: Float32 | None = None  # display codes
        self._seen: Float32 | None = None  # display codes of the newest records; in the corners of blocks, where coarse
        self._adds = False  # to what is shown
        self.begin()

    def begin(self) -> None:
        """Forget all samples; what is shown stays until others are complete."""
        self._adds = False
        self.means = PixelMeans(self.rect, seed=self._seed)
        self._newest = np.zeros((self.rect.height, self.rect.width), SAMPLE)

    def add(self, samples: Samples) -> None:
        """Add samples of this tile."""
        self.means.add(samples)
        x, y = samples["xy"][:, 0].astype(np.intp) - self.rect.x, samples["xy"][:, 1].astype(np.intp) - self.rect.y
        self._newest[y, x] = samples

    def estimate(self, samples: int) -> None:
        """Estimate the error of the means, of so many samples a pixel, by how they differ from those shown before.

        The variance of one sample is the same in both: that of their difference is its multiple by 1 / n + 1 / m, or
        1 / n - 1 / m where the m samples are among the n.
        """
        codes = _codes(self.means.mean())
        if self._shown is not None and samples > self.samples:
            apart = 1.0 / self.samples + (-1.0 if self._adds else 1.0) / samples
            self.square_error = float(np.square(codes - self._shown).mean()) / (samples * apart)
        self._shown, self.samples, self._adds = codes, samples, True

    @property
    def shows(self) -> bool:
        """Whether it has given records."""
        return self._seen is not None

    def probes(self, count: int) -> Float32:
        """(n, 2) middles of at most so many pixels, spread over the tile, that any coarse pass has sampled."""
        x, y = np.arange(0, self.rect.width, COARSEST), np.arange(0, self.rect.height, COARSEST)
        grid = np.stack(np.meshgrid(x + self.rect.x, y + self.rect.y), axis=-1).reshape(-1, 2)
        return (grid[:: -(-len(grid) // count)] + np.float32(0.5)).astype(np.float32)

    def change(self, samples: Samples) -> float:
        """How far the mean of samples is from what is shown there, in its standard errors.

        Samples of other tiles are left out.
        """
        x, y = (np.floor(samples["xy"]).astype(np.intp) - (self.rect.x, self.rect.y)).T
        own = (x >= 0) & (x < self.rect.width) & (y >= 0) & (y < self.rect.height)
        if self._seen is None or not own.any():
            return 0.0
        apart = (_codes(samples["radiance"][own]) - self._seen[y[own], x[own]]).sum(axis=-1)
        return float(abs(apart.mean()) * np.sqrt(len(apart) / (apart.var() + ROUNDING**2)))

    def forget_shown(self) -> None:
        """What is shown is of another input."""
        self._shown, self.samples, self.square_error = None, 0, 0.0

    def records(self, step: int) -> Samples:
        """Samples in the middles of pixels that show the means; of one in each block of step x step for all of it."""
        means, found = self.means.mean().astype(np.float32), self.means.counts > 0
        records = self._newest.copy()
        records["radiance"] = means
        self._seen = _codes(means)
        if step > 1:
            rows, columns = (np.arange(size) // step * step for size in found.shape)
            records, found = records[rows][:, columns], found[rows][:, columns]
        y, x = np.nonzero(found)
        kept = records[y, x]
        kept["xy"] = np.stack([x + self.rect.x, y + self.rect.y], axis=1) + np.float32(0.5)
        return kept


class ProgressiveSampler:
    """One thread's tiles; `resolve` gives what is shown of the samples that `observe` was told."""

    coherent = True

    def __init__(
        self,
        rect: Rect,
        now: Callable[[], float],
        schedule: Schedule,
        *,
        batch: int,
        seed: int,
        worker: int = 0,
        workers: int = 1,
    ) -> None:
        """`now` gives the time in seconds; `batch`: samples traced under one event."""
        self._tiles = [Tile(part, seed) for part in tiles_of(rect)[worker::workers]]
        self._now, self._schedule, self._batch = now, schedule, batch
        self._event: Event | None = None
        self._moving = True  # the coarse pass that answers an input
        self.stage, self.samples = 0, 0  # number of the stage, from 0, and samples a pixel at its end
        self._from = 0  # samples a pixel that the stage adds to
        self._step = 1  # pixels of the coarse pass along a block's edge
        self._sample_s = 0.0  # time of one sample, a moving mean
        self._tile, self._sweep, self._at = len(self._tiles), 0, 0
        self._xy: Float32 = np.empty((0, 2), np.float32)
        self._count, self._chosen_at = 0, 0.0  # samples chosen last, and when
        self._probes: Float32 = np.empty((0, 2), np.float32)  # traced before the coarse pass
        self._done: list[Samples] = []  # records that are to be shown
        self._rests_until: float | None = None

    @property
    def depth(self) -> int:
        """Most surfaces of the stage's paths."""
        first, last = self._schedule.first_depth, self._schedule.depth
        return min(first if self._moving else first + self.stage, last)

    @property
    def samples_shown(self) -> int:
        """Samples a pixel of the stage that all tiles show; 0 during coarse passes."""
        return min((tile.samples for tile in self._tiles), default=0)

    @property
    def square_error(self) -> float:
        """Estimate of the mean squared error of what is shown, in display codes of 8 bits; 0 where not known yet."""
        known = [tile for tile in self._tiles if tile.square_error > 0.0]
        area = sum(tile.rect.area for tile in known)
        return sum(tile.square_error * tile.rect.area for tile in known) / area if area else 0.0

    def choose(self, newest: Event) -> Targets | None:
        """The next positions; None between stages, and after the last one."""
        self._measure()
        changed = self._event is None or newest.number != self._event.number
        if changed and (not self._moving or self._tile >= len(self._tiles)):
            self._answer(newest)
        assert self._event is not None
        if newest.number == self._event.number and newest.edits.number != self._event.edits.number:
            self._event = newest  # of the same image: it says how many samples there are to be
        self._count = 0
        if self._tile >= len(self._tiles) and not self._next_stage():
            return Targets(xy=np.empty((0, 2), np.float32), event=self._event) if self._done else None
        if len(self._probes):
            self._count = len(self._probes)
            return Targets(xy=self._probes, event=self._event, footprint=self._step, number=0, depth=self.depth)
        tile = self._tiles[self._tile]
        if self._at == 0:
            xy = tile.means.positions(self._sweep)
            if self._step > 1:
                x, y = (np.floor(xy) - (tile.rect.x, tile.rect.y)).astype(np.int64).T
                xy = np.ascontiguousarray(xy[(x % self._step == 0) & (y % self._step == 0)])
            self._xy = xy
        xy = self._xy[self._at : self._at + self._batch]
        self._count = len(xy)
        return Targets(
            xy=xy, event=self._event, footprint=self._step * footprint_of(self.samples), number=self._sweep,
            depth=self.depth,
        )  # fmt: skip

    def _measure(self) -> None:
        """Take the time of the batch before: all of it, since what was done with its samples takes as long again."""
        now = self._now()
        if self._count > 0:
            spent = max(now - self._chosen_at, 0.0) / self._count
            self._sample_s += (spent - self._sample_s) * (NEWEST_SHARE if self._sample_s > 0.0 else 1.0)
        self._chosen_at = now

    def observe(self, samples: Samples, base_time: float) -> None:
        """Add the samples to their tile's means; a tile whose stage is complete is shown."""
        if self._count == 0:
            return
        if len(self._probes):
            self._tiles.sort(key=lambda tile: -tile.change(samples))
            self._count, self._probes = 0, self._probes[:0]  # scattered ones do not tell what a pass takes
            return
        tile, count = self._tiles[self._tile], self._count
        tile.add(samples)
        self._at += count
        if self._at < len(self._xy):
            return
        self._at, self._sweep = 0, self._sweep + 1
        if self._sweep >= self.samples:
            if not self._moving:
                tile.estimate(self.samples)
            self._done.append(tile.records(self._step))
            self._tile, self._sweep = self._tile + 1, self._from
            self._enter()

    def resolve(self) -> Samples:
        """Records that are to be shown, of one tile at most; they replace those of their pixels."""
        return self._done.pop(0) if self._done else np.empty(0, SAMPLE)

    def forget(self, samples: Samples, base_time: float) -> None:
        """Show these records again."""
        self._done.append(samples)

    def restart(self) -> None:
        """Answer the newest event as if it were new."""
        self._event, self._tile = None, len(self._tiles)

    def _answer(self, newest: Event) -> None:
        """Begin the coarse pass of an event, as fine as 1 / target_hz allows."""
        again = self._event is None  # nothing has changed that probes could tell
        self._event, self._moving, self.stage, self._rests_until = newest, True, 0, None
        for tile in self._tiles:
            tile.forget_shown()
        allowed = 1.0 / (self._schedule.target_hz * self._sample_s) if self._sample_s > 0.0 else self._blocks(1)
        self._step = 1
        while self._blocks(self._step) > allowed and self._step < COARSEST:
            self._step *= 2
        most = 0 if again else min(self._batch, int(MOST_PROBES * allowed))
        self._probe(most // max(len(self._tiles), 1))
        allowed /= self._blocks(self._step)
        self._begin(max(1, min(int(allowed), self._schedule.first_stage)), anew=True)

    def _probe(self, count: int) -> None:
        """Begin with so many samples of each tile, where all show something that may have changed."""
        known = self._tiles if count and all(tile.shows for tile in self._tiles) else []
        self._probes = np.concatenate([np.empty((0, 2), np.float32), *(tile.probes(count) for tile in known)])

    def _blocks(self, step: int) -> float:
        """Blocks of step x step pixels in all tiles."""
        return float(sum(-(-tile.rect.width // step) * -(-tile.rect.height // step) for tile in self._tiles))

    def _next_stage(self) -> bool:
        """Begin the stage behind the one that is complete, once it has rested. Returns whether one runs."""
        if self._moving:
            self._moving, self._step = False, 1
            self._begin(self._schedule.first_stage, anew=True)
            return True
        if self._rests_until is None:
            self._rests_until = self._now() + self._schedule.rest_s
        assert self._event is not None
        most = self._event.edits.most_samples(self._schedule.samples_per_pixel)
        if self.samples >= most or self._now() < self._rests_until:
            return False
        self._rests_until, before = None, self.depth
        self.stage += 1
        longer = self.depth > before
        added = self._schedule.first_stage << self.stage
        self._begin(min(added if longer else self.samples + added, most), anew=longer)
        return True

    def _begin(self, samples: int, *, anew: bool) -> None:
        """Begin with the first tile, up to so many samples a pixel."""
        self._from = 0 if anew else self.samples
        self.samples = samples
        self._tile, self._sweep, self._at, self._anew = 0, self._from, 0, anew
        self._enter()

    def _enter(self) -> None:
        """Empty the tile that comes next, where the stage does not add to the one before."""
        if self._tile < len(self._tiles) and self._anew:
            self._tiles[self._tile].begin()


def _codes(radiance: NDArray[np.floating]) -> Float32:
    """Display codes of radiance."""
    return (255.0 * srgb_encoded(radiance)).astype(np.float32)


def tiles_of(rect: Rect) -> list[Rect]:
    """A region as GRID x GRID tiles, more where they would be too large, fewer where it is small, row by row."""
    columns, rows = _edges(rect.x, rect.width), _edges(rect.y, rect.height)
    return [
        Rect(x=x, y=y, width=right - x, height=below - y)
        for y, below in pairwise(rows)
        for x, right in pairwise(columns)
    ]


def _edges(start: int, size: int) -> list[int]:
    parts = max(GRID, -(-size // LARGEST_TILE))
    return [int(edge) for edge in np.unique(np.linspace(start, start + size, parts + 1).astype(np.int64))]
