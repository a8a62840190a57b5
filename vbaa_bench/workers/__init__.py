"""Processes that run jobs: of this machine, or of a Dask cluster; or this process itself."""
