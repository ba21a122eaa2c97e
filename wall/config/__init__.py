"""Configuration: pydantic models of the YAML, loading with positions for errors, the JSON Schema."""
