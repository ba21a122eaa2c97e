"""Compiled loops over stored samples: insert, reproject, sort, evict."""
