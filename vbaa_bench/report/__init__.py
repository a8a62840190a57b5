"""The report: one HTML page that fetches nothing, and its figures."""
