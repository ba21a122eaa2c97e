"""Planes of numbers as streams of bits: all numbers of one kind stand together."""
