"""One function per command: read, run the stages in parallel, write. This is the Python API."""
