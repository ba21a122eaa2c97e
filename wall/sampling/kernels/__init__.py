"""Compiled loops of the samplers: permutations, scores, the K-D cut."""
