"""Shared by several commands: arguments, output files, messages, scenes, a budget."""
