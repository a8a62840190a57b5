"""Isolation of a method: it gets the observations only, its clocks are not its own, and it may die.

- `runs`: run methods on datasets, in processes that receive a copy of the observations.
- `supervisor`: the process that starts a method's worker, measures it and survives it.
- `worker`: the process that runs the method's code.
- `connection`: messages from worker to supervisor, and times that the kernel stamps.
- `process_tree`: find, measure and end the processes that a method has started.
- `method_sources`: copy the modules of a user's method to where its process imports them.
- `reference_kernel`: a fixed computation, by whose time the times of machines are compared.
"""
