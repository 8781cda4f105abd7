"""Long commands are jobs: checked input, work with progress that can resume after a kill, and results."""
