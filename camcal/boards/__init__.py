"""What is printed: features, patterns, the one-line SPEC, and printing (which returns bytes)."""
