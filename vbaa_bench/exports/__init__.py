"""Exports of datasets and collections to the formats of other tools; each is read back."""
