"""The world the antenna is put into, and the judge."""
