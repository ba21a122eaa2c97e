"""Starts and executes the ranks of a run: bootstrap, clock, links, sinks, the loop."""
