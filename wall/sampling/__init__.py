"""Samplers: where to trace next. One file a sampler; all have the interface in base.py."""
