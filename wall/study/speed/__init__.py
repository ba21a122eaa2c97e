"""Measures the speed and memory of this machine and this code."""
