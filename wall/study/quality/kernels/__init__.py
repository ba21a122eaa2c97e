"""Compiled loops of the rival methods that `wall measure quality` compares with."""
