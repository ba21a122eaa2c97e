"""How the run is doing, for Prometheus (`/metrics`) and for scripts (`/status.json`). Pure: a Status in, text out.

Metrics have the text format 0.0.4, which Prometheus and its agents read: a name in base units, `_total` where it only
grows. https://prometheus.io/docs/instrumenting/exposition_formats/
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from itertools import accumulate

from wall.display.base import LATENCY_LIMITS_S, Status
from wall.display.stream import status_message

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
_ESCAPED = str.maketrans({"\\": r"\\", '"': r"\"", "\n": r"\n"})
Labels = Mapping[str, object]
_OF_TOTALS = (  # name after wall_rank_, kind, what it says, field of RankTotals
    ("process_id", "gauge", "The rank's process on its host.", "process"),
    ("uptime_seconds", "gauge", "Time since the rank was started, or adopted its configuration.", "seconds"),
    ("heartbeat_age_seconds", "gauge", "Time since the rank was last heard of.", "silent_s"),
    ("samples_total", "counter", "Samples traced.", "samples"),
    ("packets_total", "counter", "Packets of samples and images sent.", "packets"),
    ("sent_bytes_total", "counter", "Bytes of packets sent.", "bytes"),
    ("refreshes_total", "counter", "Refreshes of images that the rank makes.", "refreshes"),
    ("cpu_seconds_total", "counter", "CPU time used, all threads.", "cpu_s"),
    ("memory_bytes", "gauge", "Resident memory.", "memory"),
    ("memory_peak_bytes", "gauge", "Most resident memory so far.", "peak_memory"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PageCounts:
    """What a server counts itself."""

    viewers: int = 0  # now
    bytes: int = 0  # of images and samples, to all viewers so far
    dropped: Mapping[str, int] = field(default_factory=dict)  # requests, messages and commands refused, by name


def whole_status_message(status: Status, page: PageCounts) -> str:
    """A status as JSON, with every rank's totals and what the server counts."""
    totals = [asdict(each) for each in status.totals]
    return status_message(
        status, totals=totals, viewers=page.viewers, page_bytes=page.bytes, page_dropped=dict(page.dropped)
    )


def metrics_text(status: Status | None, page: PageCounts) -> str:
    """All metrics; None: nothing was shown yet, only what the server counts is known."""
    families = [*_page(page), *(() if status is None else (*_wall(status), *_ranks(status)))]
    return "".join(families)


def _family(name: str, kind: str, says: str, values: Mapping[str, float] | Iterator[tuple[Labels, float]]) -> str:
    """One metric; `values`: by labels, or the name's ending."""
    lines = [f"# HELP {name} {says}", f"# TYPE {name} {kind}"]
    if isinstance(values, Mapping):
        lines += [f"{name}{ending} {_number(value)}" for ending, value in values.items()]
    else:
        lines += [f"{name}{_labelled(labels)} {_number(value)}" for labels, value in values]
    return "\n".join(lines) + "\n"


def _labelled(labels: Labels) -> str:
    return "{" + ",".join(f'{name}="{str(value).translate(_ESCAPED)}"' for name, value in labels.items()) + "}"


def _number(value: float) -> str:
    return str(value) if isinstance(value, int) else repr(float(value)).replace("inf", "Inf").replace("nan", "NaN")


def _page(page: PageCounts) -> Iterator[str]:
    yield _family("wall_page_viewers", "gauge", "Pages and scripts that watch now.", {"": page.viewers})
    yield _family("wall_page_sent_bytes_total", "counter", "Bytes of images sent to viewers.", {"": page.bytes})
    refused = (({"reason": reason}, count) for reason, count in sorted(page.dropped.items()))
    yield _family("wall_page_dropped_total", "counter", "Requests and messages of viewers that were refused.", refused)


def _wall(status: Status) -> Iterator[str]:
    yield _family("wall_uptime_seconds", "gauge", "Time since the run began.", {"": status.seconds})
    yield _family("wall_paused", "gauge", "1 while the scene's time stands still.", {"": int(status.paused)})
    yield _family("wall_refreshes_total", "counter", "Refreshes of the whole wall that changed something.",
                  {"": status.refreshes})  # fmt: skip
    yield _family("wall_stale_regions", "gauge", "Parts of the wall that get nothing new, since their ranks are not "
                  "heard of.", {"": len(status.stale)})  # fmt: skip
    yield _family("wall_right_seconds", "gauge", "From an input until 90 % of the pixels are right, of the slowest "
                  "rank; 0: not known.", {"": status.right_ms / 1000.0})  # fmt: skip
    yield _family("wall_input_latency_seconds", "histogram", "From an input to the first image that shows it.",
                  _histogram(status))  # fmt: skip


def _histogram(status: Status) -> dict[str, float]:
    counts = status.latency_counts or (0,) * (len(LATENCY_LIMITS_S) + 1)
    limits = [*map(str, LATENCY_LIMITS_S), "+Inf"]
    reached = list(accumulate(counts))
    found: dict[str, float] = {f'_bucket{{le="{limit}"}}': n for limit, n in zip(limits, reached, strict=True)}
    return found | {"_sum": status.latency_sum_s, "_count": reached[-1]}


def _ranks(status: Status) -> Iterator[str]:
    ranks = list(zip(status.ranks, status.totals, strict=True))
    heard = [(rank, totals) for rank, totals in ranks if totals.seconds > 0.0]
    up = (
        ({"rank": r.rank, "role": r.role, "panel": r.panel, "host": totals.host}, int(r.alive)) for r, totals in ranks
    )
    yield _family("wall_rank_up", "gauge", "1 for a rank that is heard of.", up)
    for name, kind, says, attribute in _OF_TOTALS:
        values = (({"rank": r.rank}, getattr(totals, attribute)) for r, totals in heard)
        yield _family(f"wall_rank_{name}", kind, says, values)
    credit = (({"rank": r.rank}, totals.credit) for r, totals in heard if totals.credit >= 0)
    yield _family("wall_rank_credit_bytes", "gauge", "Bytes that the rank may send now, where least may.", credit)
    ages = (({"rank": r.rank}, r.oldest_sample_s) for r, _ in ranks if r.oldest_sample_s is not None)
    says = "Age of the oldest sample that is shown of the rank's region."
    yield _family("wall_rank_oldest_sample_age_seconds", "gauge", says, ages)
    busy = (({"rank": r.rank}, r.busy_s) for r, _ in heard)
    says = "Time for which one piece of work has held up a rank that is heard of."
    yield _family("wall_rank_busy_seconds", "gauge", says, busy)
    dropped = (({"rank": r.rank, "reason": why}, n) for r, t in heard for why, n in sorted(t.dropped.items()))
    yield _family("wall_rank_dropped_total", "counter", "What the rank has dropped, by reason.", dropped)
