"""The command line: one file for each command.  Heavy modules are imported inside commands, so that help is quick."""
