"""Compiled loops that only measurements run."""
