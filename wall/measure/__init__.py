"""Measure this machine and this code."""
