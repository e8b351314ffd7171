"""The command line: no logic, and no heavy import before a command runs."""
