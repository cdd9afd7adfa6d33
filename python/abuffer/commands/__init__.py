"""The commands of the command line, one a file: `add` says what a command takes, `_run` does it."""
