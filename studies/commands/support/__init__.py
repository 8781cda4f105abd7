"""Code for several commands: arguments, output files, messages, scenes, a budget."""
