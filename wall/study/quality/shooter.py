"""What every arm does with the positions it chose: trace them, count what that cost, send what came of them."""

from __future__ import annotations

from collections.abc import Callable

from wall.core.data import Batch, Event, Float32, Samples
from wall.packets.samples import MAX_SAMPLES, Codec, decode, encode
from wall.study.quality.method import Setup

ADAPTIVE_PACKET = 4096  # samples of one packet of the adaptive sampler, as its workers send them


class Shooter:
    """Traces, counts and sends. Who needs what the packets bring passes `receive`; else nobody decodes them."""

    def __init__(
        self,
        setup: Setup,
        *,
        coherent: bool,
        adaptive: bool = False,
        sends: bool = True,
        receive: Callable[[Batch], None] | None = None,
    ) -> None:
        """`adaptive` chooses the packets' layout; without `sends` there are none, as where pictures are sent."""
        self._tracer, self._rect = setup.tracer(coherent=coherent), setup.rect
        self._adaptive, self._sends, self._receive = adaptive, sends, receive
        self._relightable = adaptive and setup.resident.needs.relighting
        self._sequence = 0
        self._placed: Event | None = None
        self.reset()

    def reset(self) -> None:
        """What was spent so far was free."""
        self.rays = self.secondary = self.bytes = 0

    @property
    def counts(self) -> tuple[int, int, int]:
        """Primary rays, the others, bytes."""
        return self.rays, self.secondary, self.bytes

    def trace(
        self, xy: Float32, event: Event, time: float, *, frame: int = 0, frame_samples: int = 0, blend: float = 1.0
    ) -> Samples:
        """Samples at (n, 2) float32 panel pixels under `event`, counted and sent at `time` seconds."""
        samples, dropped = self.shoot(xy, event)
        self.send(samples, event, time, frame=frame, frame_samples=frame_samples, dropped=dropped, blend=blend)
        return samples

    def shoot(self, xy: Float32, event: Event) -> tuple[Samples, int]:
        """The samples alone, for who still writes into them before they are sent; and how many rays gave none."""
        if self._placed is not event:
            self._tracer.take(event)
            self._placed = event
        samples, cost = self._tracer.trace(xy)
        self.rays += cost.primary
        self.secondary += cost.shadow + cost.secondary
        return samples, cost.bad

    def send(
        self, samples: Samples, event: Event, time: float, *, frame: int = 0, frame_samples: int = 0,
        dropped: int = 0, blend: float = 1.0,
    ) -> None:  # fmt: skip
        """As packets, at least one, of samples traced under `event`."""
        size = ADAPTIVE_PACKET if self._adaptive else MAX_SAMPLES
        for first in range(0, max(len(samples), 1) if self._sends else 0, size):
            self._sequence += 1
            batch = Batch(
                view=0, panel=0, rect=self._rect, rank=0, sequence=self._sequence, camera_event=event.camera_event,
                scene_event=event.scene_event, base_time=time, samples=samples[first : first + size], frame=frame,
                frame_samples=frame_samples, skipped=0 if first else dropped, blend=blend, camera=event.camera,
                scene_time=event.scene_time, adaptive=self._adaptive, relightable=self._relightable,
            )  # fmt: skip
            packet = encode(batch, Codec.ZSTD)
            self.bytes += len(packet)
            if self._receive is not None:
                self._receive(decode(packet))
