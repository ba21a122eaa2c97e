"""The compositing graph: checking and planning it, and running a rank's operators."""
