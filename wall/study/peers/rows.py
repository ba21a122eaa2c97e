"""peers.jsonl: a line for each configuration, renderer and number of cores; what is there is not measured again."""

from __future__ import annotations

from dataclasses import dataclass

FILE = "peers.jsonl"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What was measured of one renderer: a line of the file, keys in this order."""

    config: str
    renderer: str
    cores: float  # that it could use
    rmse_display: float  # in motion: of display values, 0 to 1; times 255: 8-bit codes
    flip: float
    ssim: float
    rest_rmse: float  # of a picture from a camera that rests, as rmse_display
    rest_blocks: float  # the same of means over blocks of pixels: edges hardly count, colours and places do
    refresh_hz: float  # pictures shown a second
    interval_p95_ms: float  # from one to its next
    cpu_cores: float  # CPU seconds a second that it took, of the time that is measured
    triangles: int
    pixels: int
    version: str
    device: str
    seconds: float  # measured
    warm_up_s: float
    error_over_time: list[float]  # rmse_display at each moment
    times: list[float]  # of them on the camera's path, seconds
    setup: str  # a hash of what was run
    reference: str  # name of the reference images
    spp: int  # of those, samples a pixel
    other_cores: float  # that everything else on the machine used during the run
    commit: str
    machine: str
    command: str

    @property
    def identity(self) -> tuple[object, ...]:
        """Equal for two rows that measured the same."""
        return (self.config, self.renderer, self.cores, self.setup, self.reference)
