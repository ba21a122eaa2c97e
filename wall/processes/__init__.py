"""Who does what: manager, renderers, compositors, and how they find each other."""
