"""New cameras, maps and valid masks that take the lens out of an image."""
