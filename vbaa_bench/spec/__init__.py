"""scenes/*.yaml -> Scene -> Trials: what is to be simulated, and with which random numbers."""
