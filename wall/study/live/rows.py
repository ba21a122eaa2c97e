"""live.jsonl: a line for each configuration, method and number of cores; what is there is not measured again."""

from __future__ import annotations

from dataclasses import dataclass, field

FILE = "live.jsonl"

Identity = tuple[object, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What was measured of one run: a line of the file, keys in this order."""

    config: str
    method: str
    cores: float
    rmse_display: float  # of display values, 0 to 1, as in `wall measure quality`; times 255: 8-bit codes
    flip: float
    ssim: float
    refresh_hz: float  # images that became light a second, of a panel
    interval_p95_ms: float  # from one to its next
    latency_p50_ms: float  # from an event to the refresh that first showed a sample of it, without the display's delay
    latency_p95_ms: float
    latency_p99_ms: float
    samples_per_s: float
    bytes_per_s: float  # of samples, and of images that renderers make
    cpu_s: dict[str, float]  # by role, of the whole run
    run_s: float  # the whole run: starting, warming up, being measured, ending
    seconds: float  # measured
    warm_up_s: float
    panels: int
    pixels: int  # of all panels
    display_delay_s: float
    error_over_time: list[float]  # rmse_display at each moment
    times: list[float]  # of them on the camera's path, seconds
    log_cpu_s: float  # of cpu_s["head"], that keeping the images took
    dropped: dict[str, int]
    setup: str  # a hash of the configuration as it was run
    reference: str  # name of the reference images
    spp: int  # of those, samples a pixel
    other_cores: float  # that everything else on the machine used during the run
    commit: str
    machine: str
    command: str
    flip_over_time: list[float] = field(default_factory=list)  # FLIP at each moment; rows of old lack it
    since_jump: list[float] = field(default_factory=list)  # seconds at each moment, of a camera that jumps; else none

    @property
    def identity(self) -> Identity:
        """Equal for two rows that measured the same."""
        return (self.config, self.method, self.cores, self.setup, self.reference)
