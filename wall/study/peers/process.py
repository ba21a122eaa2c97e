"""Draw pictures by another renderer for a while, as fast as it can: its process.

    python -m wall.study.peers.process pyvista FOLDER

FOLDER/job.json says what is wanted, triangles.npz and poses.npy what is drawn; shown.npy, still.npy and done.json come
of it. A picture is drawn from where the camera is when it is begun, or, of renderers whose name ends in `_ahead`, from
where it will be when the picture is complete, if that takes as long as the one before. No picture is begun before
the display asks for the next: within a refresh there is one at most.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from wall.study.peers.held import Held
from wall.study.peers.renderers import PEERS, Peer, Pose, read_triangles

AHEAD = "_ahead"
JOB, DONE, TRIANGLES, POSES, SHOWN, STILL = (
    "job.json", "done.json", "triangles.npz", "poses.npy", "shown.npy", "still.npy",
)  # fmt: skip
POSE_S = 0.001  # between the cameras of poses.npy
STILL_PICTURES = 8  # from a camera at rest, whose mean is kept: what is left of noise is small
WARM_PICTURES = 3  # before time begins: what a renderer compiles or loads at first is not measured


def main(name: str, folder: Path) -> None:
    """Draw, and write what came of it."""
    job: dict[str, Any] = json.loads((folder / JOB).read_text(encoding="utf-8"))
    poses, known = np.load(folder / POSES), PEERS[name.removesuffix(AHEAD)]
    size = (job["size"][0], job["size"][1])
    peer = known.start(read_triangles(folder / TRIANGLES), size, job["fov"])

    def pose(at: float) -> Pose:
        row = poses[min(round(at / POSE_S), len(poses) - 1)]
        return Pose(origin=row[:3, 3], rotation=row[:3, :3])

    for k in range(WARM_PICTURES):
        peer.draw(pose(k * POSE_S))
    held, began = Held(job["moments"], size), time.monotonic()
    _draw(peer, held, began, job, ahead=name.endswith(AHEAD), pose=pose)
    np.save(folder / SHOWN, np.array(held.shown))
    still = np.mean([peer.draw(pose(job["still"])) for _ in range(STILL_PICTURES)], axis=0)
    np.save(folder / STILL, np.rint(still).astype(np.uint8))
    done = {"began": began, "completed": held.completed, "version": known.version(), "device": peer.device}
    (folder / DONE).write_text(json.dumps(done), encoding="utf-8")


def _draw(peer: Peer, held: Held, began: float, job: dict[str, Any], *, ahead: bool, pose: Any) -> None:
    """Until time is over; never for a moment before that of the image before, also after one that took long."""
    lasts = moment = 0.0
    while (now := time.monotonic() - began) < job["seconds"]:
        moment = max(moment, now + lasts) if ahead else now
        image = peer.draw(pose(moment))
        completed = time.monotonic() - began
        held.take(image, completed)
        lasts = completed - now
        time.sleep(max(0.0, 1.0 / job["refresh_hz"] - lasts))
    held.end()


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
