"""Image to Detection or Rejected: board finders and sub-pixel refinement."""
