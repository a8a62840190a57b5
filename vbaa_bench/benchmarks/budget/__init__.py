"""Error budget of the solver's methods: stages replaced by the truth, one after the other.

The variants of this room are diagnostic: they belong to the judge, use the truth, and are never
scored as entrants.
"""
