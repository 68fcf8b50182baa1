"""The figures of a report: pure functions from a `Record` to matplotlib figures, and from these to SVG, PNG and PDF."""
