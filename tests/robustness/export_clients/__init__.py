"""Check of exports with the client libraries themselves, each in an environment of its own."""
