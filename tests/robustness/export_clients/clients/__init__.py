"""Programs that read exports with the client libraries, in environments of their own."""
