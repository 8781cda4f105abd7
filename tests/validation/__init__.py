"""Cases that others have published, and the page that shows them."""
