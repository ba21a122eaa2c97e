"""Where to sample next. One file a sampler; all speak the interface in base.py."""
