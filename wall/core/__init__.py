"""What every layer may import: data types, errors, the kernel decorator, colour, field types."""
