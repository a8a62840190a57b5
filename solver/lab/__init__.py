"""Images in, answers out: what runs beside a real camera."""
