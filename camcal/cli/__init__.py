"""The command line: one small module per command that parses, calls its workflow and prints."""
