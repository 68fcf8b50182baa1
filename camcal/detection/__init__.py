"""Image to Detection or Rejected: board finders, checks, and first sub-pixel corners."""
