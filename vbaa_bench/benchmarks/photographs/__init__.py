"""Photographs of one beam, as a laboratory takes them with a phone, with truth, and their score."""
