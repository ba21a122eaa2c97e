"""Walls and graphs that were described for other systems, as configurations of this one."""
