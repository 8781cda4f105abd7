"""What several commands need: arguments, output files, messages, scenes, a budget."""
