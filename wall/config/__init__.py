"""What a run is asked to do: the YAML's models, its loading with positions, its JSON Schema."""
