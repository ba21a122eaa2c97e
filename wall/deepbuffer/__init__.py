"""The samples that a compositor keeps."""
