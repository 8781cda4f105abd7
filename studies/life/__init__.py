"""Life of a damper: wear opens its cavities, and the response changes, over thousands of hours."""
