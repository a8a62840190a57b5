"""Running methods behind the truth wall, and judging what they answer."""
