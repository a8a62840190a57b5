"""Running methods without access to the truth, and scoring their estimates."""
