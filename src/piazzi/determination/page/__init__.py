"""What the page of a determination shows."""
