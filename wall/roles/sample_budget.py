"""A refresh that cannot be made in time gets coarser, of fewer samples, rather than rarer."""

from __future__ import annotations

LATE = 0.03  # of the period by which refreshes are further apart than wanted: less is noise of a machine's scheduler
FEWER, MORE = 0.97, 1.01  # factors at each refresh: from all to half of the samples in 0.8 s at 30 Hz, back in 2.3 s
LEAST_SHARE = 0.5  # of the samples: with fewer, holes cost more than the rate gains, see docs/lab/live.md


class SampleBudget:
    """What share of its samples an image keeps."""

    def __init__(self) -> None:
        self.share = 1.0

    def after(self, lateness: float) -> float:
        """The share from a refresh on; `lateness`: see FollowedView."""
        self.share = min(1.0, max(LEAST_SHARE, self.share * (FEWER if lateness > LATE else MORE)))
        return self.share
