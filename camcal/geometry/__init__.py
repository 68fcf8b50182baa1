"""The project's own forward model in pure numpy: an independent check on OpenCV, never a restatement of it."""
