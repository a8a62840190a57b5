"""The words of the antenna: what every other room speaks in. No physics, no methods."""
