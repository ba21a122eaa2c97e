"""The command `wall`, also as python -m wall."""

import atexit
import gc
import os
import signal
import sys


def main() -> None:
    """Entry point; Ctrl-C while the program is being loaded has nothing to end but itself."""
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # looked for among all packages: 80 ms of a start
    atexit.register(gc.freeze)  # or a last collection goes through all that was imported, for 160 ms
    try:
        from wall.core.mpi import under_mpi

        if under_mpi():
            from wall.core.system import end_with_parent

            end_with_parent(signal.SIGTERM)  # or ranks would outlive an mpirun that was killed
        from wall.cli import main as run
    except KeyboardInterrupt:
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
